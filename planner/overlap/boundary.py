"""Candidates -> the boundary that each sees: all surfaces by which two scans can be registered.

The boundary is every upright face that stops the laser, target or not. Limits on the views of targets do
not apply here. Beams do not count, because their height decides which parts of them two scans share.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, NavigableSpace
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import (
    GRID,
    face_segments,
    local_origin,
    to_grid,
    whole_steps,
    whole_steps_of,
)
from stopgo.planner.geometry.side_work import in_halves
from stopgo.planner.overlap.surfaces import smooth_surfaces
from stopgo.planner.space.targets import units_on, without_needless_vertices
from stopgo.planner.visibility.exact_sight import open_space_around, viewpoints_of
from stopgo.planner.visibility.headings import in_view
from stopgo.planner.visibility.sight.mesh import Mesh
from stopgo.planner.visibility.sight.sight import Scene, scene_of, sight
from stopgo.planner.visibility.unit_ranges import runs_of

PIECE_M = 0.05
"""Length in metres of the boundary's pieces, independent of the plan's units."""
USUAL_STEP_DEG = 0.1
"""Angle between neighbouring rays of a scanner that is not given."""
MOST_SPACING_M = 0.15
"""Largest spacing of points with which a surface has a direction: two cells of a thinned cloud."""
MOST_INCIDENCE_DEG = 85.0
"""Flattest angle from the surface normal at which a scanner measures a surface."""
EDGE_M = 0.14
"""Metres at each end of a common stretch that do not count. A point's direction comes from 15 neighbours,
thinned to one per 7.5 cm: nearer to an edge they are of two surfaces."""
LEAST_STRETCH_M = 2 * EDGE_M
"""Least width of a common stretch. Narrower ones, such as door jambs, have no direction of their own."""
WIDER_M = LEAST_STRETCH_M - 1e-9
"""The same less rounding: a stretch that counts is wider."""
JOINED_M = 1e-6
"""Widest gap between stretches of one surface that are one."""
BLOCK = 4096
"""Most candidates whose boundary is found at a time, which takes several times the memory of the result."""
MANY = 5000
"""Candidates from which on another process finds the boundary that half of them see."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Straight faces that scans show, local metres; each is seen from its left side only.

    Faces that continue each other smoothly are one surface, such as those of a round column.
    """

    a: FloatArray
    """Start of each face (m, 2)."""
    b: FloatArray
    pieces: IntArray
    """Equal pieces of each face (m,)."""
    first: IntArray
    """First face of each surface (surfaces,); those of a surface follow each other."""
    closed: BoolArray
    """True for surfaces that go around a solid or a room (surfaces,)."""

    @cached_property
    def normals(self) -> tuple[FloatArray, FloatArray]:
        """Unit normal of each face (m, 2), and the lever arm of its start about the origin (m,).

        The arm of the point s metres from a face's start is longer by s.
        """
        along = (self.b - self.a) / np.hypot(*(self.b - self.a).T)[:, None]
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1)
        return normal, self.a[:, 0] * normal[:, 1] - self.a[:, 1] * normal[:, 0]

    @cached_property
    def surface(self) -> IntArray:
        """Surface of each face (m,)."""
        return np.repeat(np.arange(len(self.first)), np.diff(np.append(self.first, len(self.a))))

    @cached_property
    def along(self) -> FloatArray:
        """Metres from the start of its surface to each face (m,)."""
        sums = np.concatenate([[0.0], np.cumsum(self.length)])[:-1]
        return sums - sums[self.first][self.surface]

    @cached_property
    def length(self) -> FloatArray:
        """Metres of each face (m,)."""
        return np.hypot(*(self.b - self.a).T)

    @cached_property
    def around(self) -> FloatArray:
        """Metres around each closed surface, such as a round column; 0 for the others (surfaces,)."""
        return np.where(self.closed, self.reach, 0.0)

    @cached_property
    def reach(self) -> FloatArray:
        """Metres of each surface (surfaces,)."""
        last = np.append(self.first[1:], len(self.a))[: len(self.first)] - 1
        return self.along[last] + self.length[last]


@dataclass(frozen=True, eq=False)
class ShownBoundary:
    """The boundary that each candidate sees, as stretches of surfaces, wide enough to have a direction.

    Stretch k of candidate row c, `pointer[c] <= k < pointer[c + 1]`, is of surface `surface[k]` and reaches
    from `begin[k]` to `end[k]` metres from the surface's start. A row's stretches ascend and do not overlap.
    On a closed surface a stretch may go on beyond the surface's start, to less than twice the way around.
    """

    boundary: Boundary
    pointer: IntArray
    surface: IntArray
    begin: FloatArray
    end: FloatArray
    xy: FloatArray
    """Position of each row, local metres (rows, 2)."""
    metres: FloatArray
    """Boundary that each row sees, also on narrower stretches (rows,)."""


def boundary_of(space: NavigableSpace) -> Boundary:
    """All faces of what stops the laser."""
    ends = np.rint(face_segments(solids_of(space))) * GRID
    pieces = units_on(np.hypot(*(ends[:, 1] - ends[:, 0]).T), d_dis=PIECE_M)
    order, first, closed = smooth_surfaces(ends)
    a, b = frozen(ends[order, 0]), frozen(ends[order, 1])
    whole = (frozen(pieces[order], np.int64), frozen(first, np.int64))
    return Boundary(a, b, *whole, frozen(closed, np.bool_))


@instance_cached
def solids_of(space: NavigableSpace) -> BaseGeometry:
    """Solids that stop the laser, in whole grid steps, with one face for each straight side.

    Targets have a face for each element, and vertices where other elements touch them. Which element owns
    a face may depend on the order of the drawing, and the pieces of these faces must not.
    """
    solids = whole_steps_of(space.occluders, local_origin(space.floor))
    local = shapely.transform(solids, lambda steps: steps * GRID)
    return whole_steps(without_needless_vertices(local))


@instance_cached
def mesh_around(candidates: Candidates) -> Mesh:
    """A mesh of the open space around the solids."""
    return open_space_around(candidates, solids_of(candidates.space))


def shown(candidates: Candidates, rows: IntArray, *, only_wide: bool = False) -> ShownBoundary:
    """The boundary that some rows see within `overlap_range` and the scanner's field of view.

    `rows` (n,) are indices into `kept`; the result is in their order. With `only_wide` the metres that a row
    sees are those of surfaces on which a stretch can count: thin columns have others.
    """
    boundary = boundary_of(candidates.space)
    wide = boundary.reach[boundary.surface] > WIDER_M
    faces = np.flatnonzero(wide) if only_wide else np.arange(len(wide))
    ends, on_boundary = (boundary.a[faces], boundary.b[faces]), np.ones(len(faces), dtype=bool)
    scene = scene_of(mesh_around(candidates), *ends, boundary.pieces[faces], on_boundary)
    blocks = np.array_split(rows, 2 * -(-len(rows) // (2 * BLOCK)) or 1)

    def shown_from(some: Sequence[IntArray]) -> list[ShownBoundary]:
        return [_shown_from(candidates, block, boundary, scene, faces) for block in some]

    return _together(in_halves(shown_from, blocks, forked=len(rows) >= MANY))


def _together(parts: Sequence[ShownBoundary]) -> ShownBoundary:
    """The boundary that the rows of all parts see, one part after the other."""
    counts = np.concatenate([np.diff(part.pointer) for part in parts])
    return ShownBoundary(
        boundary=parts[0].boundary,
        pointer=frozen(np.concatenate([[0], np.cumsum(counts)]), np.int64),
        surface=frozen(np.concatenate([part.surface for part in parts]), np.int64),
        begin=frozen(np.concatenate([part.begin for part in parts])),
        end=frozen(np.concatenate([part.end for part in parts])),
        xy=frozen(np.concatenate([part.xy for part in parts])),
        metres=frozen(np.concatenate([part.metres for part in parts])),
    )


def _shown_from(
    candidates: Candidates, rows: IntArray, boundary: Boundary, scene: Scene, faces: IntArray
) -> ShownBoundary:
    """`shown` in a prepared scene of some faces."""
    space = candidates.space
    origin = local_origin(space.floor)
    places, row = _viewpoints(candidates, rows)
    runs = sight(scene, to_grid(places - origin), reach=space.settings.farthest_overlap)
    start = (np.cumsum(boundary.pieces) - boundary.pieces)[faces[runs.segment]]
    stretches = _Stretches(np.repeat(row, np.diff(runs.pointer)), start + runs.low, start + runs.high)
    taken = candidates.kept[rows]
    xy, settings = candidates.xy[taken] - origin, space.settings
    if len(candidates.heading) and settings.fov < 360:
        pieces = stretches.pieces(len(rows))
        return shown_by(boundary, xy, pieces, candidates.heading[taken], settings)
    return _shown(boundary, xy, stretches.joined(_faces(boundary)), ray_step(settings))


def _viewpoints(candidates: Candidates, rows: IntArray) -> tuple[FloatArray, IntArray]:
    """Viewpoints of these rows (n, 2), and the index among `rows` of each (n,), ascending."""
    places, of = viewpoints_of(candidates)
    first = np.searchsorted(of, rows)
    counts = np.searchsorted(of, rows, side="right") - first
    return places[ranges(first, counts)], np.repeat(np.arange(len(rows)), counts)


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Stretches of pieces that rows see, from first to last; a row's may overlap."""

    row: IntArray
    """Ascending (n,)."""
    first: IntArray
    last: IntArray

    def pieces(self, rows: int) -> Iterator[IntArray]:
        """The pieces that each row sees, ascending."""
        bounds = np.searchsorted(self.row, np.arange(rows + 1))
        for k in range(rows):
            own = slice(bounds[k], bounds[k + 1])
            yield np.unique(ranges(self.first[own], self.last[own] - self.first[own] + 1))

    def joined(self, face: IntArray) -> _Stretches:
        """The same pieces in as few stretches as possible, each of one `face` (pieces,), as all are here."""
        ahead = self.row * len(face)  # so that no piece of a row is beyond those of the next
        order = np.argsort(ahead + self.first, kind="stable")
        row, first, last, ahead = self.row[order], self.first[order], self.last[order], ahead[order]
        farthest = np.maximum.accumulate(ahead + last)
        new = np.ones(len(row), dtype=bool)
        new[1:] = (np.diff(row) != 0) | (np.diff(face[first]) != 0)
        new[1:] |= (ahead + first)[1:] > farthest[:-1] + 1
        starts = np.flatnonzero(new)
        ends = np.append(starts[1:], len(row))[: len(starts)] - 1
        return _Stretches(row[starts], first[starts], (farthest - ahead)[ends])


def shown_by(
    boundary: Boundary,
    xy: FloatArray,
    pieces: Iterable[IntArray],
    heading: FloatArray | None,
    settings: Settings,
) -> ShownBoundary:
    """The boundary shown from positions (rows, 2), local metres, that see these pieces all round.

    With a field of view below 360° only the part within it about each `heading` (rows,) is shown. What the
    scanner sees too flat or too sparsely for a surface with a direction is not shown.
    """
    face = _faces(boundary)
    if heading is not None and settings.fov < 360:
        fov, middle = math.radians(settings.fov), _middles(boundary, face)
        looks = zip(pieces, xy, heading.tolist(), strict=True)
        pieces = (own[in_view(middle[own] - at, turn, fov=fov)] for own, at, turn in looks)
    runs = [runs_of(own, face) for own in pieces]
    empty = np.empty(0, np.int64)
    first, last = (np.concatenate([empty, *(run[k] for run in runs)]) for k in range(2))
    row = np.repeat(np.arange(len(xy)), [len(run[0]) for run in runs])
    return _shown(boundary, xy, _Stretches(row, first, last), ray_step(settings))


def _faces(boundary: Boundary) -> IntArray:
    """Face of each piece."""
    return np.repeat(np.arange(len(boundary.pieces)), boundary.pieces)


def _shown(boundary: Boundary, xy: FloatArray, seen: _Stretches, step: float) -> ShownBoundary:
    """The boundary shown from positions (rows, 2) that see stretches of it, each of one face."""
    row, face = seen.row, _faces(boundary)[seen.first]
    start = (np.cumsum(boundary.pieces) - boundary.pieces)[face]
    piece = (np.hypot(*(boundary.b - boundary.a).T) / boundary.pieces)[face]
    low, high = _measured(boundary, face, xy[row], step=step)
    begin = np.maximum((seen.first - start) * piece, low)
    end = np.minimum((seen.last + 1 - start) * piece, high)
    metres = np.bincount(row, np.maximum(end - begin, 0.0), len(xy))
    row, surface, begin, end = _on_surfaces(boundary, row, face, begin, end)
    wide = end - begin > WIDER_M
    return ShownBoundary(
        boundary=boundary,
        pointer=frozen(np.searchsorted(row[wide], np.arange(len(xy) + 1)), np.int64),
        surface=frozen(surface[wide], np.int64),
        begin=frozen(begin[wide]),
        end=frozen(end[wide]),
        xy=frozen(xy),
        metres=frozen(metres),
    )


def _on_surfaces(
    boundary: Boundary, row: IntArray, face: IntArray, begin: FloatArray, end: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Row, surface, begin and end of stretches of faces (n,), joined where they meet on one surface."""
    some = np.flatnonzero(end > begin)
    row, face, begin, end = row[some], face[some], begin[some], end[some]
    surface, ahead = boundary.surface[face], boundary.along[face]
    begin, end = begin + ahead, end + ahead
    new = np.ones(len(row), dtype=bool)
    new[1:] = (np.diff(row) != 0) | (np.diff(surface) != 0) | (begin[1:] > end[:-1] + JOINED_M)
    starts = np.flatnonzero(new)
    ends = np.append(starts[1:], len(row))[: len(starts)] - 1
    return _around(boundary, row[starts], surface[starts], begin[starts], end[ends])


def _around(
    boundary: Boundary, row: IntArray, surface: IntArray, begin: FloatArray, end: FloatArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """The same stretches, those that meet at the start of a closed surface joined to one."""
    around = boundary.around[surface]
    new = np.ones(len(row) + 1, dtype=bool)
    new[1:-1] = (np.diff(row) != 0) | (np.diff(surface) != 0)
    first, last = np.flatnonzero(new[:-1]), np.flatnonzero(new[1:])
    meets = (last > first) & (begin[first] <= JOINED_M) & (around[last] > 0)
    meets &= end[last] >= around[last] - JOINED_M
    first, last = first[meets], last[meets]
    end = end.copy()
    end[last] = around[last] + end[first]
    return tuple(np.delete(values, first) for values in (row, surface, begin, end))  # type: ignore[return-value]


def ray_step(settings: Settings) -> float:
    """Radians between neighbouring rays."""
    return math.radians(settings.angular_step or USUAL_STEP_DEG)


def _measured(
    boundary: Boundary, face: IntArray, xy: FloatArray, *, step: float
) -> tuple[FloatArray, FloatArray]:
    """Stretch of each face (n,) that a scan from each position (n, 2) measures, metres from its start.

    At distance d and incidence i points are d step / cos i apart. With h the distance from the face's line,
    this is d² step / h. Both limits on it and on i thus bound the distance from the foot of h.
    """
    along_x, along_y = (column[face] for column in (boundary.b - boundary.a).T / boundary.length)
    to_x, to_y = (at - column[face] for at, column in zip(xy.T, boundary.a.T, strict=True))
    foot = to_x * along_x + to_y * along_y
    height = np.abs(along_x * to_y - along_y * to_x)
    dense = np.sqrt(np.maximum(0.0, height * (MOST_SPACING_M / step - height)))
    half = np.minimum(dense, height * math.tan(math.radians(MOST_INCIDENCE_DEG)))
    return foot - half, foot + half


def _middles(boundary: Boundary, face: IntArray) -> FloatArray:
    """Midpoint of every piece (n, 2)."""
    number = np.arange(len(face)) - (np.cumsum(boundary.pieces) - boundary.pieces)[face]
    t = ((number + 0.5) / boundary.pieces[face])[:, None]
    return boundary.a[face] + t * (boundary.b[face] - boundary.a[face])
