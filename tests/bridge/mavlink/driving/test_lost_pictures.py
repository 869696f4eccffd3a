"""Reports of scans that a link loses or delays: each stop is scanned once, wherever the scanner is."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.bridge.mavlink.simulated.vehicle_scanner import VehicleScanner
from stopgo.mission.document import Scan
from stopgo.mission.run.events import StateReport
from tests.bridge.mavlink.driving.world import gateway, is_state, rover, scanned, site_mission, until
from tests.bridge.mavlink.lossy import Lossy, Roughness
from tests.faults.sizes import some

pytestmark = pytest.mark.usefixtures("own_time")

OWN = VehicleFault("camera", 1)
SCAN = Scan(profile="default", duration_s=6.0, timeout_s=60.0)


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """True for each trigger that the scanner took."""
    taken: list[bool] = []
    begin = VehicleScanner.begin

    def noted(scanner: VehicleScanner, *args: object, **details: object) -> bool:
        taken.append(begin(scanner, *args, **details))  # type: ignore[arg-type]
        return taken[-1]

    monkeypatch.setattr(VehicleScanner, "begin", noted)
    return taken


@pytest.mark.parametrize(
    ("profile", "own"),
    some([(profile, own) for profile in ("ardupilot", "px4") for own in ((OWN,), ())], every=4),
)
def test_a_lost_report_is_requested_of_the_scanner_and_no_stop_is_scanned_twice(
    tmp_path: Path, begun: list[bool], profile: str, own: tuple[VehicleFault, ...]
) -> None:
    faults = VehicleFaults((*own, VehicleFault("lostpicture", 1), VehicleFault("lostpicture", 2)))
    with (
        rover(tmp_path, profile, faults=faults) as (vehicle, _),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(site_mission(scan=SCAN))
        station.command("start")
        until(station.reports(), is_state("FINISHED", "HELD"))
        assert scanned(station) == ["s1", "s2"]
    assert begun == [True, True]


@pytest.mark.parametrize(
    ("stall_s", "own"), some([(stall, own) for stall in (10.0, 15.0) for own in ((), (OWN,))], every=4)
)
def test_a_stall_of_the_link_at_a_trigger_spoils_no_later_scan(
    tmp_path: Path, begun: list[bool], own: tuple[VehicleFault, ...], stall_s: float
) -> None:
    with (
        rover(tmp_path, "ardupilot", faults=VehicleFaults(own)) as (vehicle, _),
        Lossy(vehicle.url.number, Roughness(), seed=1) as line,
        gateway(tmp_path, line.url) as station,
    ):
        station.push(site_mission(scan=SCAN, retries=1, stops=3))
        station.command("start")
        reports = station.reports()
        until(reports, lambda report: isinstance(report, StateReport) and report.stop_state == "SCANNING")
        line.stall(stall_s)
        until(reports, is_state("FINISHED", "HELD"))
        assert scanned(station) == ["s1", "s2", "s3"]
    assert begun == [True, True, True]
