"""Fields of view below 360°: every position looks along several headings, and stops say which."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.settings.parameter_checks import check_settings
from stopgo.mission.stages import KEPT, Candidates, Route, Visibility
from stopgo.planner.candidates import candidates
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility
from stopgo.planner.visibility.headings import headings_of
from tests.planner.worlds import column, hall, mirrored, moved, planned, turned, two_rooms


def seen_with(floor: FloorPlan, fov: float, **given: object) -> Visibility:
    return visibility(candidates(navigable(floor, Settings(fov=fov, **given))))  # type: ignore[arg-type]


@cache
def seen_in_columned(fov: float, method: str) -> Visibility:
    """In a hall with a column."""
    return seen_with(hall(7, 5, column("c", 3.3, 2.4)), fov, visibility=method)


OFF_THE_GRID = hall(7.3, 5.3, column("c", 3.3, 2.4))


@cache
def seen_off_the_grid() -> Visibility:
    return seen_with(OFF_THE_GRID, 70, grid=0.83)


def test_all_round_there_are_no_headings() -> None:
    seen = seen_with(hall(), 360)
    assert not len(seen.candidates.heading)
    assert seen.method == "exact"


def test_half_the_circle_sees_half_a_square_room() -> None:
    """From the middle of 4 × 4 m walls, looking right: the right wall, and half of the two next to it."""
    seen = seen_with(hall(4, 4, column("c", 0.4, 3.6, 0.1)), 180, use=((2.0, 2.0),), targets=("walls",))
    found = seen.candidates
    row = int(found.must_rows[0])
    count = len(seen.seen_by(row))
    way = seen.targets.unit_xy[seen.seen_by(row)] - [2.0, 2.0]
    heading = found.heading[found.kept[row]]
    assert count == pytest.approx(160, abs=2)
    assert (way @ [math.cos(heading), math.sin(heading)] >= -1e-6).all()


@pytest.mark.parametrize(("fov", "number"), [(359.0, 8), (180.0, 8), (90.0, 8), (60.0, 12), (10.0, 72)])
def test_headings_are_at_most_half_a_view_apart(fov: float, number: int) -> None:
    found = candidates(navigable(hall(), Settings(fov=fov)))
    headings = headings_of(found, fov=math.radians(fov))
    assert len(headings) == number
    assert 360 / number <= fov / 2 + 1e-9 or number == 8


@pytest.mark.parametrize("fov", [10.0, 45.0, 90.0, 200.0, 359.0])
@pytest.mark.parametrize("method", ["exact", "bresenham"])
def test_headings_see_within_their_view_and_together_everything(fov: float, method: str) -> None:
    whole, parts = seen_in_columned(360, method), seen_in_columned(fov, method)
    found = parts.candidates
    for row in range(parts.rows):
        index = found.kept[row]
        way = parts.targets.unit_xy[parts.seen_by(row)] - found.xy[index]
        off = np.arctan2(way[:, 1], way[:, 0]) - found.heading[index]
        assert (np.cos(off) >= math.cos(math.radians(fov) / 2) - 1e-6).all()
    for row, index in enumerate(whole.candidates.kept):
        at = np.flatnonzero((found.xy[found.kept] == whole.candidates.xy[index]).all(axis=1))
        together = np.unique(np.concatenate([parts.seen_by(k) for k in at]))
        assert np.array_equal(together, whole.seen_by(row))


def test_what_was_dropped_stays_dropped_once() -> None:
    whole, parts = seen_in_columned(360, "exact").candidates, seen_in_columned(90, "exact").candidates
    assert np.sum(parts.reason != KEPT) == np.sum(whole.reason != KEPT)
    assert len(parts.kept) == 8 * len(whole.kept)
    assert len(parts.xy) == len(parts.room) == len(parts.part) == len(parts.heading)


def test_runs_stay_on_their_segment() -> None:
    seen = seen_with(hall(7, 5, column("c", 3.3, 2.4)), 200)
    assert np.array_equal(seen.targets.unit_segment[seen.first], seen.segment)
    assert np.array_equal(seen.targets.unit_segment[seen.last], seen.segment)


def test_a_stop_asked_for_looks_along_its_best_heading_only() -> None:
    seen = seen_with(hall(9, 5), 90, use=((2.0, 2.0),))
    found = seen.candidates
    assert len(found.must_rows) == 1
    all_round = seen_with(hall(9, 5), 360, use=((2.0, 2.0),))
    best = len(seen.seen_by(int(found.must_rows[0])))
    assert 0.25 * len(all_round.seen_by(0)) <= best < len(all_round.seen_by(0))


def test_doorways_are_scanned_once() -> None:
    seen = seen_with(two_rooms(1.0), 120, door_scan=True)
    assert len(seen.candidates.doorway_rows) == 1


@pytest.mark.parametrize(
    "move", [turned(90), turned(180), turned(30), mirrored], ids=["90", "180", "30", "m"]
)
def test_headings_turn_with_the_drawing(move) -> None:
    one, other = seen_off_the_grid(), seen_with(moved(OFF_THE_GRID, move), 70, grid=0.83)
    sizes = [sorted(len(seen.seen_by(row)) for row in range(seen.rows)) for seen in (one, other)]
    assert len(sizes[0]) == len(sizes[1])
    assert sum(sizes[0]) == pytest.approx(sum(sizes[1]), rel=0.002)


def test_a_narrow_view_needs_more_stops_and_a_whole_plan_holds() -> None:
    floor = hall(8, 6, column("c", 4, 3))
    _, wide = planned(floor, Settings(fov=360))
    mission, narrow = planned(floor, Settings(fov=90))
    route, all_round = narrow[Route], wide[Route]
    assert len(route.selection.chosen) > len(all_round.selection.chosen)
    assert route.selection.coverage >= 0.9
    assert len(mission.stops) == len(route.selection.chosen)


def test_observed_candidates_are_positions() -> None:
    """The candidates noun is shown before headings; those of the visibility have them."""
    _, nouns = planned(hall(8, 6), Settings(fov=90))
    assert not len(nouns[Candidates].heading)
    assert len(nouns[Visibility].candidates.heading)


@pytest.mark.parametrize("fov", [9.9, 0.0, -90.0, 361.0])
def test_views_outside_the_range_are_refused(fov: float) -> None:
    with pytest.raises(InputError, match="--fov "):
        check_settings(Settings(fov=fov))
