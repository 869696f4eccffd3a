"""Every face of the drawing can be seen: none is lost between the drawing and the mesh."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import shapely

from stopgo.mission.errors import StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.planner.geometry.shapes import (
    GRID,
    local_origin,
    polygon_parts,
    segments_of,
    snapped,
    snapped_union,
    whole_steps,
)
from stopgo.planner.space.targets import occluders_of, without_cracks
from stopgo.planner.visibility.exact_sight import open_space
from stopgo.planner.visibility.sight.mesh import mesh_of
from stopgo.planner.visibility.sight.sight import scene_of
from tests.faults.sizes import some
from tests.planner.visibility.test_visibility import at, by_force, rows_of
from tests.planner.worlds import LAYERED, PAPER, box, floor_of, moved, shared, turned, wall

NOBODY = np.empty((0, 2, 2))


TEETH = (
    ([(0, 0), (1806, 506), (1856, 106), (50, -400)], [(847, 237), (936, 263), (766, 526)]),
    ([(0, 0), (648, 315), (698, -85), (50, -400)], [(394, 191), (438, 214), (263, 461)]),
    ([(0, 0), (295, 171), (345, -229), (50, -400)], [(154, 89), (203, 118), (233, 136), (52, 377)]),
)
"""Two solids each, in grid steps: where they meet, rounding once moves a line onto a corner beside it."""


@pytest.mark.parametrize("solids", TEETH)
def test_no_line_comes_within_half_a_step_of_another_corner(solids) -> None:
    union = whole_steps(snapped_union([shapely.Polygon(np.array(corners) * GRID) for corners in solids]))
    for (a, b), corner in itertools.product(segments_of(union), shapely.get_coordinates(union)):
        if not (np.array_equal(a, corner) or np.array_equal(b, corner)):
            assert shapely.LineString([a, b]).distance(shapely.Point(corner)) >= 0.5


def awkward(seed: int) -> FloorPlan:
    """Solids on a lattice, many of them touching, some a few grid steps off, and all of it turned."""
    random = np.random.default_rng(seed)
    solids = [_awkward_solid(random) for _ in range(int(random.integers(3, 14)))]
    floor = floor_of(box(-1, -1, 12, 12), elements=[wall(f"w{k}", solid) for k, solid in enumerate(solids)])
    return moved(floor, turned(float(random.uniform(0, 360)) * int(random.integers(0, 3) > 0)))


def _awkward_solid(random: np.random.Generator) -> Polygon:
    (x, y), (w, h) = random.integers(0, 12, 2) / 2, random.integers(1, 8, 2) / 2
    angles = np.arange(0, math.tau, math.pi / random.integers(3, 40))
    kinds = [
        [(x, y), (x + w, y), (x + w, y + h), (x, y + h)],
        [(x, y), (x + w, y), (x, y + h)],
        [(x, y), (x + w, y + 0.2), (x + w, y + 0.4), (x, y + 0.2)],
        np.c_[x + 0.7 * np.cos(angles), y + 0.7 * np.sin(angles)],
    ]
    corners = np.array(kinds[int(random.integers(4))])
    off = random.integers(-3, 4, (1 if random.integers(2) else len(corners), 2))
    return Polygon.of(corners + int(random.integers(2)) * GRID * off)


@pytest.mark.parametrize("seed", some(range(40), every=2))
def test_every_face_of_an_awkward_floor_is_seen_as_line_by_line(seed: int) -> None:
    floor = awkward(seed)
    places = np.random.default_rng(seed).uniform(-1, 12, (6, 2))
    places = places[~shapely.dwithin(occluders_of(floor, NOBODY), shapely.points(places), 1e-3)]
    seen = at(floor, places)
    rows = range(seen.rows)
    assert np.array_equal(rows_of(seen, rows), by_force(seen.candidates, rows, 5.0))


@pytest.mark.parametrize("seed", range(20))
def test_snapping_again_changes_nothing(seed: int) -> None:
    shapes = [shapely.Polygon(item.solids[0].exterior) for item in awkward(seed).elements]
    for once in (snapped_union(shapes), snapped(shapes[0])):
        assert shapely.equals_exact(snapped(once), once)


DEGREES = (33.3, 70.2, 140.1)
TURNED = [(name, DEGREES[(k + n) % 3]) for k, name in enumerate((*PAPER, *LAYERED)) for n in range(3)]


@pytest.mark.parametrize(("name", "degrees"), some(TURNED, every=8))
def test_each_face_of_a_turned_floor_is_one_edge_of_open_space(name: str, degrees: float) -> None:
    floor = moved(shared(name), turned(degrees))
    seen = at(floor, floor.outline[0].exterior[:1])
    targets, origin = seen.targets, local_origin(floor)
    mesh = open_space(seen.candidates)
    scene = scene_of(mesh, targets.a - origin, targets.b - origin, targets.units, targets.occluding)
    faces = scene.face[scene.face >= 0]
    assert np.array_equal(np.sort(faces), np.flatnonzero(targets.occluding))


def test_a_curved_wall_drawn_in_fine_steps_stays_curved() -> None:
    """Each of its vertices lies within a step of the line between its neighbours."""
    angles = np.linspace(-math.pi / 2, math.pi / 2, 2000)
    arc = np.c_[5 + 0.5 * np.cos(angles), 2 + 0.5 * np.sin(angles)]
    apse = wall("apse", Polygon.of([(5, 2.5), (1, 2.5), (1, 1.5), (3, 1.7), *arc.tolist()]))
    occluders = occluders_of(floor_of(box(0, 0, 8, 4), elements=(apse,)), NOBODY)
    assert occluders.area == pytest.approx(apse.solids[0].area, abs=1e-4)
    assert occluders.symmetric_difference(shapely.Polygon(apse.solids[0].exterior)).area < 1e-4


def test_a_hairline_between_two_walls_is_closed_at_its_whole_length() -> None:
    one = shapely.box(0, 0, 4, 1)
    wedge = shapely.Polygon([(0, 1), (4, 1 + 9e-5), (4, 2), (0, 2)])
    closed = without_cracks(snapped_union([one, wedge]))
    (part,) = polygon_parts(closed)
    assert part.area == pytest.approx(8, abs=1e-6)
    assert len(part.interiors) == 0


def test_a_face_in_no_open_space_is_reported_with_its_place() -> None:
    mesh = mesh_of(whole_steps(shapely.box(0, 0, 4, 4)))
    a, b = np.array([[1.0, 2.0]]), np.array([[3.0, 2.0]])
    with pytest.raises(StopgoError, match=r"face \(1\.00000, 2\.00000\) to \(3\.00000, 2\.00000\) m from"):
        scene_of(mesh, a, b, np.array([40]), np.array([True]))


def test_open_space_that_is_none_is_reported_with_its_place() -> None:
    bow_tie = shapely.Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
    with pytest.raises(StopgoError, match=r"Self-intersection\[2 2\]"):
        mesh_of(bow_tie)
