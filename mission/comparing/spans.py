"""States that a run went through, from its events."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from stopgo.mission.comparing.comparison import Span
from stopgo.mission.run.events import (
    Aborted,
    AnyEvent,
    Finished,
    Held,
    Homing,
    Paused,
    Resumed,
    Skipped,
    Started,
    State,
)
from stopgo.mission.run.run_log import RunLog

STANDING: tuple[State, ...] = ("PAUSED", "HELD")
OVER: tuple[State, ...] = ("FINISHED", "ABORTED")


def spans_of(log: RunLog) -> tuple[Span, ...]:
    """Return them without a gap, from the run's start to its end; none if there are no events."""
    changes = list(_changes(log))
    if not changes:
        return ()
    ends = [begin for begin, _, _ in changes[1:]]
    last = float(log.seconds([log.ended_ns or 0])[0])
    return tuple(
        Span(state, begin, end, why)
        for (begin, state, why), end in zip(changes, [*ends, max(last, changes[-1][0])], strict=True)
        if state not in OVER and end > begin
    )


def paused_s(events: Iterable[AnyEvent], *, since_s: float, until_s: float) -> float:
    """Return the seconds of mission time between two times in which the run was paused or held."""
    state: State | None = None
    homing, stood, begun = False, 0.0, since_s
    for event in events:
        homing = homing or isinstance(event, Homing)
        at = min(max(event.mission_time_s, since_s), until_s)
        stood += at - begun if state in STANDING else 0.0
        state, begun = _after(event, state, homing) or state, at
    return stood + (max(0.0, until_s - begun) if state in STANDING else 0.0)


def _changes(log: RunLog) -> Iterator[tuple[float, State, str]]:
    """Yield each change of state: its time, the new state, and the reason."""
    state, homing = None, False
    for event in log.events:
        homing = homing or isinstance(event, Homing)
        new = _after(event, state, homing)
        if new is not None and new != state:
            state = new
            yield float(log.seconds([event.robot_ns])[0]), new, getattr(event, "reason", "")


def _after(event: AnyEvent, state: State | None, homing: bool) -> State | None:
    """Return the state that an event leads to; None if it changes none."""
    goes_on = isinstance(event, Resumed) or (isinstance(event, Skipped) and state == "HELD")
    if goes_on:
        return "HOMING" if homing else "RUNNING"
    if isinstance(event, Homing) and state == "PAUSED":
        return None
    return STATES.get(type(event))


STATES: dict[type, State] = {
    Started: "RUNNING",
    Paused: "PAUSED",
    Held: "HELD",
    Homing: "HOMING",
    Finished: "FINISHED",
    Aborted: "ABORTED",
}
"""State of the run after an event that determines it alone."""
