"""Standstills are found in noise, and matched to the stops at which they were."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from stopgo.mission.document import Mission
from stopgo.mission.errors import Undecided
from stopgo.mission.run.run_log import Track
from stopgo.recordings.replay.fitting import fitted
from stopgo.recordings.replay.matching import Match, matched
from stopgo.recordings.replay.standstills import find_standstills
from tests.mission.worlds import mission_of, stop
from tests.recordings.replay.driving import BEGIN_NS, Odd, Senses, driven, logged, wandering

NOISY = Senses(noise_m=0.05, noise_rad=math.radians(2))


def readings(matches: tuple[Match, ...]) -> list[tuple[str, int | None]]:
    return [(match.how, match.stop) for match in matches]


@pytest.mark.parametrize("senses", [Senses(), NOISY])
def test_every_standstill_is_found_at_its_place_and_time(senses: Senses) -> None:
    drive = driven(wandering(1), Odd(extra_before=frozenset({3})))
    halts = find_standstills(logged(drive, senses), speed=1.0)
    truth = drive.halts
    assert len(halts) == len(truth)
    reach = 0.001 if senses == Senses() else 0.03
    for halt, true in zip(halts, truth, strict=True):
        assert math.dist(halt.xy, (true.x, true.y)) < reach
        assert abs((halt.begin_ns - BEGIN_NS) / 1e9 - true.begin_s) < 0.8
        assert abs((halt.end_ns - BEGIN_NS) / 1e9 - true.end_s) < 0.8


def test_turning_on_the_spot_is_no_standstill() -> None:
    seconds = np.arange(0, 20, 0.1)
    track = Track.of(seconds * 1e9, np.zeros((200, 2)), 0.5 * seconds)
    assert find_standstills(track) == ()
    (halt,) = find_standstills(track, turns=False)
    assert halt.seconds == pytest.approx(19.9, abs=0.3)


def test_a_correction_of_the_position_does_not_part_a_standstill_and_is_reported_as_motion() -> None:
    seconds = np.arange(0, 30, 0.1)
    xy = np.zeros((300, 2))
    xy[150:, 0] = 0.12
    (halt,) = find_standstills(Track.of(seconds * 1e9, xy, np.zeros(300)))
    assert halt.seconds > 29
    assert 0.05 < halt.moved_m < 0.13


@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_log_of_few_poses_has_no_standstill(count: int) -> None:
    assert find_standstills(Track.of(np.arange(count) * 1e9, np.zeros((count, 2)), np.zeros(count))) == ()


def test_skipped_repeated_and_extra_standstills_are_distinguished() -> None:
    odd = Odd(frozenset({2}), frozenset({4}), frozenset({1, 6}))
    drive = driven(wandering(2), odd)
    matches = matched(find_standstills(logged(drive, NOISY), speed=1.0), wandering(2))
    visits = [0, 1, 3, 4, 5, 6, 7, 8]
    assert [stop for how, stop in readings(matches) if how == "visit"] == visits
    assert [stop for how, stop in readings(matches) if how == "again"] == [4]
    assert sum(how == "extra" for how, _ in readings(matches)) == 2


def line(*places: float) -> Mission:
    ends = [0.0, *places]
    legs = pairwise(ends)
    return mission_of(*(stop(f"s{k}", (a, 0.0), (b, 0.0)) for k, (a, b) in enumerate(legs, 1)))


def standing_at(*places: tuple[float, float]) -> Track:
    """Ten seconds at each place, far from one another in time."""
    rows = [(100 * k + t, x, y) for k, (x, y) in enumerate(places) for t in np.arange(0, 10, 0.1)]
    table = np.array(rows)
    return Track.of(table[:, 0] * 1e9, table[:, 1:], np.zeros(len(table)))


def test_a_standstill_next_to_a_later_stop_does_not_skip_those_between() -> None:
    """The way to s2 passes s5, and the robot waited there."""
    mission = mission_of(
        *(stop(f"s{k}", (0.0, 0.0), (4.0 * k, 0.0)) for k in (1, 2, 3, 4)),
        stop("s5", (16.0, 0.0), (6.0, 0.5)),
    )
    halts = find_standstills(standing_at((4, 0), (6, 0.4), (8, 0), (12, 0), (16, 0), (6, 0.5)))
    assert readings(matched(halts, mission)) == [
        ("visit", 0), ("extra", None), ("visit", 1), ("visit", 2), ("visit", 3), ("visit", 4),
    ]  # fmt: skip


def test_going_back_to_a_stop_is_reported_as_that() -> None:
    halts = find_standstills(standing_at((4, 0), (8, 0), (4, 0), (12, 0)))
    assert readings(matched(halts, line(4, 8, 12))) == [("visit", 0), ("visit", 1), ("back", 0), ("visit", 2)]


def test_standstills_between_two_close_stops_are_at_none_of_them() -> None:
    """Stops 0.7 m apart: what is 0.35 m from both is not called either."""
    halts = find_standstills(standing_at((3.0, 0), (3.35, 0.1)))
    assert readings(matched(halts, line(3.0, 3.7))) == [("visit", 0), ("extra", None)]


def test_a_turned_and_shifted_log_is_fitted_to_the_stops() -> None:
    senses = Senses(noise_m=0.05, noise_rad=0.03, turned=2.0, shifted=(40.0, -7.0))
    mission = wandering(3)
    track = logged(driven(mission, Odd(frozenset({1}), frozenset({2}), frozenset({5}))), senses)
    fit = fitted(find_standstills(track, speed=1.0), mission)
    assert fit.pairs == 9
    assert math.remainder(fit.transform.heading + 2.0, math.tau) == pytest.approx(0, abs=0.005)
    assert np.allclose(fit.placed(np.array([(40.0, -7.0)])), 0, atol=0.05)
    assert fit.rms_m < 0.03


@pytest.mark.parametrize("stops", [line(4, 8, 12, 16), line(3, 6)])
def test_a_fit_that_is_not_the_only_one_is_refused(stops: Mission) -> None:
    """Three standstills on four equal steps may be the first or the last three; two stops show nothing."""
    halts = find_standstills(standing_at((4, 0), (8, 0), (12, 0)))
    with pytest.raises(Undecided, match="--map"):
        fitted(halts, stops)


def test_a_log_of_another_mission_is_not_fitted() -> None:
    track = logged(driven(wandering(8)))
    with pytest.raises(Undecided, match="--map"):
        fitted(find_standstills(track, speed=1.0), wandering(9))
