"""Reads what a robot has written down of a run: what a station missed, each pose once and in order."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

import msgspec

from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import RECORD_PAGE, KeyExpressions, RecordEntry, RecordIndex, RecordPage
from stopgo.bridge.station.robot_replies import read_reply
from stopgo.bridge.station.window import Window, windowed
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.events import Health, Pose, PoseReport, PosesMissing, StateReport

PAGE_S = 10.0
"""How long a page is waited for: on a slow line it takes a second, and others lie before it."""
AGAIN_S = 0.5
"""How soon the robot is asked again for what it has not written down yet."""
GIVEN_UP_S = 20.0
"""How long a pose that was missed is waited for while the robot answers."""
HEARD = 1000
"""Poses that were heard and wait for those before them: twenty seconds."""
BOOT_S = 600.0
"""How far back a record is read after a reboot: the clock of a sped-up robot may have been set back."""
READING = "reading its record"


class Past(msgspec.Struct, frozen=True):
    """How the base was, or a state that was not heard when it was told."""

    report: StateReport | Health


Recorded = PoseReport | PosesMissing | Past


def read_page(link: Link, keys: KeyExpressions, run_id: str, **since: int) -> RecordPage | None:
    """A page of a run's record, `since` a number or from a `time` (ns) on; none if no answer came."""
    parameters = {"run": run_id} | {name: str(value) for name, value in since.items()}
    reply = link.ask(keys.record, timeout_s=PAGE_S, parameters=parameters, bulk=True)
    return None if reply is None else read_reply(reply, RecordPage, robot=keys.robot, what=READING)


def read_index(link: Link, keys: KeyExpressions, *, timeout_s: float) -> RecordIndex | None:
    """The runs that the robot keeps records of; none if no answer came."""
    reply = link.ask(keys.record, timeout_s=timeout_s)
    return None if reply is None else read_reply(reply, RecordIndex, robot=keys.robot, what=READING)


def pages(
    link: Link, keys: KeyExpressions, run_id: str, first: RecordPage, took_s: float
) -> Iterator[RecordPage]:
    """`first`, which took so long, and all pages after it; ends early where no answer comes."""
    yield first
    later = range(first.since + RECORD_PAGE, first.newest, RECORD_PAGE)
    for _, page in windowed(later, lambda since: read_page(link, keys, run_id, since=since), Window(took_s)):
        if page is None:
            return
        yield page


def past_run(link: Link, keys: KeyExpressions, run_id: str, *, patience_s: float) -> Iterator[Recorded]:
    """The whole record of a run, also over a line that is cut in between.

    Raises
    ------
    OutcomeUnknown
        If the robot did not answer for so long, or tells of more than it gives.
    """
    history = RecordHistory(link, keys)
    history.run_id, since, newest = run_id, 0, 1
    went_on_at = time.monotonic()
    while since < newest:
        began = time.monotonic()
        first = read_page(link, keys, run_id, since=since)
        if first is None:
            if time.monotonic() - went_on_at > patience_s:
                raise OutcomeUnknown(f"{keys.robot} stopped answering; the run was not read to its end")
            time.sleep(AGAIN_S)
            continue
        newest, missing = first.newest, first.missing
        for page in pages(link, keys, run_id, first, time.monotonic() - began):
            if not page.entries and since < newest:
                raise OutcomeUnknown(f"{keys.robot} tells of {newest} entries of the run and gives {since}")
            for entry in page.entries:
                yield from history.told(entry)
            since, went_on_at = since + len(page.entries), time.monotonic()
    yield from missing


class RecordHistory:
    """Which poses of a run have been told; those that were missed are read from the robot's record."""

    patience_s = GIVEN_UP_S

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self._link = link
        self._keys = keys
        self._heard: deque[PoseReport] = deque(maxlen=HEARD)
        self._pages: Iterator[RecordPage] | None = None
        self._ask_at = 0.0
        self._went_on_at = time.monotonic()
        self._boot_id: str | None = None
        self._told = 0
        self._told_ns = 0
        self._healths: deque[int] = deque(maxlen=HEARD)
        """Times of what was told of the base."""
        self.run_id: str | None = None

    @property
    def behind(self) -> bool:
        """Whether poses of the run have not been told, and it is time to read them."""
        due = self._pages is not None or time.monotonic() >= self._ask_at
        return due and self.run_id is not None and bool(self._heard)

    def take(self, pose: PoseReport) -> Iterator[PoseReport]:
        """Tell a pose if it is the next one; else it waits for those before it."""
        if pose.run_id != self.run_id or self.run_id is None:
            return
        if not self._heard:
            self._went_on_at = time.monotonic()
        self._heard.append(pose)
        if self._pages is None:
            yield from self._next_heard()

    def health(self, told: Health) -> Iterator[Past]:
        """Tell how the base was, unless that has been told."""
        if told.run_id == self.run_id and told.robot_ns not in self._healths:
            self._healths.append(told.robot_ns)
            yield Past(told)

    def catch_up(self) -> Iterator[Recorded]:
        """A page of what was missed."""
        if self._pages is None:
            self._pages = self._asked()
        page = next(self._pages, None)
        if page is None or page.since + len(page.entries) >= page.newest:
            self._pages, self._ask_at = None, time.monotonic() + AGAIN_S
        for entry in () if page is None else page.entries:
            yield from self.told(entry)
        if page is not None and self._pages is None:
            yield from self._next_heard()
            yield from self._skipped(page.missing)

    def told(self, entry: RecordEntry) -> Iterator[Recorded]:
        """What of an entry has not been told."""
        for gap in entry.missing:
            if gap.until_ns > self._told_ns:
                yield msgspec.structs.replace(gap, robot_ns=max(gap.robot_ns, self._told_ns))
        if entry.poses and entry.boot_id != self._boot_id:
            self._boot_id, self._told = entry.boot_id, 0
        fresh = [pose for pose in entry.poses if pose.seq > self._told]
        reports: tuple[StateReport | Health, ...] = (*entry.states, *entry.health)
        for report in reports if fresh else ():
            yield from self.health(report) if isinstance(report, Health) else (Past(report),)
        for row in fresh:
            yield self._now_told(
                PoseReport(
                    robot=self._keys.robot, boot_id=entry.boot_id, seq=row.seq, robot_ns=row.robot_ns,
                    run_id=self.run_id, mission_time_s=(row.robot_ns - entry.began_ns) / 1e9,
                    pose=Pose(x=row.x, y=row.y, heading=row.heading), speed=row.speed,
                )
            )  # fmt: skip

    def _asked(self) -> Iterator[RecordPage]:
        assert self.run_id is not None
        rebooted = bool(self._heard) and self._heard[0].boot_id != self._boot_id
        since_ns = max(0, self._told_ns - round(BOOT_S * 1e9)) if rebooted else self._told_ns
        began = time.monotonic()
        first = read_page(self._link, self._keys, self.run_id, time=since_ns)
        if first is not None:
            yield from pages(self._link, self._keys, self.run_id, first, time.monotonic() - began)

    def _next_heard(self) -> Iterator[PoseReport]:
        """Poses that were heard and follow what was told; those that were told are let go."""
        while self._heard and self._heard[0].boot_id == self._boot_id:
            if self._heard[0].seq > self._told + 1:
                return
            pose = self._heard.popleft()
            if pose.seq > self._told:
                yield self._now_told(pose)

    def _skipped(self, missing: tuple[PosesMissing, ...]) -> Iterator[Recorded]:
        """Go on with what was heard where the robot cannot write down what comes before it."""
        reason = missing[-1].reason if missing else "the robot's record does not have them"
        if not self._heard or not (missing or time.monotonic() - self._went_on_at > GIVEN_UP_S):
            return
        pose = self._heard[0]
        began_ns = pose.robot_ns - round((pose.mission_time_s or 0.0) * 1e9)
        since_ns = self._told_ns or began_ns
        yield PosesMissing(
            run_id=self.run_id or "", robot_ns=since_ns, until_ns=pose.robot_ns,
            mission_time_s=(since_ns - began_ns) / 1e9, reason=reason,
        )  # fmt: skip
        self._boot_id, self._told = pose.boot_id, pose.seq - 1
        yield from self._next_heard()

    def _now_told(self, pose: PoseReport) -> PoseReport:
        self._told, self._told_ns = pose.seq, pose.robot_ns
        self._went_on_at = time.monotonic()
        return pose
