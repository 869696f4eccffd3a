"""Reasons why the robot was held on its way to a stop that was then given up."""

from __future__ import annotations

import re
from collections.abc import Sequence

from stopgo.mission.run.events import (
    Aborted,
    Arrived,
    Failed,
    Held,
    Homing,
    Resumed,
    Scanned,
    Skipped,
    Unconfirmed,
)
from stopgo.mission.run.run_log import RunLog

ENDS = (Scanned, Unconfirmed, Skipped, Failed)
"""Events that end the work at a stop."""


def held_reasons(log: RunLog, stops: Sequence[str]) -> dict[str, str]:
    """Return the reason of the hold in which each stop was skipped, or the run was aborted or sent home.

    `stops` are the planned stops in order. A run that is still held has a reason for its next stop, too.
    """
    held: Held | None = None
    ended: set[str] = set()
    reasons: dict[str, str] = {}
    for event in log.events:
        if isinstance(event, Held):
            held = event
        elif isinstance(event, ENDS):
            ended.add(event.stop)
            if isinstance(event, Skipped) and held is not None:
                reasons[event.stop] = _with_place(held, log)
            held = None
        elif isinstance(event, Resumed | Arrived):
            held = None
        elif isinstance(event, Aborted | Homing):
            break
    following = next((stop for stop in stops if stop not in ended), None)
    if held is not None and following is not None:
        reasons[following] = _with_place(held, log)
    return reasons


def _with_place(held: Held, log: RunLog) -> str:
    """Return the reason, with the robot's position if it does not name one and a pose shows it."""
    index = log.poses.last_until(held.robot_ns)
    if _PLACE.search(held.reason) or index is None or not log.poses.is_known(index, held.robot_ns):
        return held.reason
    x, y = log.poses.xy[index].tolist()
    return f"{held.reason} at ({x:.2f}, {y:.2f})"


_PLACE = re.compile(r"\(-?[0-9.]+, -?[0-9.]+\)")
