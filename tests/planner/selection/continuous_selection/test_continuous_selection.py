"""Bounds over every position against many positions tried; visibility of cells against positions in them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, Visibility
from stopgo.planner import plan
from stopgo.planner.candidates import candidates, judged
from stopgo.planner.geometry.shapes import local_origin, to_grid
from stopgo.planner.selection.continuous_selection.cells import CellVisibility, PositionCells
from stopgo.planner.selection.cover import cover_of
from stopgo.planner.selection.demands import Demands, demands_of
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.stop_feasibility import StopFeasibility
from stopgo.planner.visibility import visibility
from tests.faults.sizes import size
from tests.planner.worlds import column, hall, two_rooms

ANYWHERE = Settings(selector="anywhere", grid=2.0, range=4, d_dis=0.2)
"""Few candidates, so that positions between them see more."""


def small_floor(seed: int) -> FloorPlan:
    """A hall of 5 to 9 m with up to three columns, or two rooms."""
    random = np.random.default_rng(seed)
    if seed % 3 == 2:
        return two_rooms(float(random.uniform(0.9, 1.6)), at=float(random.uniform(1.2, 2.8)))
    width, depth = random.uniform(5, 9, size=2).round(2).tolist()
    places = random.uniform((1, 1), (width - 1, depth - 1), size=(int(random.integers(0, 4)), 2)).round(2)
    return hall(width, depth, *(column(f"c{k}", x, y) for k, (x, y) in enumerate(places.tolist())))


def places_in(found: Candidates, count: int, seed: int) -> Candidates:
    """Allowed positions, drawn at random."""
    space = found.space
    xy = np.random.default_rng(seed).uniform(0, 9, size=(count, 2))
    place = StopFeasibility(space)
    room = np.array([place.room_at(point) for point in xy])
    return judged(space, xy, room, part=found.chosen_part)


def holding(cells: PositionCells, seen: Visibility, row: int) -> IntArray:
    """The cells that contain the position of this row."""
    candidates = seen.candidates
    at = to_grid(candidates.xy[candidates.kept[row]] - local_origin(candidates.floor))
    inside = (cells.corner <= at) & (at <= cells.corner + cells.side[:, None])
    return np.flatnonzero(inside.all(axis=1))


def units_of(cells: PositionCells, cell: int, units: int) -> BoolArray:
    found = np.zeros(units, dtype=bool)
    for run in range(cells.pointer[cell], cells.pointer[cell + 1]):
        found[cells.first[run] : cells.last[run] + 1] = True
    return found


@pytest.mark.parametrize("limits", [{}, {"max_incidence": 60.0, "near": 1.2}])
@pytest.mark.parametrize("seed", range(size(short=2, full=20)))
def test_a_cell_sees_all_that_places_in_it_see(seed: int, limits: dict[str, float]) -> None:
    settings = replace(ANYWHERE, **limits)  # type: ignore[arg-type]
    found = candidates(navigable(small_floor(seed), settings))
    seen = visibility(places_in(found, size(short=80, full=300), seed))
    cell_visibility = CellVisibility(found)
    cells = cell_visibility.all_cells()
    for _ in range(size(short=2, full=4)):
        for row in range(seen.rows):
            cell = holding(cells, seen, row)
            assert len(cell), "every place where a stop may be lies in a cell"
            for number in cell:
                assert units_of(cells, int(number), seen.targets.total)[seen.seen_by(row)].all()
        cells = cell_visibility.cut(cells)


@pytest.mark.parametrize("seed", range(size(short=2, full=30)))
def test_no_choice_of_many_places_beats_the_bound(seed: int) -> None:
    floor = small_floor(seed)
    made = plan(floor, replace(ANYWHERE, coverage=0.8)).first
    selection, plain = made.selection, plan(floor, replace(ANYWHERE, coverage=0.8, selector="default")).first
    assert selection.everywhere
    assert not plain.selection.everywhere
    assert selection.bound <= len(selection.chosen) <= len(plain.selection.chosen)
    asked = visibility(candidates(navigable(floor, replace(ANYWHERE, coverage=0.8))))
    tried = visibility(places_in(asked.candidates, size(short=120, full=300), seed))
    demands = demands_of(asked)
    needed = cover_of(asked, demands).needed
    for count in range(1, min(selection.bound, 3)):
        for rows in combinations(range(tried.rows), count):
            assert not meets(tried, rows, demands, needed)


def meets(tried: Visibility, rows: tuple[int, ...], demands: Demands, needed: IntArray) -> bool:
    """True if these positions meet the demands."""
    got = np.zeros(tried.targets.total, dtype=bool)
    for row in rows:
        got[tried.seen_by(row)] = True
    weight = np.where(got, demands.weight, 0)
    for demand, least in enumerate(needed.tolist()):
        belongs = (demands.member == demand).any(axis=0)
        if int(weight[belongs].sum()) < least:
            return False
    return True


def test_one_stop_is_proved_fewest_of_all_places() -> None:
    """In a hall of 6 x 4 m one place in the middle sees all."""
    settings = replace(ANYWHERE, range=4.0, coverage=1.0, room_coverage=0.0, kind_coverage=0.0)
    made = plan(hall(6, 4), settings).first
    assert len(made.selection.chosen) == made.selection.bound
    assert "of all places" in made.selection.method
    assert made.selection.among == "all places"


@pytest.mark.parametrize(
    ("other", "told"),
    [({"views": 2}, "--min-views 2"), ({"fov": 90.0}, "--fov 90")],
)
def test_what_cells_do_not_know_is_refused(other: dict[str, float], told: str) -> None:
    with pytest.raises(InputError, match=f"--selector anywhere: not possible with {told}"):
        plan(hall(6, 4), replace(ANYWHERE, **other))  # type: ignore[arg-type]


def test_limits_on_views_hold_at_new_places_too() -> None:
    limits: dict[str, float] = {"max_incidence": 70.0, "near": 0.6}
    settings = replace(ANYWHERE, range=3.0, **limits)  # type: ignore[arg-type]
    made = plan(hall(9, 6, column("c", 4, 3)), settings).first
    assert made.selection.bound <= len(made.selection.chosen)
