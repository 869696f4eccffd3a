"""Bresenham visibility: cell by cell on small maps, and the paper's artefact where drawings are turned."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, Visibility
from stopgo.planner.candidates import candidates
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility
from stopgo.planner.visibility.bresenham import bresenham
from stopgo.planner.visibility.bresenham_kernel import clear_line, clear_lines
from stopgo.planner.visibility.exact_sight import exact
from stopgo.planner.visibility.raster import crossed_by, inside_of, raster_of
from tests.faults.sizes import some
from tests.planner.kernels import machine_code
from tests.planner.worlds import box, column, element, floor_of, hall, moved, shell, turned, two_rooms


def placed(floor: FloorPlan, **given: object) -> Candidates:
    return candidates(navigable(floor, Settings(**given)))  # type: ignore[arg-type]


def pairs(seen: Visibility) -> set[tuple[int, int]]:
    return {(row, int(unit)) for row in range(seen.rows) for unit in seen.seen_by(row)}


def wrong_share(found: Visibility, truth: Visibility) -> float:
    return len(pairs(found) ^ pairs(truth)) / len(pairs(truth))


def map_of(*rows: str) -> tuple[bytes, int]:
    """A map drawn from the top row down, `#` occupied, as the kernel reads it."""
    return bytes(mark == "#" for row in reversed(rows) for mark in row), len(rows[0])


def test_a_free_line_is_clear_and_a_blocked_one_is_not() -> None:
    cells, width = map_of(
        ".....",
        "..#..",
        ".....",
    )
    assert clear_line(cells, width, 0, 0, 4, 0, False)
    assert not clear_line(cells, width, 0, 1, 4, 1, False)
    assert not clear_line(cells, width, 0, 0, 4, 2, False)  # (0,0) (1,0) (2,1): blocked


def test_only_a_unit_s_own_cell_does_not_block() -> None:
    cells, width = map_of("..##")
    assert clear_line(cells, width, 0, 0, 2, 0, True)
    assert not clear_line(cells, width, 0, 0, 2, 0, False)
    assert not clear_line(cells, width, 0, 0, 3, 0, True)
    assert not clear_line(cells, width, 2, 0, 0, 0, True)


def cells_of(*edge: tuple[float, float]) -> set[tuple[int, int]]:
    return set(map(tuple, crossed_by(np.array([edge])).tolist()))


def test_an_edge_occupies_every_cell_it_runs_through() -> None:
    assert cells_of((0.5, 0.25), (3.5, 0.25)) == {(0, 0), (1, 0), (2, 0), (3, 0)}
    assert cells_of((0.5, 0.25), (1.5, 1.25)) == {(0, 0), (1, 0), (1, 1)}
    assert cells_of((1.5, 1.75), (1.5, 0.5)) == {(1, 0), (1, 1)}
    assert cells_of((0.5, 0.5), (0.5, 0.5)) == {(0, 0)}


def test_cells_inside_rings_are_occupied_and_holes_are_free() -> None:
    """A ring from 1 to 6 with a hole from 3 to 4: 25 cells less one."""
    ring = [[(1, 1), (6, 1)], [(6, 1), (6, 6)], [(6, 6), (1, 6)], [(1, 6), (1, 1)]]
    hole = [[(3, 3), (3, 4)], [(3, 4), (4, 4)], [(4, 4), (4, 3)], [(4, 3), (3, 3)]]
    cells = inside_of(np.array(ring + hole, dtype=float), width=8, height=8)
    assert cells.sum() == 24
    assert not cells[3, 3] and cells[1, 1] and cells[5, 5] and not cells[6, 6]


def test_interpreted_and_compiled_agree() -> None:
    random = np.random.default_rng(1)
    cells = (random.random(40 * 40) < 0.05).astype(np.uint8)
    ends = random.integers(0, 40, (500, 2))
    own = random.random(500) < 0.5
    slow, fast = np.zeros(500, np.uint8), np.zeros(500, np.uint8)
    clear_lines(cells.tobytes(), 40, 20, 20, ends[:, 0].tolist(), ends[:, 1].tolist(), own.tolist(), slow)
    columns = [np.ascontiguousarray(column) for column in (*ends.T, own.view(np.uint8))]
    machine_code(clear_lines)(cells, 40, 20, 20, *columns, fast)
    assert np.array_equal(slow, fast)
    assert 0 < slow.sum() < 500


def test_it_is_chosen_by_name_and_says_so() -> None:
    seen = visibility(placed(hall(6, 4), visibility="bresenham"))
    assert seen.method == "bresenham"


def test_closed_rooms_are_not_looked_into() -> None:
    """With doors closed no candidate of one room sees a unit whose middle is in the other."""
    found = placed(two_rooms(1.0), doors="closed", range=20.0)
    seen = bresenham(found)
    for row, index in enumerate(found.kept):
        x = seen.targets.unit_xy[seen.seen_by(row), 0]
        assert (x <= 4.1).all() if found.xy[index, 0] < 4 else (x >= 3.9).all()


def test_nothing_beyond_the_range_is_seen() -> None:
    found = placed(hall(12, 4), range=3.0)
    seen = bresenham(found)
    for row, index in enumerate(found.kept):
        away = np.hypot(*(seen.targets.unit_xy[seen.seen_by(row)] - found.xy[index]).T)
        assert away.max(initial=0) <= 3.0 + 1e-6


def test_runs_stay_on_their_segment() -> None:
    seen = bresenham(placed(hall(8, 6, column("c", 4, 3))))
    targets = seen.targets
    assert (seen.first <= seen.last).all()
    assert np.array_equal(targets.unit_segment[seen.first], seen.segment)
    assert np.array_equal(targets.unit_segment[seen.last], seen.segment)


def test_in_a_convex_room_nearly_all_is_seen_straight_on() -> None:
    """Walls along the raster: only faces seen at a flat angle hide behind their own cells."""
    found = placed(hall(4, 4))
    assert wrong_share(bresenham(found), exact(found)) < 0.1


def test_a_beam_behind_a_column_is_hidden_and_next_to_it_seen() -> None:
    beam = element("beam", "beams", lines=[[(1, 3), (7, 3)]])
    found = placed(hall(8, 6, column("c", 4, 3, 1.0), beam), range=20.0)
    truth, seen = exact(found), bresenham(found)
    of_beam = np.flatnonzero(~seen.targets.occluding[seen.targets.unit_segment])
    x = seen.targets.unit_xy[of_beam, 0]
    inside = of_beam[(x > 3.6) & (x < 4.4)]
    assert not seen.visible[inside].any()
    assert seen.visible[of_beam[(x < 3.4) | (x > 4.6)]].all()
    assert truth.visible[of_beam].sum() == pytest.approx(seen.visible[of_beam].sum(), abs=4)


def rooms_with_columns() -> FloorPlan:
    return hall(12, 8, column("a", 4, 3), column("b", 8, 5), shell(6, 1, 6.5, 4, thick=0.1, id="closet"))


@pytest.mark.parametrize("degrees", [17.0, 30.0])
def test_the_raster_errs_on_a_turned_floor_and_alignment_cures_it(degrees: float) -> None:
    """The paper's artefact; `exact` sees the same whatever the angle (tests of visibility show that)."""
    askew = placed(moved(rooms_with_columns(), turned(degrees)), grid=0.93)
    truth, off, on = exact(askew), bresenham(askew, aligned=False), bresenham(askew)
    assert off.method == "bresenham, not aligned"
    assert wrong_share(off, truth) > 1.4 * wrong_share(on, truth)


@pytest.mark.parametrize("degrees", some([5.0, 17.0, 45.0, 73.0], every=2))
def test_aligned_it_sees_the_same_at_any_angle(degrees: float) -> None:
    one, other = (
        bresenham(placed(moved(rooms_with_columns(), turned(d)), grid=0.93)) for d in (30.0, degrees)
    )
    assert one.rows == other.rows
    assert len(pairs(one)) == pytest.approx(len(pairs(other)), rel=0.002)


def test_the_map_lies_along_the_floor() -> None:
    """Walls of 6.4 × 4.4 m outside are 128 × 88 cells, one more where the far faces lie, and a margin."""
    raster = raster_of(placed(moved(hall(6, 4), turned(30))), aligned=True)
    rows, columns = (np.flatnonzero(raster.occupied.any(axis=axis)) for axis in (1, 0))
    assert (len(columns), len(rows)) == (129, 89)


def test_maps_too_large_are_refused() -> None:
    with pytest.raises(InputError, match=r"bresenham needs .* cells .* use --visibility exact"):
        bresenham(placed(hall(20.5, 20.5), d_dis=0.001, grid=10.0))


def test_nothing_hides_a_beam_on_an_open_floor() -> None:
    beam = element("beam", "beams", lines=[[(1, 1), (3, 1)]])
    pillar = column("c", 8, 8)
    seen = bresenham(placed(floor_of(box(0, 0, 4, 4), box(7, 7, 9, 9), elements=[beam, pillar])))
    assert seen.visible[~seen.targets.occluding[seen.targets.unit_segment]].all()
