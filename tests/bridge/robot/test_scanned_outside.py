"""A stop that was scanned from elsewhere is done, and whoever says so says that too."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from stopgo.bridge.commands.run_control_commands import state_line, status_json
from stopgo.bridge.commands.watch_commands import print_comparison
from stopgo.bridge.station.watch import EventLines, EventObjects, event_line, table_lines, watch_with
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.events import Arrived, Failed, Scanned
from stopgo.mission.run.tolerance import StopErrors
from tests.bridge.world import Field, corridor

BESIDE = "120 mm from its stop (50 mm are tolerated)"


@pytest.fixture
def field() -> Field:
    """A robot that is pushed 120 mm aside while it scans s2."""
    made = Field()
    made.station().push(corridor())
    made.order("start")
    made.work_until(lambda run: (run.at, run.stop_state) == (1, "VERIFYING"))
    here = made.base.pose()
    made.base.stand_at(msgspec.structs.replace(here, y=here.y + 0.12))
    made.work()
    return made


def test_the_robot_reports_it_in_its_state(field: Field) -> None:
    state = field.report()
    assert (state.done, state.outside, state.outside_count) == (("s1", "s2", "s3"), ("s2",), 1)
    assert "3 done (1 scanned outside tolerance: s2);" in state_line(state)
    assert status_json(state)["outside"] == ("s2",)
    assert "3 done (1 scanned outside tolerance: s2)" in "\n".join(
        table_lines(corridor(), state, None, field.journal.events(), 0.0)
    )


@pytest.mark.parametrize("run_id", [None, "past"])
def test_watch_reports_it_at_once_and_at_the_end_and_by_its_exit_code(
    field: Field, run_id: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    said: list[str] = []
    heard = RunCollector()
    past = None if run_id is None else field.controller.run.run_id
    state = watch_with(field.station(), heard, EventLines(said.append), run_id=past)
    (line,) = [line for line in said if "Scanned         s2" in line]
    assert BESIDE in line
    assert not [line for line in said if BESIDE in line and "s2" not in line]
    assert state.outside == ("s2",)
    assert print_comparison(heard, state, as_json=False) == 1
    assert f"s2 was scanned {BESIDE}." in capsys.readouterr().out


def test_a_program_that_watches_is_informed(field: Field) -> None:
    told: list[dict[str, Any]] = []
    objects = EventObjects(told.append)
    objects.mission(corridor())
    for event in field.journal.events():
        objects.show(event)
    assert {item["stop"]: item["beside"] for item in told if "beside" in item} == {"s2": BESIDE}


def test_every_stop_scanned_outside_is_named_however_many_a_state_lists() -> None:
    field, most = Field(), 55
    field.station().push(corridor(stops=most, closed=False))
    field.order("start")
    while field.controller.run.state == "RUNNING":
        if field.controller.run.stop_state == "VERIFYING":
            here = field.base.pose()
            field.base.stand_at(msgspec.structs.replace(here, y=0.12))
        field.controller.step()
    assert (len(field.report().outside), field.report().outside_count) == (50, most)
    assert field.station().status().outside == field.controller.run.done
    assert "55 done (55 scanned outside tolerance: s50, s51, s52, s53, s54, s55, …);" in state_line(
        field.report()
    )


def test_a_stop_scanned_within_its_tolerance_is_reported_as_before() -> None:
    field = Field()
    field.station().push(corridor())
    field.order("start")
    field.work()
    errors = StopErrors(corridor())
    scans = [event for event in field.journal.events() if isinstance(event, Scanned)]
    assert len(scans) == 3 and not [event for event in scans if "beside" in event_line(event, errors)]
    assert "3 done;" in state_line(field.report())


def test_status_names_the_skipped_stops_of_a_finished_run(field: Field) -> None:
    state = msgspec.structs.replace(field.report(), skipped=("s2",), skipped_count=1)
    assert state.state == "FINISHED"
    assert ", 1 skipped (s2: stopgo start --again repeats the mission);" in state_line(state)


def narrow() -> Mission:
    """A mission whose scanner sees 90°."""
    mission = corridor()
    return with_digest(
        msgspec.structs.replace(mission, scanner=msgspec.structs.replace(mission.scanner, fov_deg=90.0))
    )


@pytest.mark.parametrize(("degrees", "outside"), [(14.0, ("s2",)), (4.0, ())])
def test_a_scanner_that_sees_90_degrees_must_have_faced_as_planned(
    degrees: float, outside: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    field = Field()
    field.station().push(narrow())
    field.order("start")
    field.work_until(lambda run: (run.at, run.stop_state) == (1, "VERIFYING"))
    here = field.base.pose()
    field.base.stand_at(msgspec.structs.replace(here, heading=here.heading + math.radians(degrees)))
    field.work()
    assert field.report().outside == field.station().status().outside == outside
    said: list[str] = []
    heard = RunCollector()
    state = watch_with(field.station(), heard, EventLines(said.append), run_id=field.controller.run.run_id)
    words = f"turned {degrees:.1f}° from its heading (5° are tolerated)"
    assert any("Scanned         s2" in line and words in line for line in said) == bool(outside)
    assert print_comparison(heard, state, as_json=False) == len(outside)
    assert (f"s2 was scanned {words}." in capsys.readouterr().out) == bool(outside)


def test_a_robot_that_does_not_turn_scans_nothing_with_a_scanner_that_sees_90_degrees(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    field = Field()
    turned = field.base.goto

    def goto(path: Any, *, heading: float | None, **others: Any) -> Any:
        return turned(path, heading=None if heading is None else heading + 0.25, **others)

    monkeypatch.setattr(field.base, "goto", goto)
    field.station().push(narrow())
    field.order("start")
    field.work()
    failed = [event for event in field.journal.events() if isinstance(event, Failed)]
    words = "turned 14.3° from its heading (5° are tolerated) after 3 corrections"
    assert failed and {event.reason for event in failed} == {words}
    assert not [event for event in field.journal.events() if isinstance(event, Arrived | Scanned)]
