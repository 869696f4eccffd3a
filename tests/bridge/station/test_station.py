"""A command keeps to its time, and says whether anything was sent."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
import pytest

from stopgo.bridge.link.memory_link import MemoryLink, Switchboard
from stopgo.bridge.link.protocol import VERSION, KeyExpressions, Manifest, encode
from stopgo.bridge.station import station as stations
from stopgo.bridge.station.follow import PoseHistory
from stopgo.bridge.station.station import BEGINNINGS, LEAST_S, PATIENCE_S, Station
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from tests.bridge.world import Field, corridor


class StoppedTime:
    """A clock that passes only while somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


class DeafLink(MemoryLink):
    """Answers nothing on keys with a certain word, and takes all the time it is given for that."""

    def __init__(self, board: Switchboard, time: StoppedTime, deaf: str) -> None:
        super().__init__(board)
        self.time = time
        self.deaf = deaf
        self.asked: list[str] = []

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        self.asked.append(key)
        if self.deaf in key:
            self.may_be_sent = True
            self.time.sleep(timeout_s)
            return None
        return super().ask(key, payload, timeout_s=timeout_s, parameters=parameters)

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        reply = self.ask(key, payload, timeout_s=timeout_s)
        return [] if reply is None else [reply]


@pytest.fixture
def time(monkeypatch: pytest.MonkeyPatch) -> StoppedTime:
    stopped = StoppedTime()
    monkeypatch.setattr(stations, "time", stopped)
    return stopped


def deaf(field: Field, time: StoppedTime, word: str) -> tuple[Station, DeafLink]:
    """A station with five seconds for an order, whose robot does not hear some questions."""
    field.station().push(corridor())
    link = DeafLink(field.board, time, word)
    return Station(link, field.keys, commander="test", timeout_s=5.0), link


def test_a_command_that_is_not_answered_is_unknown_when_its_time_is_up(time: StoppedTime) -> None:
    station, link = deaf(Field(), time, "/cmd/")
    began = time.now
    with pytest.raises(OutcomeUnknown, match=r"its outcome is unknown.* It has expired"):
        station.command("start")
    assert time.now - began == pytest.approx(5.0, abs=0.1)
    assert link.asked.count("sx/1/r1/cmd/start") > 1


def test_a_command_to_a_robot_that_does_not_report_its_state_was_not_sent(time: StoppedTime) -> None:
    station, link = deaf(Field(), time, "/info")
    began = time.now
    with pytest.raises(RobotUnreachable, match="start was not sent"):
        station.command("start")
    assert time.now - began == pytest.approx(5.0, abs=0.1)
    assert set(link.asked) == {"sx/1/r1/info"}


def test_what_the_state_took_is_gone_for_the_command(time: StoppedTime) -> None:
    station, link = deaf(Field(), time, "/cmd/")
    answered = link.ask_all

    def slowly(key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        time.sleep(4.8)
        return answered(key, payload, timeout_s=timeout_s)

    link.ask_all = slowly  # type: ignore[method-assign]
    began = time.now
    with pytest.raises(OutcomeUnknown):
        station.command("start")
    assert time.now - began == pytest.approx(4.8 + LEAST_S, abs=0.1)


def test_a_push_goes_on_for_as_long_as_its_pieces_are_answered(time: StoppedTime) -> None:
    station, link = deaf(Field(), time, "/chunk/1")
    began = time.now
    with pytest.raises(OutcomeUnknown, match="push"):
        station.push(corridor(stops=400, revision=2))
    assert time.now - began == pytest.approx(PATIENCE_S, abs=0.1)
    link.deaf = "nothing"
    sent = len(link.asked)
    station.push(corridor(stops=400, revision=2))
    assert not any(key.endswith("/chunk/0") for key in link.asked[sent:])


class CrossedLink(MemoryLink):
    """Another station begins a push of another mission before each of the first chunks that are sent."""

    def __init__(self, field: Field, times: int) -> None:
        super().__init__(field.board)
        field.serve()
        self.keys, self.times = field.keys, times
        self.crossed = 0

    def ask(self, key: str, payload: bytes = b"", **details: Any) -> bytes | None:
        if "/chunk/" in key and self.crossed < self.times:
            self.crossed += 1
            other = Manifest(
                mission_id="other", revision=1, digest="0" * 64, size=9, sha256="0" * 64, chunk_bytes=1024
            )
            super().ask(self.keys.mission("other", "begin"), encode(other), timeout_s=1.0)
        return super().ask(key, payload, **details)


def test_a_push_that_another_push_has_ended_begins_again() -> None:
    field = Field()
    station = Station(CrossedLink(field, 2), field.keys, commander="test")
    assert station.push(corridor()).revision == 1
    assert station.info().state.mission_id == corridor().id


def test_a_push_that_others_end_again_and_again_gives_up_and_says_why() -> None:
    field = Field()
    link = CrossedLink(field, 1000)
    with pytest.raises(NegativeResult, match="another station may be pushing too") as raised:
        Station(link, field.keys, commander="test").push(corridor())
    assert raised.value.reason == "incomplete"
    assert link.crossed == BEGINNINGS


def test_a_command_may_be_waited_for_longer_than_it_may_be_valid() -> None:
    field = Field()
    field.station().push(corridor())
    station = Station(field.board.link(), field.keys, commander="test", timeout_s=300.0)
    assert station.command("start").outcome == "ok"


@pytest.mark.parametrize(
    ("outcome", "reason", "state"), [("ok", None, "DOCKED"), ("refused", "too_dark", "PAUSED")]
)
def test_states_and_reasons_of_a_newer_robot_are_passed_on(
    outcome: str, reason: str | None, state: str
) -> None:
    """An order that was carried out, or refused, is not *unknown* because of a word that is new."""
    board, keys = Switchboard(), KeyExpressions("r1")
    told = {"is": "Answer", "cmd_id": "c1", "verb": "pause", "outcome": outcome, "reason": reason,
            "message": "m", "run_id": None, "state": state}  # fmt: skip
    board.link().serve(keys.command("*"), lambda request: encode(told))
    station = Station(board.link(), keys, commander="test", timeout_s=5.0)
    pause = msgspec.structs.replace(station.stop_order("pause"), cmd_id="c1")
    if outcome == "ok":
        assert station.give(pause).state == "DOCKED"
    else:
        with pytest.raises(NegativeResult, match="refused pause: too_dark: m") as refused:
            station.give(pause)
        assert refused.value.reason == "too_dark"


@pytest.mark.parametrize(
    ("told", "match"),
    [
        ({"cmd_id": "another"}, "the answer is to another command"),
        ({"verb": "resume"}, "the answer is to another command"),
        ({"outcome": "refused", "cmd_id": "another"}, "the answer is to another command"),
        ({"is": "ChunkHeld", "index": 0, "sha256": "0"}, "ChunkHeld is no answer to pause"),
    ],
)
def test_an_answer_to_another_question_leaves_a_command_unknown(told: dict[str, Any], match: str) -> None:
    board, keys = Switchboard(), KeyExpressions("r1")
    answer = {"is": "Answer", "cmd_id": "c1", "verb": "pause", "outcome": "ok", "reason": "too_dark",
              "message": "", "run_id": None, "state": "PAUSED"}  # fmt: skip
    board.link().serve(keys.command("*"), lambda request: encode(answer | told))
    station = Station(board.link(), keys, commander="test", timeout_s=5.0)
    with pytest.raises(OutcomeUnknown, match=match):
        station.give(msgspec.structs.replace(station.stop_order("pause"), cmd_id="c1"))


def test_a_mission_that_a_newer_robot_rejects_is_rejected() -> None:
    board, keys = Switchboard(), KeyExpressions("r1")
    told = {"is": "Rejected", "reason": "too_dark", "messages": ["m"]}
    board.link().serve(keys.command("*"), lambda request: encode(told))
    station = Station(board.link(), keys, commander="test", timeout_s=5.0)
    with pytest.raises(NegativeResult, match="rejected pause: too_dark: m"):
        station.give(station.stop_order("pause"))


class PriorityLink(MemoryLink):
    """Notes which questions, and so their answers, give way to others."""

    def __init__(self, board: Switchboard) -> None:
        super().__init__(board)
        self.bulky: dict[str, bool] = {}

    def ask(self, key: str, payload: bytes = b"", *, bulk: bool = False, **details: Any) -> bytes | None:
        self.bulky[key.split("/")[3]] = bulk
        return super().ask(key, payload, **details)


def test_what_is_large_is_asked_for_so_that_it_gives_way() -> None:
    """zenoh answers with the priority of the question, whatever the robot would say."""
    field = Field()
    field.station().push(corridor())
    link = PriorityLink(field.board)
    station = Station(link, field.keys, commander="test", timeout_s=0.3)
    station.mission(corridor().id, 1)
    station.command("start")
    list(PoseHistory(link, field.keys).catch_up())
    assert link.bulky == {"mission": True, "cmd": False, "poses": True}


def test_a_stop_is_sent_before_the_robot_was_found() -> None:
    """Finding it takes a round trip; a pause needs nothing of what that reports."""
    field = Field()
    field.station().push(corridor())
    field.order("start")
    station = field.station_at_the_link("bob")
    station.look_for("tcp/robot:7447")
    assert not field.board.alive
    assert station.command("pause").state == "PAUSED"


def test_a_stop_that_nobody_could_receive_was_not_sent(time: StoppedTime) -> None:
    station = Station(Switchboard().link(), KeyExpressions("r1"), commander="test", timeout_s=5.0)
    station.look_for("tcp/robot:7447", why=lambda: "nothing listens there")
    with pytest.raises(RobotUnreachable, match=r"tcp/robot:7447: robot r1 not found .*nothing listens there"):
        station.command("pause")
    assert time.now == pytest.approx(5.0, abs=0.1)


def test_a_timeout_that_was_partly_used_is_reported_in_tenths(time: StoppedTime) -> None:
    station = Station(Switchboard().link(), KeyExpressions("r1"), commander="test", timeout_s=4.96271)
    not_found = station.look_for("tcp/robot:7447")
    assert "not found within 5 s (" in str(not_found())


def test_a_stop_that_may_have_arrived_is_unknown_though_the_robot_was_never_found(time: StoppedTime) -> None:
    station, _ = deaf(Field(), time, "/cmd/")
    station.look_for("tcp/robot:7447")
    with pytest.raises(OutcomeUnknown, match=r"no answer to pause in time.* --timeout 600 sends it until it"):
        station.command("pause")


@pytest.mark.parametrize("difference", [-1, 1])
def test_another_protocol_version_is_refused_before_anything_is_sent(difference: int) -> None:
    field = Field()
    station = field.station()
    info = msgspec.structs.replace(station.info(), protocol=VERSION + difference)
    field.board.serving = [served for served in field.board.serving if served[1] != field.keys.info]
    field.board.link().serve(field.keys.info, lambda request: encode(info))
    named = f"robot r1: protocol {VERSION + difference}, here {VERSION}; update the older one"
    for query in (station.status, lambda: station.command("start")):
        with pytest.raises(InputError, match=named):
            query()
    assert field.told() == []
