"""Position of a vehicle in its list: the current item, and jumps of it beyond waits."""

from __future__ import annotations

from dataclasses import dataclass, replace

from stopgo.mission.mavlink.enums import MissionState
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.vehicle_status import TimestampedMessage
from stopgo.mission.mavlink.telemetry import Message, mission_id_of
from stopgo.mission.run.states import Run

JUMP_SLACK_S = 1.0
"""Lateness of the vehicle's clock: its messages come several times a second, and may be lost."""
UNKNOWN_TOTAL = 65_535


@dataclass(frozen=True)
class Jump:
    """A change of the current item beyond waits that cannot have been over."""

    listed: ListedMission
    first: int
    """Index of the item before it."""
    end: int
    """Index of the item after it."""
    ns: int
    """Time when it was seen."""


@dataclass(frozen=True)
class Work:
    """The current item since it became current."""

    sequence: int
    complete: bool
    """True if all is done."""
    since_ns: int
    since_ms: int
    """The same on the vehicle's own clock; 0 as long as that is not known."""
    begin_seen: bool
    """True if the item before it was seen; else it may have become current long before."""


class ListPosition:
    """Takes reports of the current item and of reached ones; returns the position in the list on request."""

    def __init__(self) -> None:
        self._current: TimestampedMessage | None = None
        self._reached: Message | None = None
        self._work: Work | None = None
        self.went_back = False
        """True if the last change of the current item was to an earlier one."""
        self._jump: Jump | None = None
        """The last jump, as far as the vehicle has not gone back behind it."""

    @property
    def is_known(self) -> bool:
        """True once the vehicle has reported its current item."""
        return self._current is not None

    @property
    def sequence(self) -> int | None:
        """Number of the current item."""
        return None if self._work is None else self._work.sequence

    @property
    def since_ns(self) -> int:
        """Time since when it is current."""
        return 0 if self._work is None else self._work.since_ns

    @property
    def current_ns(self) -> int:
        """Time of the last report of the current item."""
        return 0 if self._current is None else self._current.ns

    @property
    def items(self) -> int | None:
        """Number of items on the vehicle, without home; `None` if it is not reported."""
        if self._current is None:
            return None
        current = self._current.message
        if current.mission_state == MissionState.NO_MISSION:
            return 0
        return current.total if 0 < current.total < UNKNOWN_TOTAL else None

    @property
    def mission_id(self) -> int:
        """Id of the vehicle's list, which changes with it; 0 if the vehicle reports none."""
        return 0 if self._current is None else mission_id_of(self._current.message)

    def place(self, listed: ListedMission) -> int:
        """Return the index in the list of the current item; the list's length once all is done."""
        assert self._current is not None
        current = self._current.message
        if current.mission_state == MissionState.COMPLETE:
            return listed.end
        last = listed.sequence(listed.end - 1)
        through = self._reached is not None and self._reached.seq == last == current.seq
        if through and current.mission_state == MissionState.UNKNOWN:
            return listed.end
        return listed.place(current.seq)

    def is_jumped(self, run: Run, listed: ListedMission) -> bool:
        """Return True if the vehicle's item was set beyond the run's stop."""
        jump = self._jump
        if jump is None or jump.listed is not listed or run.at >= len(listed.stops):
            return False
        return jump.first < listed.stops[run.at].after <= jump.end

    @property
    def jumped_ns(self) -> int:
        """Time of the last jump."""
        return 0 if self._jump is None else self._jump.ns

    def is_at_stop(self, listed: ListedMission | None) -> bool:
        """Return True if the vehicle is at a stop, and not driving."""
        if listed is None or self._current is None:
            return False
        place = self.place(listed)
        return any(items.at < place < items.after for items in listed.stops)

    def take_reached(self, message: Message) -> None:
        self._reached = message

    def take_current(
        self, message: Message, listed: ListedMission | None, *, boot_ms: int, now_ns: int
    ) -> bool:
        """Take a report of the current item at a time of the vehicle; return True if it is the same."""
        self._current = TimestampedMessage(message, now_ns)
        before = self._work
        complete = message.mission_state == MissionState.COMPLETE
        work = Work(message.seq, complete, now_ns, boot_ms, begin_seen=before is not None)
        if before is not None and (before.sequence, before.complete) == (work.sequence, work.complete):
            if before.since_ms == 0:
                self._work = replace(before, since_ms=boot_ms)
            return True
        if before is not None and listed is not None:
            self._note_jump(listed, before, work)
        self._work = work
        return False

    def _note_jump(self, listed: ListedMission, before: Work, now: Work) -> None:
        """Note a jump: the item has changed before the waits between the two can have been over."""
        first = listed.end if before.complete else listed.place(before.sequence)
        place = self.place(listed)
        self.went_back = place < first
        if self._jump is not None and (self._jump.listed is not listed or place < self._jump.end):
            self._jump = replace(self._jump, end=place) if self._jump.listed is listed else None
        if place <= first or not 0 < before.since_ms <= now.since_ms:
            return
        waits_s = listed.wait_s(first if before.begin_seen else first + 1, place)
        passed_s = max((now.since_ns - before.since_ns) / 1e9, (now.since_ms - before.since_ms) / 1e3)
        if waits_s > passed_s + JUMP_SLACK_S:
            self._jump = Jump(listed, first, place, now.since_ns)
