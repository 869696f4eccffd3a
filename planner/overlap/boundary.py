"""Candidates -> what each sees of everything that two scans can be laid on one another by.

That is every upright face that stops the laser, target or not. Limits on how well a target must be seen do
not count here; beams do not either, since how high they hang decides what of them two scans share.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mission.geometry import FloatArray, IntArray, frozen
from mission.planning import Candidates, NavigableSpace
from planner.shapes import GRID, local_origin, to_grid, whole_steps_of
from planner.sight.sight import scene_of, sight
from planner.space.targets import face_segments, units_on
from planner.visibility.exact_sight import open_space, viewpoints_of
from planner.visibility.headings import in_view
from planner.visibility.runs import ranges, runs_of

PIECE_M = 0.05
"""Boundary is seen by pieces of this length (m), whatever the plan's units are."""


@dataclass(frozen=True, eq=False)
class Boundary:
    """Straight faces that scans show, local metres; each is seen from its left side only."""

    a: FloatArray
    """Start of each face (m, 2)."""
    b: FloatArray
    pieces: IntArray
    """Equal pieces of each face (m,)."""


@dataclass(frozen=True, eq=False)
class Shown:
    """What each candidate sees of a boundary, as stretches of faces.

    Stretch k of candidate row c, `pointer[c] <= k < pointer[c + 1]`, is of face `face[k]` and reaches from
    `begin[k]` to `end[k]` metres from the face's start. A row's stretches ascend and do not overlap.
    """

    boundary: Boundary
    pointer: IntArray
    face: IntArray
    begin: FloatArray
    end: FloatArray
    xy: FloatArray
    """Where each row stands, local metres (rows, 2)."""


def boundary_of(space: NavigableSpace) -> Boundary:
    """All faces of what stops the laser."""
    ends = np.rint(face_segments(whole_steps_of(space.occluders, local_origin(space.floor)))) * GRID
    pieces = units_on(np.hypot(*(ends[:, 1] - ends[:, 0]).T), d_dis=PIECE_M)
    return Boundary(frozen(ends[:, 0]), frozen(ends[:, 1]), frozen(pieces, np.int64))


def shown(candidates: Candidates) -> Shown:
    """What the kept candidates see of the boundary within `overlap_range` and the scanner's field of view."""
    space = candidates.space
    origin = local_origin(space.floor)
    boundary = boundary_of(space)
    places, row = viewpoints_of(candidates)
    faces = np.ones(len(boundary.a), dtype=bool)
    scene = scene_of(open_space(candidates), boundary.a, boundary.b, boundary.pieces, faces)
    runs = sight(scene, to_grid(places - origin), reach=space.settings.overlap_range)
    at = np.repeat(row, np.diff(runs.pointer))
    start = (np.cumsum(boundary.pieces) - boundary.pieces)[runs.segment]
    seen = _in_rows(candidates, boundary, at, start + runs.low, start + runs.high)
    return _shown(boundary, candidates.xy[candidates.kept] - origin, seen)


def _in_rows(
    candidates: Candidates, boundary: Boundary, row: IntArray, first: IntArray, last: IntArray
) -> Iterator[tuple[IntArray, IntArray, IntArray]]:
    """Face, first and last piece of each row's stretches: its views joined, and cut to where it looks."""
    face = np.repeat(np.arange(len(boundary.pieces)), boundary.pieces)
    middle = _middles(boundary, face) if candidates.space.settings.fov < 360 else None
    bounds = np.searchsorted(row, np.arange(len(candidates.kept) + 1))
    fov = math.radians(candidates.space.settings.fov)
    for k in range(len(candidates.kept)):
        own = slice(bounds[k], bounds[k + 1])
        pieces = np.unique(ranges(first[own], last[own] - first[own] + 1))
        if middle is not None and len(candidates.heading):
            index = candidates.kept[k]
            way = middle[pieces] - (candidates.xy[index] - local_origin(candidates.space.floor))
            pieces = pieces[in_view(way, float(candidates.heading[index]), fov=fov)]
        begin, end = runs_of(pieces, face)
        yield face[begin], begin, end


def _middles(boundary: Boundary, face: IntArray) -> FloatArray:
    """Midpoint of every piece (n, 2)."""
    number = np.arange(len(face)) - (np.cumsum(boundary.pieces) - boundary.pieces)[face]
    t = ((number + 0.5) / boundary.pieces[face])[:, None]
    return boundary.a[face] + t * (boundary.b[face] - boundary.a[face])


def _shown(boundary: Boundary, xy: FloatArray, seen: Iterator[tuple[IntArray, IntArray, IntArray]]) -> Shown:
    rows = list(seen)
    empty = np.empty(0, np.int64)
    face, first, last = (np.concatenate([empty, *(row[k] for row in rows)]) for k in range(3))
    start = (np.cumsum(boundary.pieces) - boundary.pieces)[face]
    piece = np.hypot(*(boundary.b[face] - boundary.a[face]).T) / boundary.pieces[face]
    return Shown(
        boundary=boundary,
        pointer=frozen(np.cumsum([0, *(len(row[0]) for row in rows)]), np.int64),
        face=frozen(face, np.int64),
        begin=frozen((first - start) * piece),
        end=frozen((last + 1 - start) * piece),
        xy=frozen(xy),
    )
