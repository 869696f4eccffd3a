"""Reading of the robot's telemetry log of a run: poses that a station missed, each once and in order.

The robot writes entries with poses, states and health reports to its telemetry log (`record` on the wire). It
serves them in pages. `read_run` reads the whole log of a finished run. `LogHistory` serves a run in progress:
it merges live poses with logged ones.

Invariants of `LogHistory`:
- `_seq` and `_last_ns` belong to the last pose yielded, of boot `_boot_id`. Each boot numbers from 1.
- Poses are yielded in the order of `seq` without gaps within a boot, or a `PosesMissing` names the gap.
- `_live` holds live poses that arrived and were not yielded yet; they wait for the poses before them.
- `_pages` is set while pages of the log are being read; then live poses wait.
"""

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
"""Timeout for a page; on a slow link it takes a second, and others are queued before it."""
AGAIN_S = 0.5
"""Pause before the next request for poses that the robot has not written yet."""
GIVEN_UP_S = 20.0
"""Longest wait for a missed pose while the robot answers."""
MOST_LIVE = 1000
"""Live poses that can wait for those before them: twenty seconds."""
BOOT_S = 600.0
"""Span of the log that is read again after a reboot: the clock of a sped-up robot may have been set back."""
READING = "reading its telemetry log"


class LoggedReport(msgspec.Struct, frozen=True):
    """Health of the base, or a state that was missed when it was published."""

    report: StateReport | Health


LogItem = PoseReport | PosesMissing | LoggedReport


def read_page(link: Link, keys: KeyExpressions, run_id: str, **since: int) -> RecordPage | None:
    """Request a page of a run's log, `since` an entry's number or a `time` (ns); `None` without an answer."""
    parameters = {"run": run_id} | {name: str(value) for name, value in since.items()}
    reply = link.ask(keys.record, timeout_s=PAGE_S, parameters=parameters, bulk=True)
    return None if reply is None else read_reply(reply, RecordPage, robot=keys.robot, what=READING)


def read_index(link: Link, keys: KeyExpressions, *, timeout_s: float) -> RecordIndex | None:
    """Request the list of runs in the robot's log; `None` without an answer."""
    reply = link.ask(keys.record, timeout_s=timeout_s)
    return None if reply is None else read_reply(reply, RecordIndex, robot=keys.robot, what=READING)


def pages(
    link: Link, keys: KeyExpressions, run_id: str, first: RecordPage, took_s: float
) -> Iterator[RecordPage]:
    """Yield `first`, which took `took_s`, and all later pages; ends early if an answer is missing."""
    yield first
    later = range(first.since + RECORD_PAGE, first.newest, RECORD_PAGE)
    for _, page in windowed(later, lambda since: read_page(link, keys, run_id, since=since), Window(took_s)):
        if page is None:
            return
        yield page


def read_run(link: Link, keys: KeyExpressions, run_id: str, *, patience_s: float) -> Iterator[LogItem]:
    """Yield the whole log of a run, also over link losses shorter than `patience_s`.

    Raises
    ------
    OutcomeUnknown
        If the robot did not answer for `patience_s`, or returns fewer entries than it announces.
    """
    history = LogHistory(link, keys)
    history.run_id, since, newest = run_id, 0, 1
    answered_at = time.monotonic()
    while since < newest:
        began = time.monotonic()
        first = read_page(link, keys, run_id, since=since)
        if first is None:
            if time.monotonic() - answered_at > patience_s:
                raise OutcomeUnknown(f"{keys.robot} stopped answering; the run was not read to its end")
            time.sleep(AGAIN_S)
            continue
        newest, missing = first.newest, first.missing
        for page in pages(link, keys, run_id, first, time.monotonic() - began):
            if not page.entries and since < newest:
                raise OutcomeUnknown(f"{keys.robot} announces {newest} entries of the run, returns {since}")
            for entry in page.entries:
                yield from history.take_entry(entry)
            since, answered_at = since + len(page.entries), time.monotonic()
    yield from missing


class LogHistory:
    """Poses of a run that were yielded so far; missed poses are read from the robot's telemetry log."""

    patience_s = GIVEN_UP_S

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self._link = link
        self._keys = keys
        self._live: deque[PoseReport] = deque(maxlen=MOST_LIVE)
        self._pages: Iterator[RecordPage] | None = None
        self._ask_at = 0.0
        self._progress_at = time.monotonic()
        self._boot_id: str | None = None
        self._seq = 0
        self._last_ns = 0
        self._health_times: deque[int] = deque(maxlen=MOST_LIVE)
        """Times of the health reports that were yielded."""
        self.run_id: str | None = None

    @property
    def behind(self) -> bool:
        """True if poses of the run are missing, and it is time to read them."""
        due = self._pages is not None or time.monotonic() >= self._ask_at
        return due and self.run_id is not None and bool(self._live)

    def take(self, pose: PoseReport) -> Iterator[PoseReport]:
        """Yield a live pose if it is the next one; else it waits for those before it."""
        if pose.run_id != self.run_id or self.run_id is None:
            return
        if not self._live:
            self._progress_at = time.monotonic()
        self._live.append(pose)
        if self._pages is None:
            yield from self._next_live()

    def health(self, report: Health) -> Iterator[LoggedReport]:
        """Yield a health report, unless it was yielded before."""
        if report.run_id == self.run_id and report.robot_ns not in self._health_times:
            self._health_times.append(report.robot_ns)
            yield LoggedReport(report)

    def catch_up(self) -> Iterator[LogItem]:
        """Yield one page of missed poses."""
        if self._pages is None:
            self._pages = self._missed_pages()
        page = next(self._pages, None)
        if page is None or page.since + len(page.entries) >= page.newest:
            self._pages, self._ask_at = None, time.monotonic() + AGAIN_S
        for entry in () if page is None else page.entries:
            yield from self.take_entry(entry)
        if page is not None and self._pages is None:
            yield from self._next_live()
            yield from self._skip_missing(page.missing)

    def take_entry(self, entry: RecordEntry) -> Iterator[LogItem]:
        """Yield the items of an entry that were not yielded before."""
        for gap in entry.missing:
            if gap.until_ns > self._last_ns:
                yield msgspec.structs.replace(gap, robot_ns=max(gap.robot_ns, self._last_ns))
        if entry.poses and entry.boot_id != self._boot_id:
            self._boot_id, self._seq = entry.boot_id, 0
        fresh = [pose for pose in entry.poses if pose.seq > self._seq]
        reports: tuple[StateReport | Health, ...] = (*entry.states, *entry.health)
        for report in reports if fresh else ():
            yield from self.health(report) if isinstance(report, Health) else (LoggedReport(report),)
        for row in fresh:
            yield self._mark_yielded(
                PoseReport(
                    robot=self._keys.robot, boot_id=entry.boot_id, seq=row.seq, robot_ns=row.robot_ns,
                    run_id=self.run_id, mission_time_s=(row.robot_ns - entry.began_ns) / 1e9,
                    pose=Pose(x=row.x, y=row.y, heading=row.heading), speed=row.speed,
                )
            )  # fmt: skip

    def _missed_pages(self) -> Iterator[RecordPage]:
        """Request the pages after the last pose that was yielded."""
        assert self.run_id is not None
        rebooted = bool(self._live) and self._live[0].boot_id != self._boot_id
        since_ns = max(0, self._last_ns - round(BOOT_S * 1e9)) if rebooted else self._last_ns
        began = time.monotonic()
        first = read_page(self._link, self._keys, self.run_id, time=since_ns)
        if first is not None:
            yield from pages(self._link, self._keys, self.run_id, first, time.monotonic() - began)

    def _next_live(self) -> Iterator[PoseReport]:
        """Yield the live poses that continue the sequence; discard those that were yielded before."""
        while self._live and self._live[0].boot_id == self._boot_id:
            if self._live[0].seq > self._seq + 1:
                return
            pose = self._live.popleft()
            if pose.seq > self._seq:
                yield self._mark_yielded(pose)

    def _skip_missing(self, missing: tuple[PosesMissing, ...]) -> Iterator[LogItem]:
        """Continue with the live poses if the robot's log does not have the poses before them."""
        reason = missing[-1].reason if missing else "the robot's telemetry log does not have them"
        if not self._live or not (missing or time.monotonic() - self._progress_at > GIVEN_UP_S):
            return
        pose = self._live[0]
        began_ns = pose.robot_ns - round((pose.mission_time_s or 0.0) * 1e9)
        since_ns = self._last_ns or began_ns
        yield PosesMissing(
            run_id=self.run_id or "", robot_ns=since_ns, until_ns=pose.robot_ns,
            mission_time_s=(since_ns - began_ns) / 1e9, reason=reason,
        )  # fmt: skip
        self._boot_id, self._seq = pose.boot_id, pose.seq - 1
        yield from self._next_live()

    def _mark_yielded(self, pose: PoseReport) -> PoseReport:
        self._seq, self._last_ns = pose.seq, pose.robot_ns
        self._progress_at = time.monotonic()
        return pose
