"""Long routes, improved stretch by stretch: never slower, and all that is asked for is seen."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner import covering_tour
from stopgo.planner.covering_tour import least_time_route
from stopgo.planner.covering_tour import route_stretches as stretches
from stopgo.planner.covering_tour.problem import problem_of
from stopgo.planner.overlap import links_of
from stopgo.planner.routing.leg_table import MICROSECONDS
from stopgo.planner.selection import cover_problem
from stopgo.planner.selection.separators import components_of
from tests.faults.sizes import some
from tests.planner.covering_tour.test_least_time import WORLDS, seconds_of, two_step


@pytest.fixture(autouse=True)
def _short_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(covering_tour, "WHOLE_UP_TO", 0)
    monkeypatch.setattr(stretches, "LONGEST", 2)
    monkeypatch.setattr(stretches, "POSITIONS", 20)


@pytest.mark.parametrize(
    ("world", "case"), some([(world, case) for case in (0, 1, 2, 3, 4, 5, 8, 9) for world in WORLDS], every=2)
)
def test_stretches_are_never_slower_and_see_what_is_asked_for(world: str, case: int) -> None:
    driven = two_step(world, case)
    made = least_time_route(driven)
    assert made.time is not None
    assert made.time.bound <= made.time.seconds == pytest.approx(seconds_of(made))
    assert made.time.seconds <= seconds_of(driven)
    whole, fixed, _ = cover_problem(made.visibility)
    assert not whole.missing(whole.covered_by(made.selection.chosen)).any()
    assert set(fixed.tolist()) <= set(made.selection.chosen.tolist())


def test_the_first_stop_and_the_last_one_stay() -> None:
    problem = problem_of(two_step("hall", 1))
    rows = problem.route.selection.chosen[problem.route.order]
    found = stretches.by_stretches(problem)
    assert found[[0, -1]].tolist() == rows[[0, -1]].tolist()
    assert len(set(found.tolist())) == len(found)


def test_a_stretch_is_timed_as_the_whole_line_is() -> None:
    problem = problem_of(two_step("hall", 1))
    rows = problem.route.selection.chosen[problem.route.order]
    legs = np.full(len(rows), 99.0)
    pieces = stretches.pieces_of(problem)
    stretch = stretches._Stretch(problem, pieces, rows[:1], rows[1:-1], rows[-1:], legs, -1)
    own = [stretch.after - 1, *np.searchsorted(stretch.rows, stretch.own).tolist(), stretch.after]
    line = np.searchsorted(problem.rows, rows).tolist()
    spent = stretch.times.total(own) + 2 * stretch.times.pause
    assert spent / MICROSECONDS == pytest.approx(problem.times.total(line) / MICROSECONDS, abs=1e-4)


def test_scans_of_stretches_still_register_with_the_others() -> None:
    driven = two_step("rooms", 0, register=True)
    made = least_time_route(driven)
    links = links_of(made.candidates)
    pieces = [len(components_of(links, one.selection.chosen)) for one in (driven, made)]
    assert pieces[1] <= pieces[0]


def test_paths_are_found_as_far_as_a_stretch_needs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stretches, "FARTHEST", 0.0)
    driven = two_step("hall", 1)
    made = least_time_route(driven)
    assert made.time is not None and made.time.seconds <= seconds_of(driven)


def test_no_stop_of_a_stretch_is_nearer_to_the_door_than_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """The door is where the last stop of the route is, so that most candidates are nearer to it."""
    problem = problem_of(two_step("hall", 1))
    xy = problem.candidates.xy[problem.candidates.kept]
    rows = problem.route.selection.chosen[problem.route.order][::-1]
    door = xy[rows[0]] + 0.3

    def ranked(candidates: object, asked: np.ndarray) -> tuple[np.ndarray, str]:
        return np.argsort(np.argsort(np.hypot(*(xy[asked] - door).T), kind="stable")), "a door"

    monkeypatch.setattr(stretches, "rank_at_door", ranked)
    legs = np.full(len(rows), 99.0)
    pieces = stretches.pieces_of(problem)
    stretch = stretches._Stretch(problem, pieces, rows[:1], rows[1:-1], rows[-1:], legs, -1)
    away = np.hypot(*(xy - door).T)
    added = np.setdiff1d(stretch.rows, stretch.own)
    assert len(added)
    assert (away[added] > away[rows[0]]).all() == problem.begins_at_door


def test_stops_that_only_connect_scans_have_their_own_places() -> None:
    problem = problem_of(two_step("corridor", 0, register=True))
    assert set(problem.rows.tolist()) <= set(problem.placed_rows.tolist())
    nodes = stretches.pieces_of(problem)[0][: len(problem.placed_rows)]
    at = problem.candidates.kept[problem.placed_rows]
    assert np.allclose(nodes, problem.candidates.xy[at])
