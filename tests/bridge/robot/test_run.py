"""The stop-and-go controller in simulated time: what it does, in which order, and how long it takes."""

from __future__ import annotations

import math

import pytest

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from tests.bridge.world import Field, corridor


def loaded(mission: Mission | None = None, **details: object) -> Field:
    """A field whose robot holds a mission."""
    field = Field(**details)  # type: ignore[arg-type]
    field.station().push(mission or corridor())
    return field


def test_every_stop_is_driven_to_settled_at_and_scanned_in_order() -> None:
    field = loaded()
    assert field.order("start").outcome == "ok"
    field.work()
    stops = [f"{event} s{n}" for n in (1, 2, 3) for event in ("Arrived", "Settled", "Scanned")]
    assert field.told() == ["Started", *stops, "Homing", "Finished"]
    assert field.controller.run.done == ("s1", "s2", "s3")


def test_a_run_takes_the_time_that_was_planned() -> None:
    """2 m at 0.5 m/s and 0.5 m/s²: 2/0.5 + 0.5/0.5 = 5 s; the way back 6/0.5 + 1 s after a turn of 180°."""
    field = loaded()
    field.order("start")
    field.work()
    finished = field.journal.events()[-1]
    assert finished.mission_time_s == pytest.approx(3 * (5 + 2 + 60) + 180 / 45 + 13, abs=1e-3)
    assert finished.mission_time_s == pytest.approx(schedule(corridor()).total_s, abs=1e-3)


def test_an_open_tour_ends_at_its_last_stop() -> None:
    field = loaded(corridor(closed=False))
    field.order("start")
    field.work()
    assert field.controller.run.state == "FINISHED"
    assert field.base.pose().x == pytest.approx(6.0)


def test_a_closed_tour_comes_home() -> None:
    field = loaded()
    field.order("start")
    field.work()
    assert math.hypot(field.base.pose().x, field.base.pose().y) < 1e-6


def test_a_pause_while_driving_brakes_and_resume_drives_the_rest() -> None:
    field = loaded()
    field.order("start")
    field.clock.at(3.0, lambda: field.order("pause"))
    field.work()
    assert field.controller.run.state == "PAUSED"
    # 0.25 m of ramp, 2 s at 0.5 m/s, then a braking way of v²/2a = 0.25 m
    assert field.base.pose().x == pytest.approx(0.25 + 1.0 + 0.25)
    assert field.base.speed() == 0.0
    assert field.order("resume").outcome == "ok"
    field.work()
    assert field.controller.run.state == "FINISHED"


def test_a_pause_while_scanning_lets_the_scan_finish() -> None:
    field = loaded()
    field.order("start")
    field.clock.at(30.0, lambda: field.order("pause"))
    field.work()
    assert (field.controller.run.state, field.controller.run.done) == ("PAUSED", ("s1",))
    field.order("resume")
    field.work()
    assert field.told().count("Scanned s1") == 1


def test_abort_ends_the_run_where_the_robot_stands() -> None:
    field = loaded()
    field.order("start")
    field.clock.at(30.0, lambda: field.order("abort"))
    field.work()
    assert field.controller.run.state == "ABORTED"
    assert field.told()[-1] == "Aborted"
    assert "Scanned s1" not in field.told()


def test_a_skipped_stop_is_passed_by_its_own_approach() -> None:
    field = loaded()
    field.order("start")
    field.clock.at(1.0, lambda: field.order("skip", stop="s1"))
    field.work()
    assert field.controller.run.done == ("s2", "s3")
    assert field.controller.run.skipped == ("s1",)


def test_home_drives_back_over_the_driven_legs_and_ends_aborted() -> None:
    field = loaded()
    field.order("start")
    field.clock.at(80.0, lambda: field.order("home"))
    field.work()
    assert field.controller.run.state == "ABORTED"
    assert math.hypot(field.base.pose().x, field.base.pose().y) < 1e-6


def test_a_mission_that_was_run_starts_again_only_on_request() -> None:
    field = loaded()
    first = field.order("start")
    field.work()
    assert field.order("start").reason == "finished_before"
    again = field.order("start", again=True)
    assert again.outcome == "ok"
    assert again.run_id != first.run_id


def test_a_start_away_from_the_start_is_refused() -> None:
    field = loaded()
    field.base.stand_at(field.base.pose().__class__(x=1.0, y=0.0, heading=0.0))
    assert field.order("start").reason == "not_at_start"
    assert field.order("start", from_here=True).outcome == "ok"


def test_from_here_begins_at_the_nearest_leg_and_leaves_out_what_is_behind() -> None:
    field = loaded()
    field.base.stand_at(field.base.pose().__class__(x=3.0, y=0.01, heading=0.0))
    field.order("start", from_here=True)
    field.work()
    assert field.controller.run.skipped == ("s1",)
    assert field.controller.run.done == ("s2", "s3")


def test_a_start_within_the_robots_radius_of_the_start_is_accepted() -> None:
    field = loaded()
    field.base.stand_at(field.base.pose().__class__(x=0.08, y=0.0, heading=0.0))
    assert field.order("start").outcome == "ok"
    field.work()
    assert field.controller.run.done == ("s1", "s2", "s3")


@pytest.mark.parametrize("x", [1.96, 2.0, 2.008, 2.04])
def test_from_here_at_a_stop_leaves_that_stop_not_out(x: float) -> None:
    field = loaded()
    field.base.stand_at(field.base.pose().__class__(x=x, y=0.0, heading=0.0))
    field.order("start", from_here=True)
    field.work()
    assert field.controller.run.skipped == () and field.controller.run.done == ("s1", "s2", "s3")


def test_from_here_off_the_route_is_refused() -> None:
    field = loaded()
    field.base.stand_at(field.base.pose().__class__(x=3.0, y=0.5, heading=0.0))
    assert field.order("start", from_here=True).reason == "off_route"


def test_the_same_command_twice_takes_effect_once_and_gets_the_same_answer() -> None:
    field = loaded()
    command = field.command("start")
    assert field.controller.execute(command) == field.controller.execute(command)
    assert field.told() == ["Started"]


def test_a_late_command_is_refused() -> None:
    field = loaded()
    command = field.command("start")
    field.clock.wait(6.0)
    assert field.controller.execute(command).reason == "expired"


def test_a_command_for_another_state_or_run_is_refused() -> None:
    field = loaded()
    field.order("start")
    assert field.order("skip", expect_state=("PAUSED",)).reason == "wrong_state"
    assert field.order("skip", run_id="elsewhere").reason == "wrong_run"
    assert field.order("skip", revision=7).reason == "wrong_mission"
    assert field.controller.run.state == "RUNNING"


@pytest.mark.parametrize("steps", range(1, 18))
def test_a_reboot_at_any_step_pauses_and_repeats_no_finished_stop(steps: int) -> None:
    field = loaded()
    field.order("start")
    for _ in range(steps):
        field.controller.step()
    before = field.controller.run
    field.boot()
    if before.state == "FINISHED":
        assert field.controller.run == before
        return
    assert field.controller.run.state == "PAUSED"
    assert not field.controller.step() or field.controller.run.stop_state != "NAVIGATING"
    assert field.order("resume").outcome == "ok"
    field.work()
    scans = [told for told in field.told() if told.startswith("Scanned")]
    assert scans == ["Scanned s1", "Scanned s2", "Scanned s3"]
    assert field.told()[-1] == "Finished"
