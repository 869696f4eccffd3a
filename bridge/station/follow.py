"""Following of one run over the link: missed events and poses are requested, each comes exactly once.

`reports` yields everything of a run. It merges three sources: what the robot publishes, pages of its journal
(events), and pages of its telemetry log or of the poses in its memory.

Invariants:
- `RunFollower.newest` is the number of the last event yielded; events are yielded in order, without gaps.
- A state is yielded only after all events that it counts (`last_event`), and never after a newer one. While
  events are missing, `ReportsMissing` has the newest state.
- The subscription starts before the first query, so nothing falls between the two.
- The run is over when its last event and a state that counts it were yielded.
"""

from __future__ import annotations

import queue
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import msgspec

from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import POSE_PAGE, KeyExpressions, PosePage, decode
from stopgo.bridge.station.freshness import BackgroundQuery, Freshness
from stopgo.bridge.station.logged_run import AGAIN_S, LoggedReport, LogHistory
from stopgo.bridge.station.robot_replies import PastEvents, read_events, read_reply
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Event,
    Finished,
    Health,
    PoseReport,
    PosesMissing,
    Report,
    ReportsMissing,
    StateReport,
    event_of,
)

SILENCE_S = 1.0
"""Time without data after which the robot is queried."""
OLD_S = 1.5
"""Age of the newest state at which the robot is queried; it publishes one every second."""
KEEP_S = 5.0
"""Period of the message that somebody watches the robot."""
UNREAD_S = 1.0
"""Time for missing events before the gap is reported; other reports do not wait for longer."""
GIVEN_UP_S = 10.0
"""Time for the last events of a run that is over, while the robot's states arrive."""
DENIED = "log has an empty answer at once: access rules on the link deny it, or the robot does not serve it"
PAGE_S = 5.0
"""Timeout for a page of events or poses: on a slow link it takes a second."""


class Silence(msgspec.Struct, frozen=True, kw_only=True):
    """Time without data from the robot."""

    seconds: float


LiveReport = Report | Health
Followed = Report | Silence | PosesMissing | ReportsMissing | LoggedReport
"""Item that `reports` yields."""


def reports(
    link: Link,
    keys: KeyExpressions,
    keep: Callable[[], StateReport | None],
    recorded: Callable[[], bool] = lambda: False,
) -> Iterator[Followed]:
    """Yield everything of the robot's run until it is over: first the past, then live data.

    `keep` reports to the robot that somebody watches it, and returns its state. `recorded` returns true if
    the robot has a telemetry log of its runs.
    """
    watched = WatchedLink(keep)
    received = subscribe(link, keys)
    follower = RunFollower(link, keys, recorded)
    yield from _taken(follower, watched.ask())
    while not follower.ended:
        item = next_report(received, 0.0 if follower.poses.behind else AGAIN_S)
        if item is None and follower.poses.behind:
            yield from follower.poses.catch_up()
        silent_s = watched.take(item)
        if item is None and silent_s >= SILENCE_S:
            yield Silence(seconds=silent_s)
        if watched.to_ask:
            yield from _taken(follower, watched.ask())
        yield from _taken(follower, item if watched.is_news else None)
        yield from follower.catch_up()
        yield from watched.missing(follower)
    yield from late_poses(received, follower)


def _taken(follower: RunFollower, item: LiveReport | None) -> Iterator[Followed]:
    return iter(()) if item is None else follower.take(item)


class WatchedLink:
    """Link while a run is followed: when something last came on it, and when the robot is asked."""

    def __init__(self, keep: Callable[[], StateReport | None]) -> None:
        self._keep = keep
        self._asked_at = self._received_at = time.monotonic()
        self._fresh = Freshness(self._asked_at)
        self.is_news = True
        """True if the last item is no state, or the newest."""

    @property
    def to_ask(self) -> bool:
        """True if it is time for a sign of watching, or the newest state is old."""
        now = time.monotonic()
        old = now - self._fresh.state_at >= OLD_S and now - self._asked_at >= SILENCE_S
        return old or now - self._asked_at >= KEEP_S

    def ask(self) -> StateReport | None:
        """Report that somebody watches; return the robot's state if it is the newest."""
        self._asked_at = time.monotonic()
        state = self._keep()
        if state is None or not self._fresh.answered(state, self._asked_at, time.monotonic()):
            return None
        self._received_at = time.monotonic()
        return state

    def take(self, item: LiveReport | None) -> float:
        """Note an item, and return the seconds without any."""
        now = time.monotonic()
        self.is_news = True
        if item is not None:
            self._received_at = now
        if isinstance(item, StateReport):
            self.is_news = self._fresh.published(item, now)
        elif isinstance(item, PoseReport):
            self._fresh.pose(item, now)
        elif isinstance(item, Event):
            self._fresh.event(item, now)
        return now - self._received_at

    def missing(self, follower: RunFollower) -> Iterator[ReportsMissing]:
        """Yield the topics that do not arrive, when there is something to report."""
        now = time.monotonic()
        report = self._fresh.missing(follower.log_fault(now), now)
        if report is not None:
            yield report
        follower.check_end(report)


class PoseHistory:
    """Poses of a run that were yielded so far; missed poses are requested page by page."""

    patience_s = 1.0
    """Longest wait, after the end of a run, for poses in flight."""

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self._link = link
        self._keys = keys
        self._newest = 0
        self._ask_at = 0.0
        self.run_id: str | None = None
        self.boot_id: str | None = None
        self.seq = 0
        """Number of the last pose that was yielded."""

    @property
    def behind(self) -> bool:
        """True if poses of the run are missing, and it is time to request them."""
        due = time.monotonic() >= self._ask_at
        return due and self.run_id is not None and self._newest > self.seq

    def take(self, pose: PoseReport) -> Iterator[PoseReport]:
        """Yield a pose if it is the next one; else it will be requested with those before it."""
        if pose.run_id != self.run_id or self.run_id is None:
            return
        self._check_boot(pose.boot_id)
        self._newest = pose.seq
        if pose.seq == self.seq + 1:
            self.seq = pose.seq
            yield pose

    def catch_up(self) -> Iterator[PoseReport]:
        """Yield one page of missed poses."""
        page = self._page()
        if page is None:  # at once, if the link is down
            self._ask_at = time.monotonic() + SILENCE_S
            return
        self._check_boot(page.boot_id)
        for pose in page.poses:
            self.seq = pose.seq
            yield pose
        if len(page.poses) < POSE_PAGE:
            self.seq = max(self.seq, self._newest)

    def _check_boot(self, boot_id: str) -> None:
        """Start at pose 1 again if the robot has rebooted: each boot numbers its poses from 1."""
        if boot_id != self.boot_id:
            self.boot_id, self.seq, self._newest = boot_id, 0, 0

    def _page(self) -> PosePage | None:
        parameters = {"since": str(self.seq)} | ({"run": self.run_id} if self.run_id else {})
        reply = self._link.ask(self._keys.poses, timeout_s=PAGE_S, parameters=parameters, bulk=True)
        what = "reading past poses"
        return None if reply is None else read_reply(reply, PosePage, robot=self._keys.robot, what=what)


class RunFollower:
    """Run that is followed, and the last event of it that was yielded."""

    def __init__(
        self, link: Link, keys: KeyExpressions, recorded: Callable[[], bool] = lambda: False
    ) -> None:
        self._link = link
        self._keys = keys
        self._recorded = recorded
        self.poses: PoseHistory | LogHistory = PoseHistory(link, keys)
        self.run_id: str | None = None
        self.newest = -1
        """Number of the last event that was yielded; -1 before the first state."""
        self.end: Finished | Aborted | None = None
        self.last_state: StateReport | None = None
        self._ahead: StateReport | None = None
        """Newest state, of which events are missing."""
        self._behind_since: float | None = None
        self._log = BackgroundQuery(time.monotonic)
        self._log_reason, self._ask_at = "", 0.0
        self._health: Health | None = None
        """Newest health report; it may come before the first state of its run."""

    @property
    def ended(self) -> bool:
        """True if the run's last event was yielded, and a state that counts it."""
        state = self.last_state
        return self.end is not None and state is not None and state.last_event >= self.end.number

    def take(self, item: LiveReport) -> Iterator[Followed]:
        """Yield a live item, after all events before it."""
        if isinstance(item, StateReport):
            self._choose_run(item)
            yield from self._take_health()
            self._ahead = item
            yield from self.catch_up()
        elif isinstance(item, PoseReport):
            yield from self.poses.take(item)
        elif isinstance(item, Health):
            self._health = item
            yield from self._take_health()
        elif self.run_id is not None:
            yield from self._missed(item.number)

    def catch_up(self) -> Iterator[Followed]:
        """Yield the events that the newest state counts, then that state; nothing if they do not come."""
        state = self._ahead
        if state is None:
            return
        yield from self._missed(state.last_event)
        if self.newest >= state.last_event:
            self._ahead, self._behind_since = None, None
            self.last_state = state
            yield state
        elif self._behind_since is None:
            self._behind_since = time.monotonic()

    def log_fault(self, now_s: float) -> str:
        """Return why events are missing; empty if none is, or not for long."""
        if self._behind_since is None or now_s - self._behind_since < UNREAD_S:
            return ""
        return self._log_reason or f"the link drops log: no answer for {now_s - self._behind_since:.0f} s"

    def check_end(self, report: ReportsMissing | None) -> None:
        """End the following of a run that is over, but whose events do not come.

        Raises
        ------
        OutcomeUnknown
            After `GIVEN_UP_S`.
        """
        state, since = self._ahead, self._behind_since
        if report is None or state is None or since is None or state.state not in ("FINISHED", "ABORTED"):
            return
        if time.monotonic() - since >= GIVEN_UP_S and report.topics:
            raise OutcomeUnknown(
                f"{state.robot}: the run is {state.state}, but its events from number {self.newest + 1} on"
                f" were not received ({report.topics[-1]}); see stopgo watch --run {state.run_id}"
            )

    def _take_health(self) -> Iterator[LoggedReport]:
        if self._health is not None and isinstance(self.poses, LogHistory):
            yield from self.poses.health(self._health)

    def _choose_run(self, state: StateReport) -> None:
        """Follow the robot's present run; without one, the next."""
        if self.newest < 0 and state.run_id is None:
            self.newest = state.last_event
        if self.run_id is None and state.run_id is not None:
            self.run_id, self.newest = state.run_id, 0
            if self._recorded():
                self.poses = LogHistory(self._link, self._keys)
            self.poses.run_id = state.run_id

    def _missed(self, newest: int) -> Iterator[AnyEvent]:
        """Yield the missing events up to `newest`, read from the robot's journal."""
        while self.run_id is not None and self.newest < newest and self.end is None:
            page = self._next_page()
            if page is None:
                return
            self._behind_since = None
            for event in page.events:
                self.newest = event.number
                if isinstance(event, Finished | Aborted):
                    self.end = event
                yield event
            if not page.events:
                self.newest = max(self.newest, page.newest)

    def _next_page(self) -> PastEvents | None:
        """Return the next page of the journal; `None` if it has not come yet."""
        if time.monotonic() < self._ask_at:
            return None
        since, run_id = self.newest, self.run_id
        ask = partial(ask_log, self._link, self._keys, since=since, run_id=run_id, timeout_s=PAGE_S)
        answered = self._log.answer(ask, UNREAD_S)
        if answered is None:
            return None
        if answered.reply is None:
            self._ask_at = time.monotonic() + AGAIN_S
            at_once = answered.took_s < PAGE_S / 2
            self._log_reason = DENIED if at_once else f"the link drops log: no answer in {PAGE_S:g} s"
            return None
        self._log_reason = ""
        return read_events(answered.reply, since=since, robot=self._keys.robot)


def ask_log(
    link: Link, keys: KeyExpressions, *, since: int, run_id: str | None, timeout_s: float
) -> bytes | None:
    """Request one page of the journal."""
    parameters = {"since": str(since)} | ({"run": run_id} if run_id else {})
    return link.ask(keys.log, timeout_s=timeout_s, parameters=parameters)


def log_page(
    link: Link, keys: KeyExpressions, *, since: int, run_id: str | None, timeout_s: float
) -> PastEvents | None:
    """Request one page of the journal; `None` without an answer."""
    reply = ask_log(link, keys, since=since, run_id=run_id, timeout_s=timeout_s)
    return None if reply is None else read_events(reply, since=since, robot=keys.robot)


def subscribe(link: Link, keys: KeyExpressions) -> queue.SimpleQueue[LiveReport]:
    """Return a queue of live reports; the subscription comes before the first query, so no gap is left."""
    received: queue.SimpleQueue[LiveReport] = queue.SimpleQueue()
    link.hear(keys.event, lambda key, payload: _put(received, payload, event_of))
    link.hear(keys.pose, lambda key, payload: _put(received, payload, _POSE))
    link.hear(keys.health, lambda key, payload: _put(received, payload, _HEALTH))
    link.hear(keys.state, lambda key, payload: _put(received, payload, _STATE))
    return received


def next_report(received: queue.SimpleQueue[LiveReport], wait_s: float) -> LiveReport | None:
    """Return the next report of a queue; `None` if none comes in time."""
    try:
        return received.get(timeout=wait_s) if wait_s else received.get_nowait()
    except queue.Empty:
        return None


def _put(
    received: queue.SimpleQueue[LiveReport], payload: bytes, read: Callable[[bytes], LiveReport]
) -> None:
    """Queue a report that can be decoded; other data on these key expressions is not the robot's."""
    with suppress(msgspec.DecodeError):
        received.put(read(payload))


_HEALTH = partial(decode, kind=Health)
_POSE = partial(decode, kind=PoseReport)
_STATE = partial(decode, kind=StateReport)


def late_poses(received: queue.SimpleQueue[LiveReport], follower: RunFollower) -> Iterator[Followed]:
    """Yield the poses of the run that are still in flight, up to the first after its end."""
    end_ns = follower.end.robot_ns if follower.end else 0
    patience_s = follower.poses.patience_s
    deadline = time.monotonic() + patience_s
    while (left := deadline - time.monotonic()) > 0:
        for item in _late(received, follower, left):
            yield item
            if isinstance(item, PoseReport) and item.robot_ns > end_ns:
                return
            deadline = time.monotonic() + patience_s


def _late(
    received: queue.SimpleQueue[LiveReport], follower: RunFollower, wait_s: float
) -> Iterator[Followed]:
    """Yield the next pose, live or missed."""
    if follower.poses.behind:
        yield from follower.poses.catch_up()
    item = next_report(received, min(wait_s, AGAIN_S))
    if isinstance(item, PoseReport | Health):
        yield from follower.take(item)
