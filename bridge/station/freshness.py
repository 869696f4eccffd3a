"""Freshness of reports at a station: the age of the newest state, and topics that do not arrive.

The robot numbers its states (`seq`) within a boot, whether it publishes them or answers with them. A link may
delay a state, repeat it or change its order. So only a state with a higher number than all others is current.

Invariants of `Freshness`:
- `state` is the newest by boot and number; a boot that another one has followed does not return.
- `_came` has, for each topic, the time when it last brought news. A published state is none if an answer, at
  least `RACE_S` ago, had a newer one.
- A topic is reported after `LATE_S` without that, and only while other messages of the robot arrive.
"""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Callable
from typing import Final, NamedTuple

from stopgo.mission.run.events import AnyEvent, PoseReport, ReportsMissing, StateReport

LATE_S: Final = 2.0
"""Age above which a state is reported as old; the robot publishes its state every second."""
RACE_S: Final = 1.0
"""Time by which an answer may overtake a state that was published before it."""
MOST_BOOTS: Final = 16
"""Former boots that are remembered."""
DRIVING: Final = ("RUNNING", "HOMING")
STATE, EVENT, POSE = "tel/state", "tel/event", "tel/pose"


class Freshness:
    """The newest state of one robot, and the times when its topics last brought news."""

    def __init__(self, now_s: float) -> None:
        self.state: StateReport | None = None
        self.state_at = now_s
        """Time at which the newest state was true, at the latest known."""
        self._former: deque[str] = deque(maxlen=MOST_BOOTS)
        self._came = {STATE: now_s, EVENT: now_s, POSE: now_s}
        self._arrived_at = now_s
        self._pose_seq = self._published_seq = 0
        self._answers: deque[tuple[float, int]] = deque(maxlen=4)
        """Times and numbers of the newest states in answers."""
        self._event: int | None = None
        """Number of the newest published event; `None` until a state sets where to begin."""
        self._told: tuple[str, ...] = ()
        self._told_at = now_s

    def published(self, state: StateReport, now_s: float) -> bool:
        """Take a published state; false if it is older than a known one."""
        self._take_arrival(now_s)
        fresh = self._take_state(state, now_s)
        if self.state is not None and state.boot_id == self.state.boot_id:
            known = [seq for at_s, seq in self._answers if now_s - at_s >= RACE_S]
            if state.seq > max((self._published_seq, *known)):
                self._published_seq, self._came[STATE] = state.seq, now_s
        return fresh

    def answered(self, state: StateReport, asked_s: float, now_s: float) -> bool:
        """Take the state of an answer to a query that was sent at `asked_s`; false if it is older."""
        self._take_arrival(now_s)
        fresh = self._take_state(state, asked_s)
        if fresh:
            self._answers.append((now_s, state.seq))
        return fresh

    def pose(self, report: PoseReport, now_s: float) -> None:
        """Take a published pose."""
        self._take_arrival(now_s)
        if self.state is None or report.boot_id != self.state.boot_id or report.seq > self._pose_seq:
            self._came[POSE] = now_s
            self._pose_seq = report.seq

    def event(self, event: AnyEvent, now_s: float) -> None:
        """Take a published event."""
        self._take_arrival(now_s)
        self._event = max(event.number, self._event or 0)

    def missing(self, log: str, now_s: float) -> ReportsMissing | None:
        """Return what is missing, at changes and once a second; `log` is the reason of missing events."""
        topics = self._topics(log, now_s)
        again = bool(topics) and now_s - self._told_at >= 1.0
        if topics == self._told and not again:
            return None
        changed = [topic.partition(":")[0] for topic in topics] != [t.partition(":")[0] for t in self._told]
        self._told, self._told_at = topics, now_s
        state = self.state
        return ReportsMissing(
            run_id=None if state is None else state.run_id, robot_ns=0 if state is None else state.robot_ns,
            state=state, age_s=max(0.0, now_s - self.state_at), topics=topics, changed=changed,
        )  # fmt: skip

    def _take_arrival(self, now_s: float) -> None:
        """Begin again after a silence of the whole link: it is reported as such, and by no topic."""
        if now_s - self._arrived_at >= LATE_S:
            self._came = dict.fromkeys(self._came, now_s)
            self._event = None
        self._arrived_at = now_s

    def _take_state(self, state: StateReport, at_s: float) -> bool:
        known = self.state
        if known is not None and state.boot_id != known.boot_id:
            if state.boot_id in self._former:
                return False
            self._former.append(known.boot_id)
            self._pose_seq = self._published_seq = 0
            self._answers.clear()
        elif known is not None and state.seq <= known.seq:
            return state.seq == known.seq
        self.state, self.state_at = state, at_s
        self._event = state.last_event if self._event is None else self._event
        if self._event >= state.last_event:
            self._came[EVENT] = at_s
        if known is None or state.state not in DRIVING or known.state not in DRIVING:
            self._came[POSE] = at_s
        return True

    def _topics(self, log: str, now_s: float) -> tuple[str, ...]:
        if now_s - self._arrived_at >= RACE_S:  # nothing arrives: that may be a silence of the link
            return self._told if now_s - self._arrived_at < LATE_S else ()
        late = {topic: now_s - came_s for topic, came_s in self._came.items()}
        state = self.state
        told = {
            STATE: late[STATE] >= LATE_S,
            EVENT: state is not None and (self._event or 0) < state.last_event and late[EVENT] >= LATE_S,
            POSE: state is not None and state.state in DRIVING and late[POSE] >= LATE_S,
        }
        lines = [f"the link drops or delays {topic}: nothing new for {late[topic]:.0f} s"
                 for topic, missing in told.items() if missing]  # fmt: skip
        return (*lines, log) if log else tuple(lines)


class Answered(NamedTuple):
    """Answer of a query in the background, or the error instead."""

    reply: bytes | None
    error: BaseException | None
    took_s: float


class BackgroundQuery:
    """One query at a time on a thread of its own, so that nothing else waits for its answer."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._answers: queue.SimpleQueue[Answered] = queue.SimpleQueue()
        self._begun_s: float | None = None

    def answer(self, ask: Callable[[], bytes | None], wait_s: float) -> Answered | None:
        """Return the answer of the query in flight, else of `ask`; `None` if there is none yet.

        Only a new query is waited for.
        """
        if self._begun_s is not None:
            wait_s = 0.0
        else:
            self._begun_s = self._clock()
            threading.Thread(target=self._run, args=(ask, self._begun_s), daemon=True).start()
        try:
            answered = self._answers.get(block=wait_s > 0, timeout=wait_s or None)
        except queue.Empty:
            return None
        self._begun_s = None
        if answered.error is not None:
            raise answered.error
        return answered

    def _run(self, ask: Callable[[], bytes | None], begun_s: float) -> None:
        reply, error = None, None
        try:
            reply = ask()
        except BaseException as raised:  # noqa: BLE001 (the end of a thread; raised again where it is waited for)
            error = raised
        self._answers.put(Answered(reply, error, self._clock() - begun_s))
