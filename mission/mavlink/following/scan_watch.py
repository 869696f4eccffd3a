"""Motion of a vehicle during its scans in AUTO: poses between a stop's settling and the end of its wait.

A pose counts once a later report confirms the current item: before that the vehicle may have left.
"""

from __future__ import annotations

from stopgo.mission.mavlink.following.listed_mission import ListedMission, StopItems
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scan_motion import ScanMotion

TRIGGER_SLACK_NS = 10**9
"""Lateness of the report of a scan's item: it comes several times a second, and may be lost."""


class ScanWatch:
    """Takes poses and confirmed items; `why` says how the vehicle moved during the scan at a stop."""

    def __init__(self) -> None:
        self._began_ns = 0
        """Time since when the current item belongs to the watched scan."""
        self._is_reported = True
        self._left_due_ns: int | None = None
        """Planned end of the last scan, also after it was left for another attempt."""
        self._older_due_ns: int | None = None
        """Planned end of a scan that was left before its report came: its scanner may still be at work."""
        self._watched: tuple[ListedMission, str, ScanMotion] | None = None
        self._open: list[tuple[Pose, float]] = []
        """Poses and speeds since the last report of the current item."""

    def take_pose(self, pose: Pose, speed: float) -> None:
        self._open.append((pose, speed))

    def take_report(self, now_ns: int) -> bool:
        """Take a new report of the scanner; return False if it must be that of an older scan.

        Somebody may have driven the vehicle on while its scanner worked: that scan ends at another stop.
        """
        older_ns, self._older_due_ns = self._older_due_ns, None
        due_ns = self._due_ns()
        if older_ns is not None and due_ns is not None and abs(now_ns - older_ns) < abs(now_ns - due_ns):
            return False
        self._is_reported = True
        return True

    def _due_ns(self) -> int | None:
        """Planned end of the watched scan."""
        if self._watched is None:
            return None
        listed, stop, _ = self._watched
        items = next(items for items in listed.stops if items.stop == stop)
        return self._began_ns + round(listed.wait_s(items.scan, items.after) * 1e9)

    def is_after_trigger(self, listed: ListedMission, stop: str, ns: int) -> bool:
        """Return True if a report of that time came once the stop's scan had been triggered."""
        watched = self._watched
        at_scan = watched is not None and watched[:2] == (listed, stop)
        return at_scan and ns >= self._began_ns - TRIGGER_SLACK_NS

    def take_item(self, listed: ListedMission | None, place: int, now_ns: int, *, same: bool) -> None:
        """Take a report of the current item; `same` if it has not changed since the last one."""
        taken, self._open = self._open, []
        at = None if listed is None else _scan_at(listed, place)
        if listed is None or at is None:
            return self._leave(listed, place)
        if self._watched is None or self._watched[0] is not listed or self._watched[1] != at.stop:
            tolerance_m = next(stop.tolerance_m for stop in listed.mission.stops if stop.id == at.stop)
            if not self._is_reported:
                self._older_due_ns = self._left_due_ns
            self._watched = (listed, at.stop, ScanMotion(tolerance_m))
            self._began_ns, self._is_reported = now_ns, False
            self._left_due_ns = self._due_ns()
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
