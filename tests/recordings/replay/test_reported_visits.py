"""Visits of a robot's own run are those that it reported."""

from __future__ import annotations

from stopgo.mission.run.events import Arrived, Failed, Homing, Scanned
from stopgo.recordings.replay.reported_visits import reported_visits
from tests.mission.comparing.reports import SCAN, at, told
from tests.mission.worlds import square_tour


def test_who_drove_home_from_a_stop_stood_there_twice() -> None:
    stop = {"stop": "S1"}
    there = {**stop, "pose": at(4.0, 0.0)}
    run = told(
        square_tour(),
        (Arrived, 10.0, {**there, "deviation_m": 0.0}),
        (Failed, 20.0, {**stop, "reason": "scan: timeout"}),
        (Homing, 25.0, {"reason": "home by ann"}),
        (Arrived, 90.0, {**there, "deviation_m": 0.0}),
        (Scanned, 120.0, {**there, **SCAN}),
    )
    visits = reported_visits(run.events, square_tour(), ())
    assert [(visit.how, visit.stop, visit.standstill.seconds) for visit in visits] == [
        ("visit", 0, 10.0),
        ("back", 0, 30.0),
    ]
