"""An autopilot drives a mission; its reports are those of a robot, and are true."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.mission.document import with_digest
from stopgo.mission.run.events import Arrived, Failed, Held, PoseReport, Scanned, StateReport, Unconfirmed
from stopgo.recordings.page.reviewed import review
from stopgo.recordings.runs.field import FieldRecording
from tests.bridge.mavlink.auto.site import ALL, Site, real_tour, until, watched
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")


def test_a_run_is_reported_from_start_to_finish(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), watched(site) as seen:
        assert site.order("start").outcome == "ok"
    assert told(site.events) == ALL
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")
    assert told([report for report in seen if not isinstance(report, StateReport | PoseReport)]) == ALL
    away = [event.deviation_m for event in site.events if isinstance(event, Arrived)]
    assert min(away) > 0.05 and max(away) < 0.3


@pytest.mark.parametrize("profile", some(["ardupilot", "px4", "strict"], every=3))
def test_a_recording_of_a_run_is_reviewed_as_any_other(profile: str, tmp_path: Path) -> None:
    from stopgo.bridge.station.watch import watch_run

    site = Site(tmp_path, profile)
    with site.up(), FieldRecording(tmp_path / "field.rrd", None) as record, site.reached() as station:
        station.command("start")
        assert watch_run(station, record, say=print).state == "FINISHED"
    assert told(site.events) == ALL
    (run,) = review([tmp_path / "field.rrd"]).comparisons
    assert [stop.outcome for stop in run.stops] == ["scanned"] * 3
    assert run.driven_s is not None
    assert all(stop.deviation_m is not None for stop in run.stops)


def test_scans_of_a_vehicle_that_reports_nothing_are_not_made_up(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", trigger="none")
    with site.up(), watched(site):
        site.order("start")
    assert not [event for event in site.events if isinstance(event, Scanned)]
    unsure = [event for event in site.events if isinstance(event, Unconfirmed)]
    assert [event.stop for event in unsure] == ["S1", "S2", "S3"]
    assert all(event.pose is not None for event in unsure)
    assert site.run.state == "FINISHED"


def test_a_stop_that_is_missed_has_failed_however_often_it_is_called_reached(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["beside@7=0.6"])
    with site.up(), watched(site):
        site.order("start")
        until(site, lambda events, run: run.state == "HELD")
        (failed,) = [event for event in site.events if isinstance(event, Failed)]
        assert failed.stop == "S2"
        assert 500 < float(failed.reason.split()[0]) < 800
        assert "(300 mm are tolerated); the vehicle reports it reached" in failed.reason
        assert "Arrived S2" not in told(site.events)
        assert isinstance(site.events[-1], Held)
        with site.reached() as station:
            assert station.status().state == "HELD"
        site.order("skip")
    assert told(site.events)[-5:] == ["Skipped S2", "Arrived S3", "Settled S3", "Scanned S3", "Finished"]


def test_a_scanner_that_is_a_component_of_its_own_is_believed(tmp_path: Path) -> None:
    """As a camera is to which ArduPilot passes the trigger on."""
    site = Site(tmp_path, "ardupilot", faults=["camera@1"])
    with site.up(), watched(site):
        site.order("start")
    assert told(site.events) == ALL


@pytest.mark.parametrize("camera", [[], ["camera@1"]])
def test_a_report_of_a_scan_that_is_lost_is_requested_of_the_component_that_has_it(
    tmp_path: Path, camera: list[str]
) -> None:
    site = Site(tmp_path, "ardupilot", faults=[*camera, "lostpicture@2"])
    with site.up(), watched(site):
        site.order("start")
    assert told(site.events) == ALL


def test_a_stop_that_may_be_left_out_does_not_hold_the_run(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["beside@7=0.6"], mission=real_tour(on_failure="skip"))
    with site.up(), watched(site):
        site.order("start")
    assert site.run.done == ("S1", "S3") and site.run.skipped == ("S2",)
    assert site.run.state == "FINISHED"


def test_a_scan_that_fails_is_tried_again_as_often_as_the_stop_says(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["scanner@2"], mission=real_tour(retries=1))
    with site.up(), watched(site):
        site.order("start")
    words = told(site.events)
    assert words.count("Arrived S2") == 2 and words.count("Scanned S2") == 1
    assert site.run.done == ("S1", "S2", "S3")


def test_what_the_line_loses_is_recovered(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot", faults=["loss@20=7"])
    with site.up(), watched(site):
        site.order("start")
    words = told(site.events)
    assert [word for word in words if word.startswith("Arrived")] == [
        "Arrived S1",
        "Arrived S2",
        "Arrived S3",
    ]
    assert site.run.state == "FINISHED" and site.run.done == ("S1", "S2", "S3")


def test_a_stop_that_ends_the_run_leaves_the_vehicle_standing(tmp_path: Path) -> None:
    site = Site(tmp_path, "px4", faults=["beside@6=0.6"], mission=real_tour(on_failure="abort"))
    with site.up():
        with watched(site):
            site.order("start")
        assert site.run.state == "ABORTED"
        with found_peer(site.url, vehicle=1) as peer:
            assert not peer.in_auto


def test_a_last_stop_that_is_left_out_ends_the_run_where_the_vehicle_is(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up():
        with watched(site):
            site.order("start")
            until(site, lambda events, run: run.at == 2)
            assert site.order("skip").state == "FINISHED"
        with found_peer(site.url, vehicle=1) as peer:
            assert not peer.in_auto


def test_the_return_is_driven_at_the_end(tmp_path: Path) -> None:
    there = real_tour()
    back = with_digest(msgspec.structs.replace(there, return_=((1.0, 1.0), (0.0, 1.0), (0.0, 0.0))))
    site = Site(tmp_path, "ardupilot", mission=back)
    with site.up(), watched(site) as seen:
        site.order("start")
    assert told(site.events) == [*ALL[:-1], "Homing", "Finished"]
    last = [report for report in seen if isinstance(report, PoseReport)][-1].pose
    assert (last.x, last.y) == pytest.approx((0.0, 0.0), abs=0.25)


def test_a_pause_stops_a_vehicle_that_somebody_else_has_started(tmp_path: Path) -> None:
    site = Site(tmp_path, "ardupilot")
    with site.up(), found_peer(site.url, vehicle=1) as peer:
        peer.order(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        peer.order(dialect.MAV_CMD_DO_SET_MODE, 1, 10)
        assert site.order("pause").outcome == "ok"
        assert not peer.in_auto


def test_a_run_that_somebody_else_has_started_is_reported_as_theirs(tmp_path: Path) -> None:
    site = Site(tmp_path, "px4")
    with site.up(), found_peer(site.url, vehicle=1) as peer, watched(site, compares=True):
        peer.order(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1)
        peer.order(dialect.MAV_CMD_DO_SET_MODE, 1, 4, 4)
    assert told(site.events) == ALL
    assert "somebody" in getattr(site.events[0], "commander", "")
