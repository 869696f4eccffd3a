"""A vehicle that is off its stop while it scans there: reported at once, at the end and later."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from stopgo.bridge.commands.run_control_commands import state_line
from stopgo.bridge.commands.watch_commands import print_comparison
from stopgo.bridge.mavlink.auto.unfinished_run import check_run_over
from stopgo.bridge.mavlink.simulated.estimator import Estimator
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.peer import reached as found_peer
from stopgo.bridge.station.watch import EventLines, watch_with
from stopgo.mission.comparing.run_collector import RunCollector
from stopgo.mission.document import Scan
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.events import Failed, Scanned, Unconfirmed
from stopgo.mission.run.tolerance import deviation
from stopgo.recordings.catalog.run_index import index_of, index_text
from stopgo.recordings.page import report_html
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import review
from stopgo.recordings.runs.field import FieldRecording
from tests.bridge.mavlink.auto.site import PATIENCE_S, Site, real_tour, until, watched
from tests.faults.sizes import some
from tests.mission.mavlink.following.worlds import told

pytestmark = pytest.mark.usefixtures("own_time")

SCAN = Scan(profile="default", duration_s=30.0, timeout_s=60.0)
JUMP = "jump@5=0.25"
"""In the midst of the first stop's scan."""
NARROW_M, WIDE_M = 0.05, 0.3


@pytest.fixture(autouse=True)
def away(monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimate jumps away from the first stop, by no chance."""

    def jump(estimator: Estimator, metres: float) -> None:
        off = estimator.now.pose.x - 1.0, estimator.now.pose.y
        for axis in (0, 1):
            estimator._jumped[axis] += metres * off[axis] / math.hypot(*off)

    monkeypatch.setattr(Estimator, "jump", jump)


def site_that_jumps(folder: Path) -> Site:
    mission = real_tour(tolerance_m=WIDE_M, scan=SCAN)
    return Site(folder, "ardupilot", mission=mission, faults=[JUMP])


def test_a_scan_during_which_the_estimate_jumps_is_reported_with_its_deviation_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site, said = site_that_jumps(tmp_path), []
    (tmp_path / "records").mkdir()
    path = tmp_path / "records" / "field.rrd"
    with site.up(), FieldRecording(path, None) as record, site.reached() as station:
        station.command("start")
        heard = RunCollector(record)
        state = watch_with(station, heard, EventLines(said.append))
        again = watch_with(station, RunCollector(), EventLines(said.append), run_id=state.run_id)
    first = site.mission.stops[0]
    scan = next(event for event in site.events if isinstance(event, Scanned) and event.stop == "S1")
    away = deviation(scan.pose, first)
    assert 0.3 < away < 0.5
    words = f"{1000 * away:.0f} mm from its stop (300 mm are tolerated)"
    assert len([line for line in said if "Scanned         S1" in line and words in line]) == 2
    assert state.outside == again.outside and "S1" in state.outside
    assert "scanned outside tolerance: S1" in state_line(state)
    assert print_comparison(heard, state, as_json=False) == 1
    assert f"S1 was scanned {words}" in capsys.readouterr().out
    found = review([path])
    assert found.exit_code == 1
    assert f"S1 was scanned {words}" in found.recordings[0].as_text()
    assert found.recordings[0].as_json()["runs"][0]["stops"][0]["outside_tolerance"] is True
    assert f"S1 was scanned {words}" in report_html(subject_of(found)).decode()
    ((_, run),) = index_of(path.parent).runs()
    assert (run.answer, run.deviation_m) == ("no", pytest.approx(away, abs=0.001))
    assert f"{1000 * away:.1f}" in index_text(index_of(path.parent))


@pytest.mark.parametrize("profile", some(["ardupilot", "px4"], every=2))
def test_a_stop_that_is_missed_and_left_out_is_not_done(
    profile: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It drives as a real one, so all its stops are off their positions; it scans there all the same."""
    mission = real_tour(tolerance_m=NARROW_M, on_failure="skip")
    site, said, heard = Site(tmp_path, profile, mission=mission, seed=2), [], RunCollector()
    with site.up(), site.reached() as station:
        station.command("start")
        state = watch_with(station, heard, EventLines(said.append))
    failed = [event for event in site.events if isinstance(event, Failed)]
    assert [event.stop for event in failed] == ["S1", "S2", "S3"]
    away = [int(re.findall(r"([0-9]+) mm from its stop", event.reason)[0]) for event in failed]
    assert min(away) > 50 and max(away) < 250
    assert all("(50 mm are tolerated)" in event.reason for event in failed)
    assert sum("mm from its stop" in line for line in said) >= 3
    assert (state.done, state.skipped) == ((), ("S1", "S2", "S3"))
    assert print_comparison(heard, state, as_json=False) == 1
    assert "0 of 3 stops scanned" in capsys.readouterr().out


@pytest.mark.parametrize("profile", some(["px4", "ardupilot"], every=2))
def test_within_a_tolerance_that_it_keeps_its_stops_are_done_with_their_deviation(
    profile: str, tmp_path: Path
) -> None:
    site, said, heard = (
        Site(tmp_path, profile, mission=real_tour(tolerance_m=WIDE_M), seed=2),
        [],
        RunCollector(),
    )
    with site.up(), site.reached() as station:
        station.command("start")
        state = watch_with(station, heard, EventLines(said.append))
    compared = heard.compared()
    assert compared is not None and (state.done, state.outside) == (("S1", "S2", "S3"), ())
    assert all(0.08 < (item.deviation_m or 0.0) < WIDE_M for item in compared.stops)
    assert print_comparison(heard, state, as_json=False) == 0


def test_a_stop_that_nobody_saw_scanned_from_elsewhere_has_failed_and_is_not_only_unconfirmed(
    tmp_path: Path,
) -> None:
    """Its camera reports its position: who connects later can know it."""
    site = Site(tmp_path, "ardupilot", mission=real_tour(tolerance_m=NARROW_M, on_failure="skip"))
    with site.up():
        assert site.order("start").outcome == "ok"
        with found_peer(site.url, vehicle=1) as peer:
            heard(peer, "CAMERA_IMAGE_CAPTURED")
        with watched(site):
            pass
    assert not [event for event in site.events if isinstance(event, Unconfirmed)]
    assert told(site.events)[1:3] == ["Failed S1", "Skipped S1"]


def test_a_push_names_the_stops_of_the_run_in_its_way_that_were_scanned_from_elsewhere(
    tmp_path: Path,
) -> None:
    site = site_that_jumps(tmp_path)
    with site.up(), site.reached() as station:
        station.command("start")
        until(site, lambda events, run: run.outside == ("S1",))
        station.command("pause")
    with (
        site.up(),
        site.book() as book,
        found_peer(site.url, vehicle=1) as peer,
        pytest.raises(NegativeResult, match=r"1 of 3 stops done \(1 scanned outside tolerance: S1\)"),
    ):
        check_run_over(str(peer), book, "a push")


def heard(peer: Peer, name: str) -> None:
    """Wait for a message of the vehicle."""
    with peer.waiting(name) as waiting:
        assert waiting.get(PATIENCE_S) is not None
