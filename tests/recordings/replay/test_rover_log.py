"""An ArduPilot Rover's stop-and-go log: its five stops, against its own messages read by pymavlink."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.drive_verdict import drive_verdict
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from stopgo.recordings.replay.uploaded import mission_in
from tests.mission.mavlink.rover_log import KINDS, LOG, OF_ROVER_LOG, logged

pytestmark = OF_ROVER_LOG
M_PER_STEP = 0.011131884502145034
SCAN, WAYPOINT, DELAY = 217, 16, 93


@pytest.fixture(scope="module")
def messages() -> dict[str, list[Any]]:
    """By name, as pymavlink's own reader gives them."""
    return {name: logged(name) for name in KINDS}


@pytest.fixture(scope="module")
def found() -> Replay:
    log = read_log(LOG)
    return replay(log, mission_in(log), Placing())


def metres(lat: float, lon: float, home: Any) -> tuple[float, float]:
    """East and north of home by ArduPilot's own scale."""
    scale = 1e7 * M_PER_STEP
    return (lon - home.Lng) * scale * math.cos(math.radians(home.Lat)), (lat - home.Lat) * scale


def test_its_five_stops_are_where_the_mission_in_it_says(
    found: Replay, messages: dict[str, list[Any]]
) -> None:
    home, *items = messages["CMD"][-16:]
    wanted = [metres(item.Lat, item.Lng, home) for item in items if item.CId == WAYPOINT]
    assert len(wanted) == 5
    assert np.allclose([(stop.x, stop.y) for stop in found.mission.stops], wanted, atol=1e-4)
    assert [(stop.settle_s, stop.scan.duration_s) for stop in found.mission.stops] == [(1.0, 3.0)] * 5
    assert [(match.how, match.stop) for match in found.matches] == [("visit", k) for k in range(5)]


def test_it_stood_at_each_stop_while_the_vehicle_says_it_waited(
    found: Replay, messages: dict[str, list[Any]]
) -> None:
    """Each delay begins with item 93 and ends where the next item begins, 3 s later."""
    executed = messages["MISE"]
    delays = [k for k, item in enumerate(executed) if item.CId == DELAY]
    for match, k in zip(found.matches, delays, strict=True):
        begin_ns = executed[k].TimeUS * 1000
        assert match.standstill.begin_ns <= begin_ns - 10**9  # it held for a second before
        ends = executed[k + 1].TimeUS if k + 1 < len(executed) else executed[k].TimeUS + 3_000_000
        assert match.standstill.end_ns >= ends * 1000 - 5 * 10**8
        assert (ends - executed[k].TimeUS) / 1e6 == pytest.approx(3.0, abs=0.05)
    told = [item.reason for item in found.comparison.stops]
    assert all("then waited 3.00 s" in reason for reason in told[:4])


def test_true_errors_are_those_of_the_simulators_own_position(
    found: Replay, messages: dict[str, list[Any]]
) -> None:
    home = messages["CMD"][-16]
    for k, stop in enumerate(found.mission.stops):
        halt = found.matches[k].standstill
        inside = [m for m in messages["SIM"] if halt.begin_ns <= m.TimeUS * 1000 <= halt.end_ns]
        places = np.median([metres(m.Lat, m.Lng, home) for m in inside], axis=0)
        assert found.true_offset_m(k) == pytest.approx(math.dist(places, (stop.x, stop.y)), abs=0.002)
        assert 0.06 < (found.true_offset_m(k) or 0) < 0.3


def test_offsets_are_those_of_the_vehicles_own_filter(found: Replay, messages: dict[str, list[Any]]) -> None:
    home = messages["CMD"][-16]
    (origin,) = [row for row in messages["ORGN"] if row.Type == 0]
    east, north = metres(origin.Lat, origin.Lng, home)
    for k, stop in enumerate(found.mission.stops):
        halt = found.matches[k].standstill
        inside = [
            (m.PE + east, m.PN + north)
            for m in messages["XKF1"]
            if m.C == 0 and halt.begin_ns <= m.TimeUS * 1000 <= halt.end_ns
        ]
        x, y = np.median(inside, axis=0)
        assert found.comparison.stops[k].deviation_m == pytest.approx(
            math.dist((x, y), (stop.x, stop.y)), abs=1e-3
        )


def test_the_filter_is_right_about_where_it_stood(found: Replay) -> None:
    """A simulated receiver errs by little: what it says and the truth differ by far less than the offsets."""
    for k, item in enumerate(found.comparison.stops):
        assert item.deviation_m == pytest.approx(found.true_offset_m(k), abs=0.01)


def test_triggers_are_reported_in_the_verdict(found: Replay) -> None:
    assert "trigger of the scanner at 5 of 5 stops" in drive_verdict(found).text
