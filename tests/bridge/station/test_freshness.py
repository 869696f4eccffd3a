"""A router that drops, delays, repeats or reorders one topic: the gap is reported within two seconds."""

from __future__ import annotations

import queue
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import pytest

from stopgo.bridge.link.memory_link import SignedMessage
from stopgo.bridge.link.protocol import encode
from stopgo.bridge.robot.published_poses import PublishedPoses
from stopgo.bridge.station import follow
from stopgo.bridge.station.follow import Followed, Silence
from stopgo.bridge.station.freshness import LATE_S, Freshness
from stopgo.bridge.station.watch import EventLines, EventObjects, RunTable, watch_with
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.events import Aborted, Paused, ReportsMissing, Resumed, Started, StateReport
from tests.bridge.guarded import Router
from tests.bridge.world import Field, corridor

TICK_S = 0.25
Meddle = Callable[[SignedMessage], Iterable[SignedMessage]]


class Watched:
    """A robot behind a router and a station that watches it, both in simulated time.

    Whenever the station waits for a report, a quarter of a second passes: the robot publishes a pose, its
    events, and every second its state.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.field = Field()
        self.field.board = self.router = Router()
        self.station = self.field.station()
        self.station.push(corridor())
        self.field.order("start")
        self.link, self.poses = self.field.link, PublishedPoses("r1", self.field.controller.boot_id)
        self.ticks, self.published = 0, 0
        self.began_ns = self.field.clock.now_ns()
        self.acts: dict[float, Callable[[], object]] = {}
        monkeypatch.setattr(follow, "next_report", self.next)
        monkeypatch.setattr(follow, "time", self)

    def monotonic(self) -> float:
        return (self.field.clock.now_ns() - self.began_ns) / 1e9

    def at(self, seconds: float, act: Callable[[], object]) -> None:
        self.acts[seconds] = act

    def next(self, received: queue.SimpleQueue[Any], wait_s: float) -> Any:
        if received.empty() and wait_s:
            self.tick()
        return None if received.empty() else received.get()

    def tick(self) -> None:
        """Let a quarter of a second pass."""
        self.field.clock.wait(TICK_S)
        self.ticks += 1
        for due in [due for due in self.acts if due <= self.monotonic()]:
            self.acts.pop(due)()
        keys, run = self.field.keys, self.field.controller.run
        position = self.field.controller.position()
        self.link.publisher(keys.pose)(encode(self.poses.add(position, run, "b1")))
        for event in self.field.journal.events(since=self.published):
            self.published = event.number
            self.link.publisher(keys.event)(encode(event))
            self.link.publisher(keys.state)(encode(self.field.agent._state()))
        if self.ticks % 4 == 0:
            self.link.publisher(keys.state)(encode(self.field.agent._state()))

    def reports(self, seconds: float) -> list[tuple[float, Followed]]:
        """Reports to the station in that time, with times; `told` has them also if that ends by an error."""
        self.told = told = list[tuple[float, Followed]]()
        for report in self.station.reports():
            told.append((self.monotonic(), report))
            if self.monotonic() >= seconds:
                return told
        return told


def dropping(topic: str) -> Meddle:
    return lambda message: () if topic in message.key else (message,)


def repeating(topic: str) -> Meddle:
    """The first message on the topic is delivered for every later one."""
    first: dict[str, SignedMessage] = {}
    return lambda message: (first.setdefault(message.kind, message),) if topic in message.key else (message,)


def delaying(watched: Watched, topic: str, seconds: float) -> Meddle:
    late: set[int] = set()

    def meddle(message: SignedMessage) -> Iterable[SignedMessage]:
        if topic not in message.key or message.kind != "told" or id(message) in late:
            return (message,)
        late.add(id(message))
        watched.field.clock.at(seconds, lambda: watched.router.tell(message))
        return ()

    return meddle


def reordering(watched: Watched, topic: str) -> Meddle:
    """Every second message on the topic arrives after the next one."""
    held: list[SignedMessage] = []

    def meddle(message: SignedMessage) -> Iterable[SignedMessage]:
        if topic not in message.key or message.kind != "told":
            return (message,)
        if not held:
            held.append(message)
            return ()
        return (message, held.pop())

    return meddle


def gaps(told: list[tuple[float, Followed]]) -> list[tuple[float, ReportsMissing]]:
    return [(at, report) for at, report in told if isinstance(report, ReportsMissing)]


@pytest.mark.parametrize("topic", ["tel/state", "tel/pose"])
def test_a_topic_that_is_dropped_is_named_within_two_seconds(
    topic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = Watched(monkeypatch)
    watched.at(3.0, lambda: setattr(watched.router, "meddle", dropping(topic)))
    first_s, gap = gaps(watched.reports(10.0))[0]
    assert first_s <= 3.0 + LATE_S + 2 * TICK_S
    assert topic in gap.words
    assert "the link drops" in gap.words


@pytest.mark.parametrize("topic", ["tel/event", "/log"])
def test_events_that_are_dropped_are_missed_within_two_seconds(
    topic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = Watched(monkeypatch)
    watched.at(3.0, lambda: setattr(watched.router, "meddle", dropping(topic)))
    watched.at(4.0, lambda: watched.field.order("pause"))
    told = watched.reports(9.0)
    first_s, gap = gaps(told)[0]
    assert first_s <= 4.0 + LATE_S + 2 * TICK_S
    assert topic.strip("/") in gap.words
    assert gap.state is not None
    assert gap.state.state == "PAUSED"


@pytest.mark.parametrize("kind", ["repeat", "delay", "reorder"])
def test_old_states_are_not_shown_as_new_ones(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    router = {
        "repeat": repeating("tel/state"),
        "delay": delaying(watched, "tel/state", 6.0),
        "reorder": reordering(watched, "tel/state"),
    }[kind]
    watched.at(3.0, lambda: setattr(watched.router, "meddle", router))
    watched.at(5.0, lambda: watched.field.order("abort"))
    told = watched.reports(20.0)
    shown = [(at, report) for at, report in told if isinstance(report, StateReport)]
    numbers = [report.seq for _, report in shown]
    assert numbers == sorted(numbers)
    assert [at for at, report in shown if report.state == "RUNNING"][-1] <= 5.0 + LATE_S
    if kind != "reorder":
        assert any("tel/state" in gap.words for _, gap in gaps(told))


@pytest.mark.parametrize("topic", ["tel/state", "tel/pose", "tel/event", "/log"])
@pytest.mark.parametrize("kind", ["drop", "repeat", "delay", "reorder"])
def test_whatever_becomes_of_one_topic_nothing_old_is_shown_as_new(
    kind: str, topic: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Events are reported once and in order, states never go back, and none says RUNNING after the abort."""
    watched = Watched(monkeypatch)
    router = {
        "drop": dropping(topic),
        "repeat": repeating(topic),
        "delay": delaying(watched, topic, 6.0),
        "reorder": reordering(watched, topic),
    }[kind]
    watched.at(3.0, lambda: setattr(watched.router, "meddle", router))
    watched.at(5.0, lambda: watched.field.order("pause"))
    watched.at(7.0, lambda: watched.field.order("resume"))
    watched.at(9.0, lambda: watched.field.order("abort"))
    ended = True
    with suppress(OutcomeUnknown):
        watched.reports(25.0)
        ended = False
    told = watched.told
    numbers = [
        report.number for _, report in told if isinstance(report, Started | Paused | Resumed | Aborted)
    ]
    assert numbers == sorted(set(numbers))
    states = [(at, report) for at, report in told if isinstance(report, StateReport)]
    assert [report.seq for _, report in states] == sorted(report.seq for _, report in states)
    assert max(at for at, report in states if report.state == "RUNNING") <= 9.0 + LATE_S
    shown = [(at, gap.state) for at, gap in gaps(told) if gap.state is not None]
    assert all(state.state != "RUNNING" for at, state in shown if at > 9.0 + LATE_S)
    assert ended or "ABORTED" in (states[-1][1].state, shown[-1][1].state if shown else "")


def test_a_whole_link_reports_no_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.at(4.0, lambda: watched.field.order("pause"))
    watched.at(6.0, lambda: watched.field.order("resume"))
    assert gaps(watched.reports(30.0)) == []


def test_a_gap_that_ends_is_reported_and_a_silent_link_is_no_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    watched = Watched(monkeypatch)
    watched.at(3.0, lambda: setattr(watched.router, "meddle", dropping("tel/pose")))
    watched.at(8.0, lambda: setattr(watched.router, "meddle", lambda message: (message,)))
    watched.at(12.0, lambda: setattr(watched.router, "meddle", dropping("")))
    watched.at(20.0, lambda: setattr(watched.router, "meddle", lambda message: (message,)))
    told = watched.reports(24.0)
    assert [(round(at), bool(gap.topics)) for at, gap in gaps(told) if gap.changed] == [(5, True), (8, False)]
    assert any(isinstance(report, Silence) for at, report in told if 12.0 < at <= 20.0)


@pytest.mark.parametrize("display", ["lines", "table", "objects"])
def test_no_screen_says_running_after_an_abort_whose_log_is_denied(
    display: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The run is over and its events never come: the outcome is unknown, and the reason is reported."""
    watched = Watched(monkeypatch)
    watched.at(3.0, lambda: setattr(watched.router, "meddle", dropping("/log")))
    watched.at(5.0, lambda: watched.field.order("abort"))
    written: list[tuple[float, str]] = []

    def write(text: object) -> None:
        written.append((watched.monotonic(), str(text)))

    shows = {"lines": EventLines(write), "table": RunTable(write), "objects": EventObjects(write)}
    with pytest.raises(OutcomeUnknown, match=r"ABORTED, but its events .* access rules on the link deny it"):
        watch_with(watched.station, None, shows[display])
    late = "".join(text for at, text in written if at >= 5.0 + LATE_S)
    assert "RUNNING" not in late
    assert any("ABORTED" in text and at <= 5.0 + LATE_S for at, text in written)
    assert "access rules" in "".join(text for _, text in written)


def test_a_boot_that_another_has_followed_does_not_return() -> None:
    field, fresh = Field(), Freshness(0.0)
    old = field.report()
    field.boot()
    assert fresh.published(old, 0.0)
    assert fresh.published(field.report(), 1.0)
    assert not fresh.published(old, 2.0)
    assert fresh.state is not None
    assert fresh.state.boot_id == field.controller.boot_id
