"""Two robots of one name: whoever notices lets both stand still, and says so."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.link.protocol import Booted, KeyExpressions, encode
from stopgo.bridge.link.zenoh_link import listening
from stopgo.bridge.robot import program
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.robot.program import check_name_is_free
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import NegativeResult
from tests.bridge.guarded import GuardedField, keys_of_site
from tests.bridge.world import Field, corridor
from tests.ports import free_port


def twins() -> tuple[Field, Field]:
    """Two robots r1 on one switchboard, both running the same mission."""
    one, other = Field(), Field()
    for field in (one, other):
        field.station().push(corridor())
        assert field.order("start").outcome == "ok"
        field.board = one.board
    one.serve()
    other.link = other.board.link()
    other.serve()
    return one, other


def test_a_command_is_for_the_one_that_reported_its_state() -> None:
    """Written for the first before the second came, it is not carried out by that."""
    one, other = Field(), Field()
    for field in (one, other):
        field.station().push(corridor())
    start = one.station().order("start")
    assert other.controller.execute(start).reason == "expired"
    assert one.controller.execute(start).outcome == "ok"


def test_a_station_that_hears_two_stops_both_and_says_so() -> None:
    one, other = twins()
    station = Station(one.board.link(), one.keys, commander="test", timeout_s=0.3)
    with pytest.raises(NegativeResult, match=r"r1: two robots answer to this name .* both received a pause"):
        station.status()
    assert (one.controller.run.state, other.controller.run.state) == ("PAUSED", "PAUSED")


def test_a_watch_that_hears_two_stops_both() -> None:
    one, other = twins()
    station = Station(one.board.link(), one.keys, commander="test", timeout_s=0.3)
    with pytest.raises(NegativeResult, match="two robots"):
        list(station.reports())
    assert other.controller.run.state == "PAUSED"


def test_an_impostor_is_no_twin(tmp_path: Path) -> None:
    """With another's keys it answers in vain, and nobody stops."""
    field = GuardedField(keys_of_site(tmp_path / "site"))
    field.guarded_station().push(corridor())
    impostor = field.board.link(field.signing("r2", boot_id="b"))
    impostor.serve(field.keys.info, lambda request: b"{}")
    impostor.serve(field.keys.boot, lambda request: encode(Booted(boot_id="b")))
    assert field.guarded_station().command("start").state == "RUNNING"


def test_a_robot_that_notices_its_twin_holds() -> None:
    one, other = twins()
    clock = SimulatedClock()
    agent = Agent(
        keys=one.keys, link=one.board.link(), journal=one.journal, runner=one.controller, clock=one.clock,
        command_clock=clock, stand_still=one.controller.hold,
    )  # fmt: skip
    agent._look_for_twin()
    assert one.controller.run.state == "RUNNING"
    clock.wait(10.0)
    agent._look_for_twin()
    assert one.controller.run.state == "HELD"
    assert "another robot answers to the name r1" in one.controller.run.reason
    assert other.controller.run.state == "RUNNING"


def test_a_name_that_is_alive_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "TOKEN_WAIT_S", 0.01)
    field = Field()
    field.serve()
    link = field.board.link()
    check_name_is_free(link, KeyExpressions("r1"), "the router")
    field.link.announce(field.keys.alive)
    with pytest.raises(
        NegativeResult, match=r"r1: robot name already in use at the router .* another --name"
    ):
        check_name_is_free(link, KeyExpressions("r1"), "the router")


def test_two_that_listen_apart_are_found_by_a_station_linked_to_both() -> None:
    """Without a router between them neither can find the other."""
    endpoints = [f"tcp/127.0.0.1:{free_port()}" for _ in range(2)]
    fields = [Field(), Field()]
    with ExitStack() as stack:
        for endpoint, field in zip(endpoints, fields, strict=True):
            field.station().push(corridor())
            assert field.order("start").outcome == "ok"
            link = stack.enter_context(listening(endpoint))
            Agent(
                keys=field.keys, link=link, journal=field.journal, runner=field.controller, clock=field.clock,
                command_clock=field.clock,
            ).serve()  # fmt: skip
            link.announce(field.keys.alive)
        with (
            connect(",".join(endpoints), robot="r1") as station,
            pytest.raises(
                NegativeResult, match=r"r1: two robots answer to this name .* both received a pause"
            ),
        ):
            station.status()
    assert [field.controller.run.state for field in fields] == ["PAUSED", "PAUSED"]
