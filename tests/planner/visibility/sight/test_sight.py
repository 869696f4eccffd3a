"""The kernel of visibility against brute force, on floors made to be awkward."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely

from stopgo.planner.geometry.shapes import (
    GRID,
    face_segments,
    polygon_parts,
    snapped_union,
    to_grid,
    whole_steps,
)
from stopgo.planner.space.targets import units_on
from stopgo.planner.visibility.sight.mesh import containing, mesh_of
from stopgo.planner.visibility.sight.sight import Runs, Scene, scene_of, sight
from stopgo.planner.visibility.sight.sightlines import Midpoints
from tests.faults.sizes import size
from tests.planner.kernels import interpret
from tests.planner.oracle import visible_pairs


def matrix(runs: Runs, units: np.ndarray) -> np.ndarray:
    """True where a viewpoint sees a unit."""
    first = np.concatenate([[0], np.cumsum(units)])
    seen = np.zeros((len(runs.pointer) - 1, int(first[-1])), dtype=bool)
    for row in range(len(seen)):
        for k in range(runs.pointer[row], runs.pointer[row + 1]):
            begin = first[runs.segment[k]]
            seen[row, begin + runs.low[k] : begin + runs.high[k] + 1] = True
    return seen


class World:
    """Occluders in a frame, 21 × 21 m unless given, their faces and some free segments as targets."""

    def __init__(
        self,
        shapes,
        free: np.ndarray,
        viewpoints: np.ndarray,
        *,
        d_dis: float = 0.25,
        frame: tuple[float, ...] = (-5, -5, 16, 16),
    ) -> None:
        self.occluders = snapped_union(shapes)
        self.open = shapely.difference(whole_steps(shapely.box(*frame)), whole_steps(self.occluders))
        self.faces = face_segments(self.occluders)
        segments = np.concatenate([self.faces, free.reshape(-1, 2, 2)])
        self.a, self.b = segments[:, 0], segments[:, 1]
        self.units = units_on(np.hypot(*(self.b - self.a).T), d_dis=d_dis)
        self.is_face = np.arange(len(segments)) < len(self.faces)
        self.stand_at(viewpoints)

    def stand_at(self, viewpoints: np.ndarray) -> None:
        """Look from these points, except for those within occluders."""
        inside = shapely.contains_properly(self.occluders, shapely.points(viewpoints))
        self.viewpoints = to_grid(viewpoints[~inside])

    def ways(self) -> np.ndarray:
        """From each viewpoint to each unit's midpoint, times its pieces (viewpoints, units, 2)."""
        mid = Midpoints.of(to_grid(self.a), to_grid(self.b), self.units, self.is_face)
        at = (mid.pieces - mid.odd)[:, None] * mid.a + mid.odd[:, None] * mid.b
        return at - mid.pieces[:, None] * self.viewpoints[:, None]

    def scene(self) -> Scene:
        return scene_of(mesh_of(self.open), self.a, self.b, self.units, self.is_face)

    def by_kernel(self, reach: float | None) -> np.ndarray:
        return matrix(sight(self.scene(), self.viewpoints, reach=reach), self.units)

    def by_force(self, reach: float | None) -> np.ndarray:
        edges = to_grid(self.faces)
        steps = None if reach is None else round(reach / GRID)
        seen = visible_pairs(
            self.viewpoints, edges, to_grid(self.a), to_grid(self.b), self.units, self.is_face, reach=steps
        )
        return seen

    def comparable(self) -> np.ndarray:
        """Brute force knows only outlines: from a point on one, it looks into the solid at free units."""
        on_outline = shapely.distance(self.occluders, shapely.points(self.viewpoints * GRID)) < GRID / 2
        return ~on_outline[:, None] | np.repeat(self.is_face, self.units)


def lattice_world(seed: int) -> World:
    """Boxes, triangles and diamonds with corners on a half-metre lattice, seen from lattice points."""
    random = np.random.default_rng(seed)

    def lattice(*size: int) -> np.ndarray:
        return random.integers(0, 21, size=size) / 2

    shapes = []
    for _ in range(int(random.integers(1, 14))):
        x, y = lattice(2)
        w, h = random.integers(1, 7, size=2) / 2
        kind = int(random.integers(3))
        if kind == 0:
            shapes.append(shapely.box(x, y, x + w, y + h))
        elif kind == 1:
            shapes.append(shapely.Polygon([(x, y), (x + w, y), (x, y + h)]))
        else:
            shapes.append(shapely.Polygon([(x + w, y), (x, y + w), (x - w, y), (x, y - w)]))
    free = lattice(int(random.integers(0, 4)), 2, 2)
    free = free[np.any(free[:, 0] != free[:, 1], axis=1)]
    return World(shapes, free, lattice(25, 2))


@pytest.mark.parametrize("reach", [None, 2.5, 5.0])
def test_the_kernel_agrees_with_brute_force_on_lattice_floors(reach: float | None) -> None:
    for seed in range(size(short=30, full=80)):
        world = lattice_world(seed)
        wrong = (world.by_kernel(reach) != world.by_force(reach)) & world.comparable()
        assert not wrong.any(), f"seed {seed}: {np.argwhere(wrong)[:3].tolist()} (viewpoint, unit)"


def test_compiled_and_interpreted_kernels_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    for seed in range(20):
        world = lattice_world(1000 + seed)
        compiled = sight(world.scene(), world.viewpoints, reach=2.5)
        with monkeypatch.context() as patch:
            interpret(patch)
            interpreted = sight(world.scene(), world.viewpoints, reach=2.5)
        for name in ("pointer", "segment", "low", "high"):
            assert np.array_equal(getattr(interpreted, name), getattr(compiled, name)), (seed, name)


def point_sight(world: World, reach: float | None) -> np.ndarray:
    """True where a viewpoint sees another, as a target of no length."""
    points = world.viewpoints * GRID
    ones = np.ones(len(points), dtype=np.int64)
    scene = scene_of(mesh_of(world.open), points, points, ones, np.zeros(len(points), dtype=bool))
    return matrix(sight(scene, world.viewpoints, reach=reach), ones)


@pytest.mark.parametrize("reach", [None, 3.0])
def test_sight_between_free_points_is_symmetric(reach: float | None) -> None:
    for seed in range(size(short=15, full=40)):
        world = lattice_world(2000 + seed)
        seen = point_sight(world, reach)
        assert np.array_equal(seen, seen.T), seed
        assert seen.diagonal().all()


@pytest.mark.parametrize("speed", ["compiled", "interpreted"])
def test_a_limited_look_sees_what_lies_between_its_limits(
    speed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Points on a limit may need a ray rotated beyond it, so only points between are certain."""
    if speed == "interpreted":
        interpret(monkeypatch)
    for seed in range(20):
        world = lattice_world(6000 + seed)
        random = np.random.default_rng(seed)
        way = random.integers(-8, 9, (len(world.viewpoints), 2, 2)) * 10_000
        way[turn_to(way[:, 0], way[:, 1]) <= 0] = 0
        between = world.viewpoints[:, None] + way
        found = sight(world.scene(), world.viewpoints, reach=4.0, between=between)
        limited, whole = matrix(found, world.units), world.by_kernel(4.0)
        right, left = (turn_to(way[:, k, None], world.ways()) * (1 - 2 * k) for k in range(2))
        everywhere = ~way.any(axis=(1, 2))[:, None]
        assert not (limited & ~whole).any()
        assert not (limited & ~everywhere & ((right < 0) | (left < 0))).any()
        assert not (whole & ~limited & (everywhere | ((right > 0) & (left > 0)))).any()


def turn_to(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Above 0 where the other way leads to the left of the one."""
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]


def test_more_range_never_sees_less() -> None:
    for seed in range(20):
        world = lattice_world(3000 + seed)
        reaches = [0.5, 1.0, 2.0, 3.5, 7.0, None]
        seen = [world.by_kernel(reach) for reach in reaches]
        for less, more in pairwise(seen):
            assert not (less & ~more).any()


def test_range_ends_exactly_at_the_unit_midpoint() -> None:
    # The wall's face at x = 3, seen from (0, 5): the unit's midpoint is 3 m away, to the grid step.
    face = World([shapely.box(3, 4.75, 4, 5.25)], np.empty((0, 2, 2)), np.array([[0.0, 5.0]]), d_dis=0.5)
    assert face.by_kernel(3.0).sum() == 1
    assert face.by_kernel(3.0 - GRID).sum() == 0


def test_nothing_is_seen_through_a_gap_of_no_width() -> None:
    touching = [shapely.box(3, 0, 4, 5), shapely.box(4, 5, 5, 10), shapely.box(7, 4, 8, 6)]
    world = World(touching, np.empty((0, 2, 2)), np.array([[1.0, 8.0], [2.0, 7.0], [1.0, 9.0]]))
    right = world.a[:, 0].min() < world.a[:, 0]
    behind = np.repeat((world.a[:, 0] >= 7) & right, world.units)
    assert not world.by_kernel(None)[:, behind].any()


def test_a_face_is_not_seen_edge_on_nor_from_behind() -> None:
    world = World([shapely.box(4, 4, 6, 6)], np.empty((0, 2, 2)), np.array([[2.0, 4.0]]))
    seen = world.by_kernel(None)[0]
    facing = np.repeat((world.a[:, 0] == 4) & (world.b[:, 0] == 4), world.units)
    assert np.array_equal(seen, facing)


def test_a_ray_past_two_corners_on_opposite_sides_is_blocked() -> None:
    # Corners at (2, 5) from below and (4, 5) from above: the ray y = 5 touches both, no turned ray passes.
    blocks = [shapely.box(1, 1, 2, 5), shapely.box(3, 5, 4, 9)]
    free = np.array([[[6.0, 5.0], [6.0, 5.0]]])
    world = World(blocks, free, np.array([[0.0, 5.0]]))
    assert not world.by_kernel(None)[0, -1]
    same_side = World([shapely.box(1, 1, 2, 5), shapely.box(3, 1, 4, 5)], free, np.array([[0.0, 5.0]]))
    assert same_side.by_kernel(None)[0, -1]


def test_every_free_point_lies_in_some_triangle() -> None:
    for seed in range(20):
        world = lattice_world(4000 + seed)
        point, _ = containing(mesh_of(world.open), world.viewpoints)
        assert set(point.tolist()) == set(range(len(world.viewpoints)))


def test_a_mesh_covers_its_region_once() -> None:
    for seed in range(20):
        world = lattice_world(5000 + seed)
        mesh = mesh_of(world.open)
        xy = mesh.vertices[mesh.corners]
        u, v = xy[:, 1] - xy[:, 0], xy[:, 2] - xy[:, 0]
        assert np.all(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0] > 0)
        assert shapely.polygons(xy).shape == (mesh.triangles,)
        total = sum(part.area for part in polygon_parts(world.open))
        assert shapely.area(shapely.polygons(xy)).sum() == total
