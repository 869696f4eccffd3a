"""A robot that answers nonsense, or reports more than it gives, ends a command with one line and in time."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import pytest

from stopgo.bridge.link.protocol import LogPage, Malformed, RecordPage, encode
from stopgo.bridge.station.logged_run import read_index, read_run
from stopgo.bridge.station.station import Station
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import Started
from tests.bridge.world import Field, corridor

pytestmark = pytest.mark.usefixtures("own_time")

READS: dict[str, Callable[[Station], object]] = {
    "log": lambda station: station.log(),
    "record": lambda station: list(read_run(station.link, station.keys, "run", patience_s=0.0)),
    "index": lambda station: read_index(station.link, station.keys, timeout_s=0.0),
}


def lying(answer: bytes) -> Station:
    """A station of a robot that answers so whatever it is asked."""
    field = Field()
    station = field.station()
    liar = field.board.link()
    for key in (field.keys.log, field.keys.record):
        liar.serve(key, lambda request: answer)
    return station


@pytest.mark.parametrize("read", READS)
@pytest.mark.parametrize("answer", [b"", b"\xff", b'{"is": "Later"}', b'{"is": "Info", "a":' + b"[" * 20_000])
def test_an_answer_that_cannot_be_read_is_unknown(read: str, answer: bytes) -> None:
    with pytest.raises(OutcomeUnknown, match="unknown answer"):
        READS[read](lying(answer))


@pytest.mark.parametrize("read", READS)
def test_a_robot_that_makes_no_sense_of_a_question_is_quoted(read: str) -> None:
    with pytest.raises(
        NegativeResult, match=r"r1: request not understood \(reading its .*\): since is a word"
    ):
        READS[read](lying(encode(Malformed(message="since is a word"))))


def started(number: int) -> msgspec.Raw:
    event = Started(
        robot="r1", boot_id="b", number=number, run_id="run", mission_id="m", revision=1, robot_ns=1,
        mission_time_s=0.0, commander="me",
    )  # fmt: skip
    return msgspec.Raw(encode(event))


@pytest.mark.parametrize("numbers", [(0,), (1, 1), (2, 1)])
def test_a_log_that_does_not_go_on_is_not_read_for_ever(numbers: tuple[int, ...]) -> None:
    page = LogPage(bodies=tuple(map(started, numbers)), newest=9)
    with pytest.raises(OutcomeUnknown, match=f"event {numbers[-1]} after"):
        lying(encode(page)).log()


def test_an_event_that_is_none_is_unknown() -> None:
    with pytest.raises(OutcomeUnknown, match="unknown answer"):
        lying(encode(LogPage(bodies=(msgspec.Raw(b'{"event": "Started"}'),), newest=1))).log()


@pytest.mark.parametrize("wrong", [{"robot_ns": 2**63}, {"robot_ns": -1}, {"mission_time_s": 1e300}])
def test_a_time_that_no_recording_holds_is_unknown(wrong: dict[str, object]) -> None:
    event = {**msgspec.json.decode(bytes(started(1))), **wrong}
    page = LogPage(bodies=(msgspec.Raw(encode(event)),), newest=1)
    with pytest.raises(OutcomeUnknown, match=rf"unknown answer .*{next(iter(wrong))}"):
        lying(encode(page)).log()


@pytest.mark.parametrize("kind", ["pose", "state", "health"])
def test_a_report_is_not_accepted_with_a_time_that_no_recording_holds(kind: str) -> None:
    field = Field()
    station = field.station()
    station.push(corridor())
    field.order("start")
    field.work()
    reports = station.reports()
    first = next(reports)
    late = {**msgspec.to_builtins(field.report()), "robot_ns": 2**63}
    told = {
        "state": late,
        "pose": {**late, "mission_time_s": 0.0, "pose": {"x": 0.0, "y": 0.0, "heading": 0.0}, "speed": 0.0},
        "health": late,
    }
    field.board.link().publisher(getattr(field.keys, kind))(encode(told[kind]))
    assert all(getattr(report, "robot_ns", 0) < 2**63 for report in [first, *reports])


def test_a_record_that_reports_more_than_it_gives_is_not_read_for_ever() -> None:
    page = RecordPage(run_id="run", since=0, entries=(), newest=10**12)
    with pytest.raises(OutcomeUnknown, match="announces 1000000000000 entries of the run, returns 0"):
        list(read_run((liar := lying(encode(page))).link, liar.keys, "run", patience_s=0.0))
