"""A layered DXF turned, mirrored and shifted, and what must not change by that."""

from __future__ import annotations

import math
import random
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import ezdxf
import numpy as np
import shapely
from ezdxf.math import Matrix44

from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import KEPT, Candidates, NavigableSpace
from stopgo.planner.candidates import candidates
from stopgo.planner.floors.dxf import floor_in
from stopgo.planner.geometry.shapes import GRID, local_origin, to_grid, to_shape
from stopgo.planner.space.connected_parts import parts_of
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility.exact_sight import open_space
from stopgo.planner.visibility.sight.sight import Scene, scene_of, sight

POSITIONS = 24
"""Scan positions that look on every floor."""
ASIDE = 0.05
"""They stand at most this far, in metres, beside candidates, along either axis."""
ALIKE = 1e-3
"""Lengths and areas may differ by this share."""


@dataclass(frozen=True)
class Place:
    """Placement of a drawing: mirrored, then rotated by degrees, then shifted by metres."""

    degrees: float = 0.0
    mirrored: bool = False
    shift: tuple[float, float] = (0.0, 0.0)

    @property
    def matrix(self) -> Matrix44:
        mirror = Matrix44.scale(-1.0 if self.mirrored else 1.0, 1.0, 1.0)
        return mirror @ Matrix44.z_rotate(math.radians(self.degrees)) @ Matrix44.translate(*self.shift, 0.0)

    def moved(self, xy: FloatArray) -> FloatArray:
        """Points (n, 2) of the drawing, where they are put."""
        points = self.matrix.transform_vertices([(x, y, 0.0) for x, y in xy])
        return np.array([(point.x, point.y) for point in points]).reshape(-1, 2)

    def moved_back(self, xy: FloatArray) -> FloatArray:
        """Points (n, 2) where they were drawn."""
        matrix = self.matrix
        matrix.inverse()
        points = matrix.transform_vertices([(x, y, 0.0) for x, y in xy])
        return np.array([(point.x, point.y) for point in points]).reshape(-1, 2)


def places(count: int, *, seed: int) -> list[Place]:
    """As many angles all round, none of them even, each with a shift up to a surveyor's coordinates."""
    rng = random.Random(seed)
    reaches = ((0.0, 0.0), (1.0, 1.0), (100.0, 100.0), (500_000.0, 5_000_000.0))
    found = []
    for k in range(count):
        x, y = rng.choice(reaches)
        degrees = 360.0 * (k + rng.random()) / count
        found.append(Place(degrees, rng.random() < 0.5, (rng.uniform(-x, x), rng.uniform(-y, y))))
    return found


@dataclass(frozen=True)
class Figures:
    """Figures that do not depend on the drawing's position and angle."""

    passable: tuple[bool, ...]
    """By opening, in the order of where they were drawn."""
    rooms: int
    parts: int
    room_area: float
    free_area: float
    visible_length: float
    lost: int
    """Units that nobody can see from anywhere, though nothing covers them."""

    def unlike(self, other: Figures) -> list[str]:
        """Names and values of what differs from the floor as it was drawn."""
        counts = [name for name in ("passable", "rooms", "parts") if self._of(name) != other._of(name)]
        sizes = [
            name
            for name in ("room_area", "free_area", "visible_length")
            if abs(self._of(name) - other._of(name)) > ALIKE * other._of(name)
        ]
        return [f"{name} {self._of(name)}, not {other._of(name)}" for name in (*counts, *sizes)]

    def _of(self, name: str) -> float:
        return getattr(self, name)


class MovableDrawing:
    """A drawing as one block, which is read wherever it is put."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._drawing = ezdxf.readfile(path)
        model = self._drawing.modelspace()
        block = self._drawing.blocks.new("DRAWN")
        for entity in list(model):
            model.move_to_layout(entity, block)
        self._insert = model.add_blockref("DRAWN", (0, 0))

    def floor(self, place: Place) -> FloorPlan:
        """Floor that the reader gives at this placement; a drawing itself is read once."""
        self._insert.dxf.insert = (*place.shift, 0.0)
        self._insert.dxf.rotation = place.degrees
        self._insert.dxf.xscale = -1.0 if place.mirrored else 1.0
        return floor_in(copy(self._drawing), source=self._path, digest="0" * 64, d_dis=Settings().d_dis)

    def space(self, place: Place) -> NavigableSpace:
        return navigable(self.floor(place), Settings())

    @cached_property
    def as_drawn(self) -> Figures:
        return self.figures(Place())

    @cached_property
    def positions(self) -> FloatArray:
        """Points (n, 2) near candidates of the drawing as it was drawn, from all over it.

        Candidates themselves stand in line with walls, and what is edge-on is seen or not as rounding has it.
        """
        found = candidates(self.space(Place()))
        kept = found.xy[found.kept]
        some = kept[np.linspace(0, len(kept) - 1, min(POSITIONS, len(kept))).astype(int)]
        return frozen(some + np.random.default_rng(1).uniform(-ASIDE, ASIDE, some.shape))

    def figures(self, place: Place) -> Figures:
        """Figures of the floor at this placement, seen from the same positions in it."""
        space = self.space(place)
        origin = local_origin(space.floor)
        drive_area = to_shape(space.drive_area, origin)
        looking = _looking(space, place.moved(self.positions))
        scene = _scene(looking)
        return Figures(
            passable=_passable(space, place),
            rooms=len(space.rooms),
            parts=len(parts_of(drive_area, space.gaps - origin).areas),
            room_area=sum(polygon.area for room in space.rooms for polygon in room.area),
            free_area=drive_area.area,
            visible_length=_length(space, _seen(looking, scene)),
            lost=int(np.count_nonzero(~_held(scene) & ~_covered(space))),
        )


def _looking(space: NavigableSpace, xy: FloatArray) -> Candidates:
    none = np.zeros(len(xy), dtype=np.int64)
    return Candidates(space, xy=frozen(xy), room=none, reason=none + KEPT, part=none, strategy="given")


def _passable(space: NavigableSpace, place: Place) -> tuple[bool, ...]:
    middles = np.array([item.opening.line.mean(axis=0) for item in space.openings]).reshape(-1, 2)
    order = np.lexsort(np.round(place.moved_back(middles), 3).T)
    return tuple(space.openings[k].passable for k in order)


def _scene(looking: Candidates) -> Scene:
    targets, origin = looking.space.targets, local_origin(looking.space.floor)
    return scene_of(
        open_space(looking), targets.a - origin, targets.b - origin, targets.units, targets.occluding
    )


def _seen(looking: Candidates, scene: Scene) -> BoolArray:
    """True for each unit that any position sees."""
    local = looking.xy - local_origin(looking.space.floor)
    runs = sight(scene, to_grid(local), reach=looking.space.settings.range)
    return _units(scene, runs.segment, runs.low, runs.high)


def _held(scene: Scene) -> BoolArray:
    """True for each unit on an edge of the mesh or in one of its triangles."""
    faces = np.unique(scene.face[scene.face >= 0])
    on_edge = _units(scene, faces, np.zeros_like(faces), scene.units[faces] - 1)
    return on_edge | _units(scene, scene.bucket_segment, scene.bucket_low, scene.bucket_high)


def _units(scene: Scene, segment: FloatArray, low: FloatArray, high: FloatArray) -> BoolArray:
    """Units low to high of each segment, as flags over all units."""
    found = np.zeros(int(scene.units.sum()) + 1, dtype=np.int64)
    first = np.concatenate([[0], np.cumsum(scene.units)])[segment]
    np.add.at(found, first + low, 1)
    np.add.at(found, first + high + 1, -1)
    return np.cumsum(found)[:-1] > 0


def _covered(space: NavigableSpace) -> BoolArray:
    """True for each unit that does not occlude and lies within an occluder."""
    targets, origin = space.targets, local_origin(space.floor)
    covered = ~targets.occluding[targets.unit_segment]
    occluders = to_shape(space.occluders, origin)
    shapely.prepare(occluders)
    points = shapely.points(targets.unit_xy[covered] - origin)
    covered[covered] = shapely.dwithin(occluders, points, 2 * GRID)
    return covered


def _length(space: NavigableSpace, units: BoolArray) -> float:
    """Length in metres of some units."""
    targets = space.targets
    unit = np.hypot(*(targets.b - targets.a).T) / targets.units
    return float(unit[targets.unit_segment][units].sum())
