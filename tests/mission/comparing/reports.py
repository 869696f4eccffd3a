"""A run reported by hand: events one after another, each at its second, and poses where they are wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stopgo.mission.comparing.run_collector import SOURCE
from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Pose
from stopgo.mission.run.run_log import RunLog, Track

NS = 1_000_000_000
BEGAN_NS = 1_795_000_000 * NS
SCAN = {"file": "a.e57", "size": 1, "sha256": "0" * 64, "points": 1}


def told(
    mission: Mission, *events: tuple[type, float, dict[str, Any]], poses: Sequence[tuple[float, ...]] = ()
) -> RunLog:
    """The log of events (kind, seconds, fields) and of poses (seconds, x, y)."""
    made = tuple(_event(mission, number, *event) for number, event in enumerate(events, start=1))
    table = np.array(poses, dtype=np.float64).reshape(-1, 3)
    track = Track.of(BEGAN_NS + np.rint(table[:, 0] * NS), table[:, 1:], np.zeros(len(table)))
    revision = made[-1].revision if made else None
    return RunLog("r1", "run-1", mission.id, revision, SOURCE, track, made)


def _event(mission: Mission, number: int, kind: Any, seconds: float, fields: dict[str, Any]) -> AnyEvent:
    common = {
        "number": number, "robot": "r1", "boot_id": "b", "run_id": "run-1", "mission_id": mission.id,
        "revision": mission.revision, "robot_ns": BEGAN_NS + round(seconds * NS), "mission_time_s": seconds,
    }  # fmt: skip
    event: AnyEvent = kind(**{**common, **fields})
    return event


def at(x: float, y: float, heading: float = 0.0) -> Pose:
    return Pose(x=x, y=y, heading=heading)
