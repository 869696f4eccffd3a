"""Three stops round a corner, for a vehicle that drives them by itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from stopgo.mission.document import Mission, Scan, Stop
from stopgo.mission.run.events import AnyEvent
from tests.mission.worlds import mission_of, stop


def tour(**details: Any) -> Mission:
    """Stops 1 m ahead, 1 m further and 1 m to the left by way of a corner, and 1 m back."""
    made = (
        stop("S1", (0.0, 0.0), (1.0, 0.0)),
        stop("S2", (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), heading=math.pi / 2),
        stop("S3", (2.0, 1.0), (1.0, 1.0), heading=math.pi),
    )
    return mission_of(*(quick(one, **details) for one in made))


def quick(one: Stop, **details: Any) -> Stop:
    plain = {"settle_s": 1.0, "scan": Scan(profile="default", duration_s=2.0, timeout_s=20.0), "retries": 0}
    return msgspec.structs.replace(one, **(plain | details))


def told(events: Sequence[AnyEvent]) -> list[str]:
    """The events as words, such as "Arrived S1"."""
    return [f"{type(event).__name__} {getattr(event, 'stop', '')}".strip() for event in events]
