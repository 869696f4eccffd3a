"""Commands to a vehicle: done by its autopilot and shown by it, or refused with the remedy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.mavlink.auto.vehicle_commands import Consent, VehicleCommands
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.bridge.robot.answers import answer_to, remember_answer
from stopgo.mission.document import Scan, with_digest
from stopgo.mission.errors import InputError, NegativeResult, RobotUnreachable
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.translate import translate
from stopgo.mission.run.events import Aborted, Pose, Resumed, Started
from stopgo.mission.run.run_commands import RunCommand
from tests.bridge.mavlink.auto.site import ALL, Site, real_tour, until, watched
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")


def refused(site: Site, verb: str, **details: object) -> str:
    """Reason of a command's refusal."""
    with pytest.raises(NegativeResult) as no:
        site.order(verb, **details)
    return str(no.value)


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_a_paused_vehicle_goes_on_where_it_stood(profile: str, tmp_path: Path) -> None:
    site = Site(tmp_path, profile)
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: "Scanned S1" in told(events))
        assert site.order("pause").state == "PAUSED"
        assert site.order("resume").state == "RUNNING"
    words = told(site.events)
    assert [word for word in words if word not in ("Paused", "Resumed")] == ALL
    assert [event.commander for event in site.events if isinstance(event, Resumed)] == ["test"]


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_stop_that_is_skipped_on_a_leg_is_driven_past_without_waiting(profile: str, tmp_path: Path) -> None:
    site = Site(tmp_path, profile)
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: run.at == 1)
        site.order("skip", stop="S2")
    assert site.run.done == ("S1", "S3") and site.run.skipped == ("S2",)
    assert "Scanned S2" not in told(site.events)


def test_a_vehicle_that_is_aborted_stands_and_may_be_disarmed(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: "Arrived S1" in told(events))
        assert site.order("abort", disarm=True).state == "ABORTED"
        with site.reached(arm=False) as station:
            assert station.status().state == "ABORTED"
        assert "disarmed" in refused(site, "start", arm=False, again=True, from_here=True)
    assert isinstance(site.events[-1], Aborted)


def test_an_aborted_mission_is_begun_again_only_when_that_is_meant(tmp_path: Path) -> None:
    site = Site(tmp_path, "px4")
    with site.up():
        site.order("start")
        site.order("abort")
        assert "finished_before" in refused(site, "start")
        assert site.order("start", again=True, from_here=True).outcome == "ok"
        with watched(site):
            pass
    words = told(site.events)
    assert words.count("Started") == 2 and words[-1] == "Finished"


def test_home_is_refused_with_the_remedy(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        why = refused(site, "home")
        site.order("abort")
    assert "unsupported" in why and "--controller mavlink:URL" in why


def test_a_disarmed_vehicle_is_armed_only_when_that_is_said(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        why = refused(site, "start", arm=False)
        assert "not_armed" in why and "--arm" in why
        assert site.run.state == "READY"


def test_another_mission_is_never_started(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    other = real_tour(settle_s=4.0)
    site.load(translate(other, "ardupilot"))
    with site.up():
        why = refused(site, "start")
    assert "mission_differs" in why and "settle of S1" in why and "push" in why


def test_a_list_of_another_station_is_not_reported_as_a_ready_mission(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    first, *_ = site.mission.stops
    site.load(translate(with_digest(msgspec.structs.replace(site.mission, stops=(first,))), "ardupilot"))
    with site.up(), site.reached() as station:
        assert (station.status().state, station.status().mission_id) == ("IDLE", None)
    with site.up():
        assert "mission_differs" in refused(site, "start")


def test_a_mission_that_another_station_has_cleared_is_not_reported_or_started(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    Store(tmp_path / "vehicle").update(mission=())
    with site.up(), site.reached() as station:
        assert (station.status().state, station.status().mission_id) == ("IDLE", None)
        with pytest.raises(NegativeResult, match=r"no_mission: .*cleared") as no:
            station.command("start")
    assert no.value.reason == "no_mission"


def test_an_abort_under_a_used_id_is_refused_and_never_reported_that_it_was_done(tmp_path: Path) -> None:
    start = RunCommand(cmd_id="once", verb="start", commander="test", issued_ns=0, valid_for_s=5.0)
    abort = msgspec.structs.replace(start, verb="abort")
    with Site(tmp_path).book() as book:
        no_vehicle: Any = None
        orders = VehicleCommands(book, no_vehicle, no_vehicle, no_vehicle, book.clock, Consent(), stands=True)
        remember_answer(book.journal, start, answer_to(start, None, book.run))
        assert (orders.execute(start).outcome, orders.execute(abort).reason) == ("ok", "id_reused")


@pytest.mark.parametrize(
    ("origin", "word"),
    [(SiteOrigin(lat=51.5001, lon=7.5, alt=100.0, heading_deg=0.0), "11.1"), (None, "no origin")],
)
def test_a_vehicle_that_counts_from_elsewhere_is_not_started(
    origin: SiteOrigin | None, word: str, tmp_path: Path
) -> None:
    site = Site(tmp_path, "ardupilot")
    site.origin = origin
    with site.up():
        why = refused(site, "start")
    assert word in why and "wrong_origin" in why


def test_a_vehicle_with_satellites_may_count_from_anywhere(tmp_path: Path) -> None:
    """11 m to the south; it stands at the mission's start all the same."""
    site = Site(tmp_path, "ardupilot", at=Pose(x=0.0, y=11.131884, heading=0.0))
    site.origin = SiteOrigin(lat=51.4999, lon=7.5, alt=100.0, heading_deg=0.0)
    with site.up():
        assert "--skip-origin-check" in refused(site, "start")
        with site.reached(any_origin=True) as station:
            assert station.command("start").outcome == "ok"
            assert station.command("abort").outcome == "ok"


def test_a_vehicle_whose_origin_is_moved_in_a_run_is_held_until_it_is_back(tmp_path: Path) -> None:
    """PX4 takes another at any time: its waypoints are elsewhere then, and it reports them as reached."""
    site = Site(tmp_path, "px4", speed_up=1.0)
    assert site.origin is not None
    there = VehicleOrigin(lat=site.origin.lat, lon=site.origin.lon, alt=site.origin.alt)
    with site.up(), watched(site), found_peer(site.url, vehicle=1) as peer:
        site.order("start")
        until(site, lambda events, run: run.stop_state == "NAVIGATING")
        peer.set_origin(replace(there, lat=there.lat + 5e-6))
        until(site, lambda events, run: run.state == "HELD")
        assert "somebody has moved the vehicle's origin" in site.run.reason
        assert "0.56 m from the mission's" in site.run.reason and not site.run.done
        assert "wrong_origin" in refused(site, "retry")
        peer.set_origin(there)
        assert site.order("retry").state == "RUNNING"
    assert site.run.done == ("S1", "S2", "S3")


def test_a_vehicle_that_stands_elsewhere_is_not_started(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", at=Pose(x=0.5, y=0.0, heading=0.0))
    with site.up():
        why = refused(site, "start")
        assert "not_at_start" in why and "0.5" in why and "--from-here" in why
        assert site.order("start", from_here=True).outcome == "ok"
        site.order("abort")


def test_a_vehicle_that_knows_no_place_on_earth_is_not_started(tmp_path: Path) -> None:
    """ArduPilot whose origin came before its filter ran: it passes over its waypoints."""
    site = Site(tmp_path, "ardupilot", faults=["unplaced@1"])
    with site.up():
        why = refused(site, "start")
    assert "no_position" in why and "GLOBAL_POSITION_INT 0, 0" in why and "restart it" in why


def test_nothing_is_sent_where_no_vehicle_is(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with pytest.raises(RobotUnreachable, match="nothing was sent"), site.reached(timeout_s=0.5):
        pass


def test_the_same_command_again_is_not_carried_out_again(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), site.reached() as station:
        order = station.order("start")
        assert station.give(order) == station.give(order)
        station.command("abort")
    assert told(site.events).count("Started") == 1


def test_a_folder_belongs_to_one_vehicle(tmp_path: Path) -> None:
    from stopgo.bridge.mavlink.auto.logbook import logbook

    site = Site(tmp_path, "ardupilot")
    with (
        pytest.raises(InputError, match="belongs to robot mavlink-1"),
        logbook(site.url, 2, tmp_path / "station"),
    ):
        pass


def test_a_finished_mission_runs_once_more_when_that_is_meant(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        with watched(site):
            site.order("start")
        with pytest.raises(NegativeResult, match="finished_before"):
            site.order("start")
        with site.reached() as station:
            assert station.command("start", again=True, from_here=True).state == "RUNNING"
            until(site, lambda events, run: len([e for e in events if isinstance(e, Started)]) == 2)
            until(site, lambda events, run: run.state == "FINISHED")
    assert told(site.events)[-1] == "Finished"
    assert len({event.run_id for event in site.events}) == 2


def test_a_second_station_knows_nothing_of_the_run_and_starts_nothing(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        with site.reached(state=tmp_path / "other", commander="other") as station:
            assert station.status().state == "IDLE" and station.status().run_id is None
            with pytest.raises(NegativeResult, match="no_mission"):
                station.command("start")
        assert site.run.state == "RUNNING"
        site.order("abort")


def test_another_commander_is_refused_until_the_lease_is_over(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        site.order("start")
        with site.reached(commander="other") as station:
            with pytest.raises(NegativeResult, match="not_the_commander"):
                station.command("skip")
            assert station.command("pause").outcome == "ok"
            assert station.command("resume", take_over=True).outcome == "ok"
        site.order("abort")
    assert "TakenOver" in told(site.events)


def test_a_signed_vehicle_obeys_its_key_and_is_ignored_without(tmp_path: Path) -> None:
    site = Site(tmp_path, "px4", key=bytes(range(32)))
    with site.up():
        assert site.order("start").outcome == "ok"
        assert site.order("abort").outcome == "ok"
        with (
            pytest.raises(RobotUnreachable, match="signing key"),
            site.reached(signing_key=bytes(32), timeout_s=1.5),
        ):
            pass


def test_a_vehicle_in_auto_is_not_armed_before_it_is_put_on_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = Site(tmp_path, "ardupilot")
    ordered: list[int] = []
    obeyed = Peer.command

    def noted(peer: Peer, number: int, *params: float, **details: Any) -> Any:
        ordered.append(number)
        return obeyed(peer, number, *params, **details)

    with site.up(), found_peer(site.url, vehicle=1) as peer:
        peer.order(dialect.MAV_CMD_DO_SET_MODE, 1, 10)
        monkeypatch.setattr(Peer, "command", noted)
        assert site.order("start").outcome == "ok"
    mode, arm = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM
    assert ordered == [mode, arm, dialect.MAV_CMD_DO_SET_MISSION_CURRENT, mode]


def test_a_pause_lets_the_scan_in_progress_finish_and_no_stop_is_scanned_twice(tmp_path: Path) -> None:
    long = Scan(profile="default", duration_s=10.0, timeout_s=20.0)
    site = Site(tmp_path, "ardupilot", mission=real_tour(scan=long))
    with site.up(), site.reached() as station:
        station.command("start")
        until(site, lambda events, run: "Settled S1" in told(events))
        assert station.command("pause").state == "PAUSED"
        until(site, lambda events, run: "Scanned S1" in told(events))
        assert site.run.state == "PAUSED" and site.run.done == ("S1",)
        assert station.command("resume").outcome == "ok"
        until(site, lambda events, run: "Arrived S2" in told(events))
        station.command("abort")
    words = told(site.events)
    assert words.index("Paused") < words.index("Scanned S1") < words.index("Resumed")
    assert words.count("Scanned S1") == words.count("Arrived S1") == 1


def test_a_stop_that_failed_is_driven_to_again_when_somebody_says_so(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["beside@7=0.4"])
    with site.up(), site.reached() as station:
        station.command("start")
        until(site, lambda events, run: run.state == "HELD")
        assert station.command("retry").state == "RUNNING"
        until(site, lambda events, run: told(events).count("Failed S2") == 2)
        assert station.command("abort").state == "ABORTED"
