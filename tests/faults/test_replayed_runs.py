"""Runs of a simulated robot with everything going wrong: each figure of their reports is the simulator's."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from stopgo.mission.comparing.compare import arrival_direction
from stopgo.mission.comparing.comparison import StopComparison
from stopgo.mission.document import Stop
from stopgo.recordings.logs import read_log
from stopgo.recordings.replay.log_placing import Placing
from stopgo.recordings.replay.path_and_time import driven_path
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.replaying import replay
from tests.faults.sizes import size
from tests.recordings.replay.driving import wandering
from tests.recordings.replay.witnessed import Witness, run_of, troubles_of

SEEDS = range(size(short=1, full=40))
NS = 2e-9
UM = 1e-6
THIN_NS = 2e9
"""A recording keeps a standing robot's pose as seldom."""
SHAKEN = 300
"""There and back, as long as a robot shakes; the way driven is without that."""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_journal_and_a_recording_report_the_truth_of_each_stop(tmp_path: Path, seed: int) -> None:
    mission = wandering(seed, stops=4, scan_s=8.0)
    witness = run_of(mission, troubles_of(seed, mission), tmp_path, seed=seed)
    for name in ("journal.sqlite", "field.rrd"):  # the last one has the way
        told = replay(read_log(tmp_path / name), mission, Placing())
        for stop, item in zip(mission.stops, told.comparison.asked, strict=True):
            _is_true_of_stop(witness, stop, item)
        _is_true_of_run(witness, told)
    _is_true_of_way(witness, told)


def _is_true_of_stop(witness: Witness, stop: Stop, told: StopComparison) -> None:
    arrivals, shots = witness.arrivals(stop), witness.shots_at(stop)
    good = [shot for shot in shots if shot.good]
    assert (told.outcome == "scanned") == bool(good), told
    assert told.tries == len(shots)
    first = witness.seconds(arrivals[0][0]) if arrivals else None
    assert told.arrived_s == pytest.approx(first, abs=NS)
    if not arrivals:
        assert told.deviation_m is None
        return
    pose = good[-1].pose if good else arrivals[-1][1]
    near = UM if good else UM + 2 * witness.shakes_m
    x, y, ahead = pose.x - stop.x, pose.y - stop.y, arrival_direction(stop)
    assert told.along_m == pytest.approx(x * math.cos(ahead) + y * math.sin(ahead), abs=near)
    assert told.across_m == pytest.approx(y * math.cos(ahead) - x * math.sin(ahead), abs=near)
    assert told.deviation_m == pytest.approx(math.hypot(x, y), abs=near)
    assert told.heading_rad == pytest.approx(math.remainder(pose.heading - stop.heading, math.tau), abs=UM)


def _is_true_of_run(witness: Witness, told: Replay) -> None:
    comparison = told.comparison
    assert comparison.driven_s == pytest.approx(witness.seconds(witness.ended_ns), abs=NS)
    assert comparison.seconds_in("PAUSED") == pytest.approx(witness.stood_s("pause"), abs=NS)
    assert comparison.seconds_in("HELD") == pytest.approx(witness.stood_s("held"), abs=NS)
    for number, stop in enumerate(told.mission.stops):
        shots, visits = witness.shots_at(stop), told.at(number)
        assert len(visits) == bool(witness.arrivals(stop))
        if shots and shots[-1].good:
            halt = visits[0].standstill
            assert (halt.begin_ns, halt.end_ns) == (witness.arrivals(stop)[0][0], shots[-1].end_ns)


def _is_true_of_way(witness: Witness, told: Replay) -> None:
    """The path and the standstills off it, from poses of which those that hardly differ were left out."""
    way, travelled = driven_path(told), told.comparison.log.poses.length_m
    assert travelled == pytest.approx(witness.length_m, rel=0.002, abs=0.02 + SHAKEN * witness.shakes_m)
    assert way.driven_m == pytest.approx(witness.length_m, rel=0.005, abs=0.02 + SHAKEN * witness.shakes_m)
    visits = [match.standstill for match in told.matches if match.how == "visit"]
    halts = [(match.standstill.begin_ns, match.standstill.end_ns) for match in told.extra]
    for rest in witness.rests(least_s=6.0):
        at_stop = any(rest[0] <= one.end_ns and one.begin_ns <= rest[1] for one in visits)
        assert at_stop or any(rest == pytest.approx(halt, abs=THIN_NS, rel=0) for halt in halts)
    rests = witness.rests(least_s=1.0)
    for halt in halts:
        assert any(halt == pytest.approx(rest, abs=THIN_NS, rel=0) for rest in rests)
