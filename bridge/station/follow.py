"""Follows one run from afar: what was missed is asked for, so that no event is lost and none comes twice."""

from __future__ import annotations

import queue
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial

import msgspec

from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import POSE_PAGE, KeyExpressions, PosePage, decode
from stopgo.bridge.station.record import AGAIN_S, Past, RecordHistory
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
"""After this long without a word the robot is asked."""
KEEP_S = 5.0
"""How often a robot is told that it is watched."""
PAGE_S = 5.0
"""How long a page of events or poses is waited for: on a slow line it takes a second."""


class Silence(msgspec.Struct, frozen=True, kw_only=True):
    """Nothing has been heard for so long."""

    seconds: float


LiveReport = Report | Health
Followed = Report | Silence | PosesMissing | Past
"""What is told of a run that is followed."""


def reports(
    link: Link,
    keys: KeyExpressions,
    keep: Callable[[], StateReport | None],
    recorded: Callable[[], bool] = lambda: False,
) -> Iterator[Followed]:
    """Everything of the robot's run, until it is over; first what was, then what comes.

    `keep` tells the robot, every few seconds, that it is watched, and gives its state; `recorded` says
    whether it keeps a record of its runs.
    """
    link.announce(keys.watcher(uuid.uuid4().hex[:12]))
    heard = _listen(link, keys, keep)
    kept = time.monotonic()
    follower = RunFollower(link, keys, recorded)
    last = time.monotonic()
    while not follower.ended:
        item = _next(heard, 0.0 if follower.poses.behind else SILENCE_S)
        if item is not None:
            last = time.monotonic()
        elif follower.poses.behind:
            yield from follower.poses.catch_up()
        if item is None and time.monotonic() - last >= SILENCE_S:
            yield Silence(seconds=time.monotonic() - last)
            item = keep()
        elif time.monotonic() - kept >= KEEP_S:
            kept = time.monotonic()
            state = keep()
            yield from () if state is None else follower.take(state)
        if item is not None:
            yield from follower.take(item)
    yield from _late_poses(heard, follower)


class PoseHistory:
    """Which poses of a run have been told; those that were missed are asked for, page by page."""

    patience_s = 1.0
    """How long to wait, after the end of a run, for poses that are still on their way."""

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self._link = link
        self._keys = keys
        self._newest = 0
        self._ask_at = 0.0
        self.run_id: str | None = None
        self.boot_id: str | None = None
        self.told = 0

    @property
    def behind(self) -> bool:
        """Whether there are poses of the run that have not been told, and it is time to ask for them."""
        due = time.monotonic() >= self._ask_at
        return due and self.run_id is not None and self._newest > self.told

    def take(self, pose: PoseReport) -> Iterator[PoseReport]:
        """Tell a pose if it is the next one; else it will be asked for with the others."""
        if pose.run_id != self.run_id or self.run_id is None:
            return
        self._booted(pose.boot_id)
        self._newest = pose.seq
        if pose.seq == self.told + 1:
            self.told = pose.seq
            yield pose

    def catch_up(self) -> Iterator[PoseReport]:
        """A page of what was missed."""
        page = self._page()
        if page is None:  # at once, if the link is down
            self._ask_at = time.monotonic() + SILENCE_S
            return
        self._booted(page.boot_id)
        for pose in page.poses:
            self.told = pose.seq
            yield pose
        if len(page.poses) < POSE_PAGE:
            self.told = max(self.told, self._newest)

    def _booted(self, boot_id: str) -> None:
        """Each boot counts its poses anew."""
        if boot_id != self.boot_id:
            self.boot_id, self.told, self._newest = boot_id, 0, 0

    def _page(self) -> PosePage | None:
        parameters = {"since": str(self.told)} | ({"run": self.run_id} if self.run_id else {})
        reply = self._link.ask(self._keys.poses, timeout_s=PAGE_S, parameters=parameters, bulk=True)
        what = "reading past poses"
        return None if reply is None else read_reply(reply, PosePage, robot=self._keys.robot, what=what)


class RunFollower:
    """Which run is followed, and up to which event it has been told."""

    def __init__(
        self, link: Link, keys: KeyExpressions, recorded: Callable[[], bool] = lambda: False
    ) -> None:
        self._link = link
        self._keys = keys
        self._recorded = recorded
        self.poses: PoseHistory | RecordHistory = PoseHistory(link, keys)
        self.run_id: str | None = None
        self.told = -1
        self.end: Finished | Aborted | None = None
        self.last_state: StateReport | None = None
        self._health: Health | None = None
        """LiveReport, perhaps before the run it is of was."""

    @property
    def ended(self) -> bool:
        """Whether the run's last event has been told, and a state that knows of it."""
        state = self.last_state
        return self.end is not None and state is not None and state.last_event >= self.end.number

    def take(self, item: LiveReport) -> Iterator[Followed]:
        if isinstance(item, StateReport):
            self._settle_on(item)
            yield from self._tell_health()
            yield from self._missed(item.last_event)
            if self.told >= item.last_event:
                self.last_state = item
                yield item
        elif isinstance(item, PoseReport):
            yield from self.poses.take(item)
        elif isinstance(item, Health):
            self._health = item
            yield from self._tell_health()
        elif self.run_id is not None:
            yield from self._missed(item.number)

    def _tell_health(self) -> Iterator[Past]:
        if self._health is not None and isinstance(self.poses, RecordHistory):
            yield from self.poses.health(self._health)

    def _settle_on(self, state: StateReport) -> None:
        """Follow the robot's present run; without one, the next."""
        if self.told < 0 and state.run_id is None:
            self.told = state.last_event
        if self.run_id is None and state.run_id is not None:
            self.run_id, self.told = state.run_id, 0
            if self._recorded():
                self.poses = RecordHistory(self._link, self._keys)
            self.poses.run_id = state.run_id

    def _missed(self, newest: int) -> Iterator[AnyEvent]:
        """Events up to `newest` that have not been told, read from the journal."""
        while self.run_id is not None and self.told < newest and self.end is None:
            page = log_page(self._link, self._keys, since=self.told, run_id=self.run_id, timeout_s=PAGE_S)
            if page is None:
                return
            for event in page.events:
                self.told = event.number
                if isinstance(event, Finished | Aborted):
                    self.end = event
                yield event
            if not page.events:
                self.told = max(self.told, page.newest)


def log_page(
    link: Link, keys: KeyExpressions, *, since: int, run_id: str | None, timeout_s: float
) -> PastEvents | None:
    """One page of the journal, or `None` if no answer came."""
    parameters = {"since": str(since)} | ({"run": run_id} if run_id else {})
    reply = link.ask(keys.log, timeout_s=timeout_s, parameters=parameters)
    return None if reply is None else read_events(reply, since=since, robot=keys.robot)


def _listen(
    link: Link, keys: KeyExpressions, keep: Callable[[], StateReport | None]
) -> queue.SimpleQueue[LiveReport]:
    """A queue that fills with what the robot tells; listening comes before asking, so no gap is left."""
    heard: queue.SimpleQueue[LiveReport] = queue.SimpleQueue()
    link.hear(keys.event, lambda key, payload: _put(heard, payload, event_of))
    link.hear(keys.pose, lambda key, payload: _put(heard, payload, _POSE))
    link.hear(keys.health, lambda key, payload: _put(heard, payload, _HEALTH))
    link.hear(keys.state, lambda key, payload: _put(heard, payload, _STATE))
    state = keep()
    if state is not None:
        heard.put(state)
    return heard


def _next(heard: queue.SimpleQueue[LiveReport], wait_s: float) -> LiveReport | None:
    try:
        return heard.get(timeout=wait_s) if wait_s else heard.get_nowait()
    except queue.Empty:
        return None


def _put(heard: queue.SimpleQueue[LiveReport], payload: bytes, read: Callable[[bytes], LiveReport]) -> None:
    """Take what can be read; anything else on these keys is not the robot's."""
    with suppress(msgspec.DecodeError):
        heard.put(read(payload))


_HEALTH = partial(decode, kind=Health)
_POSE = partial(decode, kind=PoseReport)
_STATE = partial(decode, kind=StateReport)


def _late_poses(heard: queue.SimpleQueue[LiveReport], follower: RunFollower) -> Iterator[Followed]:
    """Poses of the run that have not come yet, up to the first after its end."""
    end_ns = follower.end.robot_ns if follower.end else 0
    patience_s = follower.poses.patience_s
    deadline = time.monotonic() + patience_s
    while (left := deadline - time.monotonic()) > 0:
        for told in _late(heard, follower, left):
            yield told
            if isinstance(told, PoseReport) and told.robot_ns > end_ns:
                return
            deadline = time.monotonic() + patience_s


def _late(heard: queue.SimpleQueue[LiveReport], follower: RunFollower, wait_s: float) -> Iterator[Followed]:
    """What has come, or what was missed."""
    if follower.poses.behind:
        yield from follower.poses.catch_up()
    item = _next(heard, min(wait_s, AGAIN_S))
    if isinstance(item, PoseReport | Health):
        yield from follower.take(item)
