"""A run that a gateway drove on a simulated vehicle: each figure of its report is that of the vehicle."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.simulated.rover import Rover as Wheels
from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFault, VehicleFaults
from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport, StateReport
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.path_and_time import driven_path
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.runs.field import FieldRecording
from tests.bridge.mavlink.driving.world import SITE, gateway, rover, site_mission
from tests.faults.sizes import size

pytestmark = pytest.mark.usefixtures("own_time")

MM = 1e-3
SURE = {"SIM_POS_DRIFT": 0.0, "SIM_POS_NOISE": 0.0, "SIM_YAW_DRIFT": 0.0, "SIM_EST_LAG": 0.0}
"""The vehicle knows where it is."""
ROLLS_M = 5e-3
"""How far it still rolls that moves too slowly for its speed to tell."""
HELD_AT_M = 4.7
Rows = list[tuple[int, float, float]]


@pytest.fixture
def rows(monkeypatch: pytest.MonkeyPatch) -> Rows:
    """Times and positions of the vehicle on the site, by itself."""
    found: Rows = []
    look, turn = Wheels.at, math.radians(SITE.heading_deg)

    def at(wheels: Wheels, now_ns: int) -> tuple[Pose, float]:
        pose, speed = look(wheels, now_ns)
        x = pose.x * math.cos(turn) - pose.y * math.sin(turn)
        y = pose.x * math.sin(turn) + pose.y * math.cos(turn)
        found.append((time.time_ns(), x, y))
        return pose, speed

    monkeypatch.setattr(Wheels, "at", at)
    return found


@pytest.mark.parametrize("stops", range(3, 3 + size(short=1, full=3)))
def test_a_run_through_the_gateway_is_reported_as_the_vehicle_drove_it(
    tmp_path: Path, rows: Rows, stops: int
) -> None:
    """Of the first stop's scans one fails, the second stop is skipped, and somebody stops the vehicle."""
    mission = site_mission(stops=stops)
    faults = VehicleFaults((VehicleFault("scanner", 1),))
    with (
        rover(tmp_path, "ardupilot", faults=faults, changed=SURE) as (vehicle, operator),
        gateway(tmp_path, vehicle.url) as station,
    ):
        station.push(mission)
        station.command("start")
        _drive(mission, station, operator.hold, tmp_path / "field.rrd")
    for name in ("robot", "field.rrd"):
        told = replay(read_log(tmp_path / name), mission, Placing())
        outcomes = [(item.outcome, item.tries) for item in told.comparison.asked]
        assert outcomes == [("scanned", 2), ("skipped", 0), *(("scanned", 1) for _ in range(stops - 2))]
        assert told.comparison.seconds_in("HELD", "PAUSED") > 0
        _is_true(told, rows)
    driven = sum(math.dist(a[1:], b[1:]) for a, b in pairwise(rows))
    assert driven_path(told).driven_m == pytest.approx(driven, abs=0.05)


def _drive(mission: Mission, station: Any, halt: Callable[[], None], path: Path) -> None:
    skipped = halted = False
    with FieldRecording(path, mission) as recording:
        for report in station.reports():
            if isinstance(report, PoseReport):
                recording.pose(report)
                if report.pose.x > HELD_AT_M and not halted:
                    halted = True
                    halt()
            elif isinstance(report, StateReport):
                recording.state(report)
                if (report.stop, report.stop_state, skipped) == ("s2", "NAVIGATING", False):
                    skipped = True
                    station.command("skip")
                elif report.state in ("HELD", "PAUSED"):
                    station.command("retry" if report.state == "HELD" else "resume")
            elif isinstance(report, AnyEvent):
                recording.event(report)


def _is_true(told: Replay, rows: Rows) -> None:
    """Offsets are from where the vehicle stood when it had scanned, and it had come there by the arrival."""
    began = told.run.began_ns or 0
    for number, item in enumerate(told.comparison.asked):
        visits, stop = told.at(number), told.mission.stops[number]
        if item.outcome != "scanned":
            assert not visits and item.deviation_m is None
            continue
        halt = visits[0].standstill
        during = [(x, y) for ns, x, y in rows if halt.begin_ns <= ns <= halt.end_ns]
        x, y = during[-1]
        assert max(math.dist(place, (x, y)) for place in during) < ROLLS_M
        assert item.along_m == pytest.approx(x - stop.x, abs=MM)
        assert item.across_m == pytest.approx(y - stop.y, abs=MM)
        assert item.deviation_m == pytest.approx(math.hypot(x - stop.x, y - stop.y), abs=MM)
        came = next(ns for ns, *place in rows if math.dist(place, (x, y)) < ROLLS_M)
        assert item.arrived_s == pytest.approx((came - began) / 1e9, abs=1.0)
