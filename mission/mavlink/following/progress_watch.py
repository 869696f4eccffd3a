"""Progress of a vehicle in AUTO: it drives, turns, waits as its item says, or it is stalled."""

from __future__ import annotations

import math

from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.run.events import Pose

STALLED_S = 8.0
"""Standstill that no item explains: longer than a start takes, and reported within 10 s."""
RESTARTED_NS = 10**9
"""A clock that goes back by more began again."""
REACHED_M = 1.0
"""Distance from a waypoint that an autopilot may take as reached."""
MOVED_M, TURNED_RAD = 0.1, math.radians(5.0)
"""Least motion that is progress: an estimate wanders by less."""


class ProgressWatch:
    """Takes poses of a vehicle and its item; `stalled_s` is the standstill that its item does not explain."""

    def __init__(self) -> None:
        self._since: tuple[int, Pose, ListedMission, int] | None = None
        """Time, pose, list and item of the last progress."""
        self._seen_ns = 0

    def take(
        self, pose: Pose, listed: ListedMission | None, place: int | None, now_ns: int, *, drives: bool
    ) -> None:
        """Take a pose at a time of the vehicle's clock.

        `place` is the index of the current item, `drives` means in AUTO and armed.
        """
        restarted, self._seen_ns = now_ns < self._seen_ns - RESTARTED_NS, now_ns
        if restarted or not drives or listed is None or place is None or place >= listed.end:
            self._since = None
        elif self._since is None or self._since[2:] != (listed, place) or _moved(self._since[1], pose):
            self._since = (now_ns, pose, listed, place)

    def stalled_s(self, listed: ListedMission) -> float:
        """Seconds without progress beyond the wait of the current item; 0 if it is driving or waiting."""
        if self._since is None or self._since[2] is not listed:
            return 0.0
        began_ns, pose, _, place = self._since
        return max(0.0, (self._seen_ns - began_ns) / 1e9 - _wait_s(listed, place, pose))


def _moved(before: Pose, now: Pose) -> bool:
    turned = abs(math.remainder(now.heading - before.heading, math.tau))
    return math.dist((before.x, before.y), (now.x, now.y)) > MOVED_M or turned > TURNED_RAD


def _wait_s(listed: ListedMission, place: int, pose: Pose) -> float:
    """Return the longest wait of an item, seconds; a script's is its timeout, or without end.

    A waypoint's wait begins where it counts as reached.
    """
    item = listed.sent.placed[place].item
    if item.command == Command.NAV_WAYPOINT:
        away = math.dist((pose.x, pose.y), point_at(listed.sent, item.x, item.y))
        return item.params[0] if away <= REACHED_M else 0.0
    if item.command == Command.NAV_SCRIPT_TIME:
        return item.params[1] if item.params[1] > 0 else math.inf
    return listed.wait_s(place, place + 1)
