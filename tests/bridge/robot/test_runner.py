"""An agent's reports of its runner, and the end of both when the work ends."""

from __future__ import annotations

import pytest

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.robot.controller import Controller
from stopgo.mission.document import Mission
from stopgo.mission.run.states import Run
from tests.bridge.world import Field, corridor


def test_a_state_claims_no_event_that_it_does_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """An order that comes while a state is reported is in the next one."""
    field = Field()
    station = field.station()
    station.push(corridor())
    before, shown = field.journal.newest, Controller.snapshot

    def snapshot(controller: Controller) -> tuple[Run, Mission | None]:
        monkeypatch.undo()
        seen = shown(controller)
        field.order("start")
        return seen

    monkeypatch.setattr(Controller, "snapshot", snapshot)
    state = station.status()
    assert (state.state, state.last_event) == ("READY", before)
    after = station.status()
    assert (after.state, after.last_event) == ("RUNNING", field.journal.newest)


def test_a_controller_whose_work_ends_by_an_error_stands_still(monkeypatch: pytest.MonkeyPatch) -> None:
    field = Field()
    field.station().push(corridor())
    stopped: list[str] = []

    def broken(*arguments: object, **options: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(field.base, "goto", broken)
    monkeypatch.setattr(field.base, "stop", lambda: stopped.append("stop"))
    field.order("start")
    with pytest.raises(ZeroDivisionError):
        field.controller.serve()
    assert stopped == ["stop"]


def test_what_has_ended_an_agents_work_is_reported_to_whoever_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    """A vehicle's agent is in the station's own process: nobody else would report."""
    field, board = Field(), Switchboard()

    def broken() -> None:
        raise OSError("no such line")

    field.controller.works = (broken,)
    agent = Agent(
        keys=field.keys, link=board.link(), journal=field.journal, runner=field.controller,
        clock=field.clock, command_clock=field.clock, failed=board.fail,
    )  # fmt: skip
    with on_link(agent):
        with pytest.raises(OSError, match="no such line"):
            agent.wait()
        with pytest.raises(OSError, match="no such line"):
            board.link().ask(field.keys.info, timeout_s=1.0)


def test_an_agent_that_takes_no_missions_answers_no_push() -> None:
    field = Field()
    field.link.close()
    link = field.board.link()
    agent = Agent(
        keys=field.keys, link=link, journal=field.journal, runner=field.controller, clock=field.clock,
        command_clock=field.clock,
    )  # fmt: skip
    agent.serve()
    assert field.board.link().ask(field.keys.mission("m", "begin"), b"{}", timeout_s=0.1) is None
    assert b"no_mission" in (
        field.board.link().ask(field.keys.mission("m", "part/0"), timeout_s=0.1, parameters={"revision": "1"})
        or b""
    )
