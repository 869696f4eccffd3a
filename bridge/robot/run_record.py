"""The record of one run: an entry each half second, and the gaps between entries."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import msgspec

from stopgo.bridge.link.protocol import RECORD_PAGE, PoseRow, RecordEntry, RecordPage, encode
from stopgo.bridge.record_file import RecordFile
from stopgo.mission.document.decoding import decoded
from stopgo.mission.run.events import Health, PoseReport, PosesMissing, StateReport

RESTARTED = "the robot's program was restarted"
UNSEEN = "the robot recorded nothing then"
DAMAGED = "the robot's disk has changed what was written"


class RunRecord:
    """The written entries of one run, and the values for the next entry."""

    def __init__(self, run_id: str, file: RecordFile) -> None:
        self.run_id = run_id
        self.file = file
        self.lost: PosesMissing | None = None
        """Poses that could not be written, and are not in an entry's `missing` yet."""
        last = self._entry(file.newest)
        self._boot_id = None if last is None else last.boot_id
        self._began_ns = 0 if last is None else last.began_ns
        self._until_ns = max((pose.robot_ns for pose in last.poses), default=0) if last else 0
        """Time of the newest pose that is written."""
        self._over = False
        self._poses: list[PoseRow] = []
        self._states: list[StateReport] = []
        self._health: list[Health] = []
        self._missing: list[PosesMissing] = []
        self._state: StateReport | None = None
        self._last_health: Health | None = None

    def pose(self, report: PoseReport, *, began_ns: int, over: bool, seen: bool) -> None:
        """Add a pose; of a run that is over only the first. `seen`: the run was recorded from its begin."""
        if self._over:
            return
        self._over, self._began_ns = over, began_ns
        if report.boot_id != self._boot_id:
            since_ns = self._until_ns or began_ns
            if self._boot_id is not None or not seen:
                why = UNSEEN if self._boot_id is None else RESTARTED
                self._missing.append(self._gap(since_ns, report.robot_ns, why))
            self._boot_id = report.boot_id
        pose = report.pose
        self._poses.append(PoseRow(report.seq, report.robot_ns, pose.x, pose.y, pose.heading, report.speed))

    def state(self, report: StateReport) -> None:
        """Add a state, if it differs from the one before."""
        same = msgspec.structs.replace(report, seq=0, robot_ns=0)
        if same != self._state and not self._over:
            self._state = same
            self._states.append(report)

    def health(self, report: Health) -> bool:
        """Add the base's health, if it differs from the one before; true if it does."""
        same = msgspec.structs.replace(report, robot_ns=0)
        if same == self._last_health or self._over:
            return False
        self._last_health = same
        self._health.append(report)
        return True

    def write(self, shortage: Callable[[int], str]) -> None:
        """Write an entry with what was added, or note why that was not possible."""
        if not self._poses or self._boot_id is None:
            return
        first_ns, last_ns = self._poses[0].robot_ns, self._poses[-1].robot_ns
        lost = [] if self.lost is None else [msgspec.structs.replace(self.lost, until_ns=first_ns)]
        entry = RecordEntry(
            number=self.file.newest + 1, boot_id=self._boot_id, began_ns=self._began_ns,
            poses=tuple(self._poses), states=tuple(self._states), health=tuple(self._health),
            missing=(*lost, *self._missing),
        )  # fmt: skip
        why = self._written(entry, shortage)
        if why:
            self._lose(why, last_ns)
        else:
            self.lost, self._until_ns = None, last_ns
        self._poses, self._states, self._health, self._missing = [], [], [], []

    def _written(self, entry: RecordEntry, shortage: Callable[[int], str]) -> str:
        """Write the entry; return why it could not be written, empty if it was."""
        body = encode(entry)
        try:
            why = shortage(len(body))
            if not why:
                self.file.append(entry.number, body)
        except OSError as error:
            return f"the robot's record cannot be written: {error.strerror}"
        return why

    def _lose(self, why: str, until_ns: int) -> None:
        since_ns = self.lost.robot_ns if self.lost else self._until_ns or self._began_ns
        self.lost = self._gap(since_ns, until_ns, why)
        self._state = self._last_health = None  # so that they are written when there is space

    @property
    def newest_ns(self) -> int:
        """Time of the newest pose that is written, 0 if there is none."""
        return self._until_ns

    def page(self, since: int) -> RecordPage:
        """Return the entries above a number; a damaged one is a gap with that reason."""
        numbers = range(since + 1, min(since + RECORD_PAGE, self.file.newest) + 1)
        entries = tuple(self._entry(number) or self._damaged(number) for number in numbers)
        missing = () if self.lost is None else (self.lost,)
        return RecordPage(
            run_id=self.run_id, since=since, entries=entries, newest=self.file.newest, missing=missing
        )

    def before(self, robot_ns: int) -> int:
        """Return the number of the newest entry with nothing later than a time."""
        low, high = 0, self.file.newest
        while low < high:
            middle = (low + high + 1) // 2
            entry = next(self._sound(range(middle, low, -1)), None)
            if entry is None or entry.poses[-1].robot_ns <= robot_ns:
                low = middle
            else:
                high = middle - 1
        return low

    def _entry(self, number: int) -> RecordEntry | None:
        body = self.file.read(number)
        with suppress(msgspec.DecodeError):  # a newer stopgo's
            return None if body is None else decoded(body, RecordEntry)
        return None

    def _damaged(self, number: int) -> RecordEntry:
        before = next(self._sound(range(number - 1, 0, -1)), None)
        after = next(self._sound(range(number + 1, self.file.newest + 1)), None)
        known = before or after
        began_ns = known.began_ns if known else 0
        since_ns = before.poses[-1].robot_ns if before else began_ns
        until_ns = after.poses[0].robot_ns if after else since_ns
        gap = PosesMissing(
            run_id=self.run_id, robot_ns=since_ns, until_ns=until_ns,
            mission_time_s=(since_ns - began_ns) / 1e9, reason=DAMAGED,
        )  # fmt: skip
        boot_id = known.boot_id if known else ""
        return RecordEntry(number=number, boot_id=boot_id, began_ns=began_ns, missing=(gap,))

    def _sound(self, numbers: range) -> Iterator[RecordEntry]:
        entries = (self._entry(number) for number in numbers)
        return (entry for entry in entries if entry is not None and entry.poses)

    def _gap(self, since_ns: int, until_ns: int, why: str) -> PosesMissing:
        return PosesMissing(
            run_id=self.run_id, robot_ns=since_ns, until_ns=until_ns,
            mission_time_s=(since_ns - self._began_ns) / 1e9, reason=why,
        )  # fmt: skip
