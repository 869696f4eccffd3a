"""Motion of a vehicle during its scans in AUTO: poses between a stop's settling and the end of its wait.

A pose counts once a later report confirms the current item: before that the vehicle may have left.
"""

from __future__ import annotations

from stopgo.mission.mavlink.following.listed_mission import ListedMission, StopItems
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scan_motion import ScanMotion


class ScanWatch:
    """Takes poses and confirmed items; `why` says how the vehicle moved during the scan at a stop."""

    def __init__(self) -> None:
        self._watched: tuple[ListedMission, str, ScanMotion] | None = None
        self._open: list[tuple[Pose, float]] = []
        """Poses and speeds since the last report of the current item."""

    def take_pose(self, pose: Pose, speed: float) -> None:
        self._open.append((pose, speed))

    def take_item(self, listed: ListedMission | None, place: int, *, same: bool) -> None:
        """Take a report of the current item; `same` if it has not changed since the last one."""
        taken, self._open = self._open, []
        at = None if listed is None else _scan_at(listed, place)
        if listed is None or at is None:
            return self._leave(listed, place)
        if self._watched is None or self._watched[0] is not listed or self._watched[1] != at.stop:
            tolerance_m = next(stop.tolerance_m for stop in listed.mission.stops if stop.id == at.stop)
            self._watched = (listed, at.stop, ScanMotion(tolerance_m))
        for pose, speed in taken if same else ():
            self._watched[2].take(pose, speed)

    def _leave(self, listed: ListedMission | None, place: int) -> None:
        """Forget a scan on the leg to its stop: the vehicle is driven there for another one."""
        watched = "" if self._watched is None else self._watched[1]
        legs = () if listed is None else listed.stops
        if any(items.stop == watched and items.first <= place <= items.at for items in legs):
            self._watched = None

    def why(self, listed: ListedMission, stop: str) -> str:
        """Return how the vehicle moved during the last scan at a stop; empty if it stood, as far as known."""
        watched = self._watched
        return watched[2].why if watched is not None and watched[:2] == (listed, stop) else ""


def _scan_at(listed: ListedMission, place: int) -> StopItems | None:
    """Return the stop whose scan an item belongs to; `None` for an item of a leg or of settling."""
    return next((items for items in listed.stops if items.scan <= place < items.after), None)
