"""Visibility of whole floors: against brute force, and unchanged where only the drawing changes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from stopgo.mission.errors import StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import KEPT, Candidates, Targets, Visibility
from stopgo.planner.candidates import candidates
from stopgo.planner.geometry.shapes import GRID, face_segments, local_origin, to_grid, whole_steps_of
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility
from stopgo.planner.visibility.exact_sight import DOOR_OFFSET, exact, sides_of_doors
from tests.faults.sizes import some
from tests.planner.oracle import visible_pairs
from tests.planner.worlds import (
    PAPER,
    Move,
    box,
    column,
    door,
    element,
    floor_of,
    hall,
    mirrored,
    moved,
    room,
    shared,
    shell,
    shifted,
    turned,
    two_rooms,
    wall,
)

REAL = (*PAPER, "layered/fzk-haus-eg.dxf")
TURNED = [(name, degrees) for name in REAL for degrees in (0.0, 17.0, 45.0)]


def rows_of(seen: Visibility, rows: Iterable[int]) -> np.ndarray:
    """True where one of these candidates sees a unit."""
    found = np.zeros((len(list(rows)), seen.targets.total), dtype=bool)
    for k, row in enumerate(rows):
        found[k, seen.seen_by(row)] = True
    return found


def by_force(found: Candidates, rows: Iterable[int], reach: float) -> np.ndarray:
    """The same by brute force."""
    space, targets = found.space, found.space.targets
    origin = local_origin(space.floor)
    edges = face_segments(whole_steps_of(space.occluders, origin)).astype(np.int64)
    return visible_pairs(
        to_grid(found.xy[found.kept] - origin)[list(rows)],
        edges,
        to_grid(targets.a - origin),
        to_grid(targets.b - origin),
        targets.units,
        targets.occluding,
        reach=round(reach / GRID),
    )


@pytest.mark.parametrize(("name", "degrees"), some(TURNED, every=4))
def test_a_real_floor_agrees_with_brute_force(name: str, degrees: float) -> None:
    found = candidates(navigable(moved(shared(name), turned(degrees)), Settings()))
    seen = exact(found)
    rows = range(0, seen.rows, 1 + seen.rows // 12)
    wrong = rows_of(seen, rows) != by_force(found, rows, 5.0)
    assert not wrong.any(), f"{int(wrong.sum())} of {wrong.size} pairs"


def at(floor: FloorPlan, xy: np.ndarray, settings: Settings | None = None) -> Visibility:
    """Visibility from given positions."""
    space = navigable(floor, settings or Settings())
    zeros = frozen(np.zeros(len(xy)), np.int64)
    given = Candidates(
        space=space,
        xy=frozen(xy),
        room=zeros,
        reason=frozen(zeros + KEPT, np.int64),
        part=zeros,
        strategy="given",
    )
    return exact(given)


def seen_places(seen: Visibility, back: Move = lambda xy: xy) -> list[set[tuple[float, float]]]:
    """For each position the midpoints of the units it sees, to a tenth of a millimetre, moved `back`."""
    xy = np.round(back(seen.targets.unit_xy) + 3e-5, 4) + 0.0  # no midpoint is then on the edge of rounding
    return [set(map(tuple, xy[seen.seen_by(row)].tolist())) for row in range(seen.rows)]


def furnished() -> FloorPlan:
    """Two rooms, columns round and square, a triangle, a beam, a closed stair; no two things in line."""
    angles = np.arange(0, 2 * np.pi, np.pi / 8)
    circle = np.round(np.c_[2.5 + 0.3 * np.cos(angles), 1.1 + 0.3 * np.sin(angles)], 4)
    round_column = element("round", "columns", Polygon.of(circle))
    wedge = wall("wedge", Polygon.of([(6.1, 2.9), (6.7, 3.0), (6.2, 3.4)]))
    beam = element("beam", "beams", box(1.0, 2.6, 7.0, 2.8))
    stair = element("stair", "stairs", box(6.0, 0.0, 7.0, 1.2))
    return two_rooms(0.9, at=2.3, more=(round_column, wedge, beam, stair, column("square", 1.0, 3.0)))


POSITIONS = np.array([(0.83, 0.71), (1.77, 2.03), (2.91, 3.17), (4.93, 1.09), (5.41, 2.21), (7.33, 3.07)])


@pytest.mark.parametrize("by", [(0.0, 0.0), (12.5, -7.25), (123456.789, 7654321.125)])
def test_visibility_does_not_change_when_the_floor_is_shifted(by: tuple[float, float]) -> None:
    there = at(moved(furnished(), shifted(*by)), shifted(*by)(POSITIONS))
    assert seen_places(there, shifted(-by[0], -by[1])) == seen_places(at(furnished(), POSITIONS))


def test_visibility_does_not_change_when_the_floor_is_mirrored() -> None:
    there = at(moved(furnished(), mirrored), mirrored(POSITIONS))
    assert seen_places(there, mirrored) == seen_places(at(furnished(), POSITIONS))


@pytest.mark.parametrize("degrees", [17.0, 45.0, 90.0, 200.0])
def test_visibility_does_not_change_when_the_floor_is_turned(degrees: float) -> None:
    there = at(moved(furnished(), turned(degrees)), turned(degrees)(POSITIONS))
    here = at(furnished(), POSITIONS)
    assert there.targets.total == here.targets.total
    back = seen_places(there, turned(-degrees))
    assert [len(places) for places in back] == [len(places) for places in seen_places(here)]


def test_a_beam_flush_with_a_wall_is_seen_at_any_angle() -> None:
    beam = element(
        "beam", "beams", box(-0.2, 0.55, 0, 3.55)
    )  # in the west wall, whose faces are at -0.2 and 0
    for degrees in range(0, 360, 10):
        move = turned(degrees)
        seen = at(moved(hall(6, 4, beam), move), move(np.array([(3.1, 2.3)])))
        targets = seen.targets
        assert np.count_nonzero(~targets.occluding[targets.unit_segment] & seen.visible) == 60  # 3 m


@cache
def targets_of(name: str) -> Targets:
    return navigable(shared(name), Settings()).targets


@pytest.mark.parametrize(
    ("name", "degrees"), some([(name, degrees) for degrees in (17.0, 45.0) for name in REAL], every=3)
)
def test_a_turned_floor_has_the_same_units(name: str, degrees: float) -> None:
    here = targets_of(name)
    there = navigable(moved(shared(name), turned(degrees)), Settings()).targets
    assert (there.total, len(there.units)) == (here.total, len(here.units))


def test_visibility_does_not_depend_on_the_order_of_elements_nor_on_duplicates() -> None:
    floor = furnished()
    shuffled = replace(floor, elements=(*floor.elements[::-1], floor.elements[0]))
    assert seen_places(at(shuffled, POSITIONS)) == seen_places(at(floor, POSITIONS))


def test_more_range_never_sees_less() -> None:
    seen = [at(furnished(), POSITIONS, Settings(range=reach)) for reach in (0.5, 1.0, 3.0, 5.0, 50.0)]
    for less, more in pairwise(rows_of(item, range(item.rows)) for item in seen):
        assert not (less & ~more).any()


def test_a_hall_is_seen_whole_from_its_middle() -> None:
    seen = at(hall(6, 4), np.array([(3.0, 2.0)]))
    assert seen.targets.total == (6 + 4) * 2 * 20 + (6.4 + 4.4) * 2 * 20
    assert len(seen.seen_by(0)) == (6 + 4) * 2 * 20  # the outer faces are seen by nobody


def test_a_beam_is_seen_from_both_sides_and_hides_nothing() -> None:
    beam = element("beam", "beams", box(2.9, 0.0, 3.1, 4.0))
    with_beam, without = at(hall(6, 4, beam), np.array([(1.0, 2.0)])), at(hall(6, 4), np.array([(1.0, 2.0)]))
    beam_units = (4.0 + 0.2) * 2 * 20
    assert len(with_beam.seen_by(0)) == len(without.seen_by(0)) + beam_units


def test_stairs_hide_but_are_no_target() -> None:
    stair = element("stair", "stairs", box(2.0, 1.0, 4.0, 3.0))
    seen = at(hall(6, 4, stair), np.array([(1.0, 2.0)]))
    assert "stairs" not in seen.targets.by_kind(seen.floor.elements)
    assert len(seen.seen_by(0)) < (6 + 4) * 2 * 20


@pytest.mark.parametrize("kind", ["windows", "railings"])
def test_windows_and_railings_do_not_hide(kind: str) -> None:
    pane = element("pane", kind, box(2.95, 0.0, 3.05, 4.0))
    seen = at(hall(6, 4, pane), np.array([(1.0, 2.0)]), Settings(range=9))
    assert len(seen.seen_by(0)) == (6 + 4) * 2 * 20


def test_closed_doors_hide_the_next_room() -> None:
    from_left = np.array([(1.03, 2.0)])
    floor = two_rooms(1.0, thick=0.2)
    opened, closed = (
        at(floor, from_left, Settings(range=9)),
        at(floor, from_left, Settings(range=9, doors="closed")),
    )

    def right_units(seen: Visibility) -> int:
        return int(np.sum(seen.targets.unit_xy[seen.seen_by(0), 0] > 4.15))

    assert right_units(opened) > 0
    assert right_units(closed) == 0


def test_passages_stay_open_for_the_laser_when_doors_are_closed() -> None:
    floor = two_rooms(1.0)
    floor = replace(floor, openings=(replace(floor.openings[0], kind="passage"),))
    seen = at(floor, np.array([(1.03, 2.0)]), Settings(range=9, doors="closed"))
    assert np.any(seen.targets.unit_xy[seen.seen_by(0), 0] > 4.15)


def test_touching_solids_have_no_faces_between_them() -> None:
    # A column of 0.4 m in the middle of a wall: it covers 0.4 m of face and adds 2 × 0.4 m of flanks.
    flush = element("flush", "columns", box(3.0, 0.0, 3.4, 0.4))
    plain, more = navigable(hall(), Settings()).targets, navigable(hall(6, 4, flush), Settings()).targets
    kinds = more.by_kind(hall(6, 4, flush).elements)
    assert kinds == {"columns": 3 * 8, "walls": plain.total - 8}
    assert more.raw["columns"] == 4 * 8


def test_two_walls_drawn_crossing_are_one_solid() -> None:
    cross = (wall("h", box(1, 1.9, 5, 2.1)), wall("v", box(2.9, 1, 3.1, 3)))
    targets = navigable(hall(6, 4, *cross), Settings()).targets
    faces = 2 * (4 - 0.2) + 2 * (2 - 0.2) + 4 * 0.2
    assert np.isclose(np.hypot(*(targets.b - targets.a).T).sum(), 20 + 21.6 + faces)


def test_a_wall_drawn_as_a_line_hides_and_is_scanned_on_both_sides() -> None:
    line = element("line", "walls", lines=[[(3, 0.5), (3, 3.5)]])
    left = at(hall(6, 4, line), np.array([(1.0, 2.0)]))
    right = at(hall(6, 4, line), np.array([(5.0, 2.0)]))
    for seen in (left, right):
        owner = seen.targets.element[seen.targets.unit_segment[seen.seen_by(0)]]
        assert int(np.sum(owner == 1)) == 60
    assert not set(left.seen_by(0)) & {
        u for u in right.seen_by(0) if seen.targets.element[seen.targets.unit_segment[u]] == 1
    }


def test_nothing_in_sight_is_an_answer() -> None:
    far = hall(6, 4, targets := column("c", 20.0, 20.0))
    assert targets.target
    with pytest.raises(StopgoError, match="no target is visible"):
        visibility(candidates(navigable(far, Settings(targets=("columns",)))))


def test_rooms_apart_do_not_see_each_other() -> None:
    floor = floor_of(
        box(0, 0, 4, 4),
        box(5, 0, 9, 4),
        rooms=(room("a", box(0, 0, 4, 4)), room("b", box(5, 0, 9, 4))),
        elements=(shell(0, 0, 4, 4, id="a"), shell(5, 0, 9, 4, id="b")),
        openings=(door("d", (0, 1), (0, 2)),),
    )
    seen = at(floor, np.array([(2.0, 2.0)]))
    assert set(seen.targets.element[seen.targets.unit_segment[seen.seen_by(0)]]) == {0}


def test_a_scanner_in_a_closed_doorway_sees_both_rooms() -> None:
    space = navigable(two_rooms(0.9), Settings(doors="closed", door_scan=True))
    seen = visibility(candidates(space))
    (doorway,) = seen.candidates.doorway_rows
    x = seen.targets.unit_xy[seen.seen_by(int(doorway)), 0]
    assert np.count_nonzero(x < 3.9) == pytest.approx(np.count_nonzero(x > 4.1), abs=4)
    assert np.count_nonzero(x < 3.9) > 50
    beside = next(row for row in range(seen.rows) if row != doorway)
    sides = seen.targets.unit_xy[seen.seen_by(beside), 0] > 4.0
    assert sides.all() or not sides.any()


def test_a_scanner_in_a_doorway_looks_from_both_sides_of_the_nearest_door() -> None:
    rooms = (room("a", box(0, 0, 4, 4)), room("b", box(4.2, 0, 9, 4)))
    doors = (door("d", (4.1, 1.0), (4.1, 2.0)), door("e", (4.1, 2.6), (4.1, 3.6)))
    floor = floor_of(box(0, 0, 9, 4), rooms=rooms, elements=(shell(0, 0, 9, 4, id="w"),), openings=doors)
    space = navigable(floor, Settings(doors="closed"))
    points = np.array([(4.1, 1.5), (4.1, 3.1), (4.1, 2.3)])  # the last one is as near to both
    sides = sides_of_doors(space, points)
    across = np.array([(DOOR_OFFSET, 0.0)])
    assert np.allclose(np.sort(sides, axis=1), np.stack([points - across, points + across], axis=1))
    assert np.array_equal(sides, np.concatenate([sides_of_doors(space, point[None]) for point in points]))
