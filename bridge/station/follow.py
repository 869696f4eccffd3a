"""Following of one run over the link: missed events and poses are requested, each comes exactly once.

`reports` yields everything of a run. It merges three sources: what the robot publishes, pages of its journal
(events), and pages of its telemetry log or of the poses in its memory.

Invariants:
- `RunFollower.newest` is the number of the last event yielded; events are yielded in order, without gaps.
- A state is yielded only after all events that it counts (`last_event`).
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
from stopgo.bridge.station.logged_run import AGAIN_S, LoggedReport, LogHistory
from stopgo.bridge.station.robot_replies import PastEvents, read_events, read_reply
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Finished,
    Health,
    PoseReport,
    PosesMissing,
    Report,
    StateReport,
    event_of,
)

SILENCE_S = 1.0
"""Time without data after which the robot is queried."""
KEEP_S = 5.0
"""Period of the message that somebody watches the robot."""
PAGE_S = 5.0
"""Timeout for a page of events or poses: on a slow link it takes a second."""


class Silence(msgspec.Struct, frozen=True, kw_only=True):
    """Time without data from the robot."""

    seconds: float


LiveReport = Report | Health
Followed = Report | Silence | PosesMissing | LoggedReport
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
    received = _subscribe(link, keys, keep)
    kept_at = time.monotonic()
    follower = RunFollower(link, keys, recorded)
    received_at = time.monotonic()
    while not follower.ended:
        item = _next(received, 0.0 if follower.poses.behind else SILENCE_S)
        if item is not None:
            received_at = time.monotonic()
        elif follower.poses.behind:
            yield from follower.poses.catch_up()
        if item is None and time.monotonic() - received_at >= SILENCE_S:
            yield Silence(seconds=time.monotonic() - received_at)
            item = keep()
        elif time.monotonic() - kept_at >= KEEP_S:
            kept_at = time.monotonic()
            state = keep()
            yield from () if state is None else follower.take(state)
        if item is not None:
            yield from follower.take(item)
    yield from _late_poses(received, follower)


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
            yield from self._missed(item.last_event)
            if self.newest >= item.last_event:
                self.last_state = item
                yield item
        elif isinstance(item, PoseReport):
            yield from self.poses.take(item)
        elif isinstance(item, Health):
            self._health = item
            yield from self._take_health()
        elif self.run_id is not None:
            yield from self._missed(item.number)

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
            page = log_page(self._link, self._keys, since=self.newest, run_id=self.run_id, timeout_s=PAGE_S)
            if page is None:
                return
            for event in page.events:
                self.newest = event.number
                if isinstance(event, Finished | Aborted):
                    self.end = event
                yield event
            if not page.events:
                self.newest = max(self.newest, page.newest)


def log_page(
    link: Link, keys: KeyExpressions, *, since: int, run_id: str | None, timeout_s: float
) -> PastEvents | None:
    """Request one page of the journal; `None` without an answer."""
    parameters = {"since": str(since)} | ({"run": run_id} if run_id else {})
    reply = link.ask(keys.log, timeout_s=timeout_s, parameters=parameters)
    return None if reply is None else read_events(reply, since=since, robot=keys.robot)


def _subscribe(
    link: Link, keys: KeyExpressions, keep: Callable[[], StateReport | None]
) -> queue.SimpleQueue[LiveReport]:
    """Return a queue of live reports; the subscription comes before the first query, so no gap is left."""
    received: queue.SimpleQueue[LiveReport] = queue.SimpleQueue()
    link.hear(keys.event, lambda key, payload: _put(received, payload, event_of))
    link.hear(keys.pose, lambda key, payload: _put(received, payload, _POSE))
    link.hear(keys.health, lambda key, payload: _put(received, payload, _HEALTH))
    link.hear(keys.state, lambda key, payload: _put(received, payload, _STATE))
    state = keep()
    if state is not None:
        received.put(state)
    return received


def _next(received: queue.SimpleQueue[LiveReport], wait_s: float) -> LiveReport | None:
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


def _late_poses(received: queue.SimpleQueue[LiveReport], follower: RunFollower) -> Iterator[Followed]:
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
    item = _next(received, min(wait_s, AGAIN_S))
    if isinstance(item, PoseReport | Health):
        yield from follower.take(item)
