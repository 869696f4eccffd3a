"""Follows one run from afar: what was missed is asked for, so that no event is lost and none comes twice."""

from __future__ import annotations

import queue
import time
import uuid
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import msgspec

from bridge.link import Link
from bridge.protocol import Info, Keys, LogPage, decode
from mission.events import Aborted, AnyEvent, Finished, PoseReport, StateReport

SILENCE_S = 1.0
"""After this long without a word the robot is asked."""
ASK_S = 1.0
POSES_LATE = 3000
LAST_POSES_S = 1.0
"""How long to wait, after the end, for poses that are still on their way."""


class Silence(msgspec.Struct, frozen=True, kw_only=True):
    """Nothing has been heard for so long."""

    seconds: float


Report = StateReport | PoseReport | AnyEvent | Silence
Heard = StateReport | PoseReport | AnyEvent


def reports(link: Link, keys: Keys) -> Iterator[Report]:
    """Everything of the robot's run, until it is over; first what was, then what comes."""
    link.announce(keys.watcher(uuid.uuid4().hex[:12]))
    heard = _listen(link, keys)
    follower = Follower(link, keys)
    last = time.monotonic()
    while not follower.ended:
        try:
            item: Heard | None = heard.get(timeout=SILENCE_S)
            last = time.monotonic()
        except queue.Empty:
            item = None
        if item is None:
            yield Silence(seconds=time.monotonic() - last)
            item = _asked_state(link, keys)
        if item is not None:
            yield from follower.take(item)
    yield from _late_poses(heard, follower)


class Follower:
    """Which run is followed, and up to which event it has been told."""

    def __init__(self, link: Link, keys: Keys) -> None:
        self._link = link
        self._keys = keys
        self._waiting: list[PoseReport] = []
        self.run_id: str | None = None
        self.told = -1
        self.end: Finished | Aborted | None = None
        self.last_state: StateReport | None = None

    @property
    def ended(self) -> bool:
        """Whether the run's last event has been told, and a state that knows of it."""
        state = self.last_state
        return self.end is not None and state is not None and state.last_event >= self.end.number

    def take(self, item: Heard) -> Iterator[Heard]:
        if isinstance(item, StateReport):
            self._settle_on(item)
            yield from self._missed(item.last_event)
            if self.told >= item.last_event:
                self.last_state = item
                yield item
        elif isinstance(item, PoseReport):
            if self.run_id is not None and item.run_id == self.run_id:
                yield item
        elif self.run_id is not None:
            yield from self._missed(item.number)

    def _settle_on(self, state: StateReport) -> None:
        """Follow the robot's present run; without one, the next."""
        if self.told < 0 and state.run_id is None:
            self.told = state.last_event
        if self.run_id is None and state.run_id is not None:
            self.run_id, self.told = state.run_id, 0

    def _missed(self, newest: int) -> Iterator[AnyEvent]:
        """Events up to `newest` that have not been told, read from the journal."""
        while self.run_id is not None and self.told < newest and self.end is None:
            page = log_page(self._link, self._keys, since=self.told, run_id=self.run_id, timeout_s=ASK_S)
            if page is None:
                return
            for event in page.events:
                self.told = event.number
                if isinstance(event, Finished | Aborted):
                    self.end = event
                yield event
            if not page.events:
                self.told = max(self.told, page.newest)


def log_page(link: Link, keys: Keys, *, since: int, run_id: str | None, timeout_s: float) -> LogPage | None:
    """One page of the journal, or `None` if no answer came."""
    parameters = {"since": str(since)} | ({"run": run_id} if run_id else {})
    reply = link.ask(keys.log, timeout_s=timeout_s, parameters=parameters)
    return None if reply is None else decode(reply, LogPage)


def _listen(link: Link, keys: Keys) -> queue.SimpleQueue[Heard]:
    """A queue that fills with what the robot tells; listening comes before asking, so no gap is left."""
    heard: queue.SimpleQueue[Heard] = queue.SimpleQueue()
    link.hear(keys.event, lambda key, payload: _put(heard, payload, AnyEvent))
    link.hear(keys.pose, lambda key, payload: _put(heard, payload, PoseReport), late=POSES_LATE)
    link.hear(keys.state, lambda key, payload: _put(heard, payload, StateReport))
    state = _asked_state(link, keys)
    if state is not None:
        heard.put(state)
    return heard


def _put(heard: queue.SimpleQueue[Heard], payload: bytes, kind: Any) -> None:
    """Take what can be read; anything else on these keys is not the robot's."""
    with suppress(msgspec.DecodeError):
        heard.put(msgspec.json.decode(payload, type=kind))


def _asked_state(link: Link, keys: Keys) -> StateReport | None:
    reply = link.ask(keys.info, timeout_s=ASK_S)
    return None if reply is None else decode(reply, Info).state


def _late_poses(heard: queue.SimpleQueue[Heard], follower: Follower) -> Iterator[Heard]:
    """Poses of the run that are still on their way; poses come in order, so a later one ends them."""
    deadline = time.monotonic() + LAST_POSES_S
    end_ns = follower.end.robot_ns if follower.end else 0
    while (left := deadline - time.monotonic()) > 0:
        try:
            item = heard.get(timeout=left)
        except queue.Empty:
            return
        if isinstance(item, PoseReport) and item.run_id == follower.run_id:
            yield item
            if item.robot_ns > end_ns:
                return
