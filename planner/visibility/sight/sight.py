"""Lines of sight from many points at once, over a triangle mesh of open space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.planner.geometry.compiling import compiled
from stopgo.planner.geometry.shapes import GRID, to_grid
from stopgo.planner.visibility.sight.kernel import FARTHEST, MOST_UNITS, look_all, not_negative
from stopgo.planner.visibility.sight.mesh import Mesh, containing, ends_of, rim_of

ROOM = 2_000_000
"""Most runs for which the kernel has room at first."""
LARGE = 10_000_000
"""Viewpoints × mesh triangles from which on the interpreted kernel takes seconds."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Targets in a mesh: faces on its boundary, and free segments within it."""

    mesh: Mesh
    a: IntArray
    """Start of each segment in grid steps (m, 2)."""
    b: IntArray
    units: IntArray
    face: IntArray
    """Segment on each mesh edge (t, 3), or -1."""
    bucket_pointer: IntArray
    """Range of the bucket of each triangle (t + 1,)."""
    bucket_segment: IntArray
    bucket_low: IntArray
    bucket_high: IntArray


@dataclass(frozen=True, eq=False)
class Runs:
    """Visible runs of units on segments, viewpoint by viewpoint."""

    pointer: IntArray
    segment: NDArray[Any]
    """Of 32 bits, as the units are (runs,)."""
    low: NDArray[Any]
    high: NDArray[Any]


def scene_of(mesh: Mesh, a: FloatArray, b: FloatArray, units: IntArray, on_boundary: BoolArray) -> Scene:
    """Put target segments (m, 2), local metres, into the mesh: faces on its edges, others into triangles."""
    _check_units(units)
    start, end = to_grid(a), to_grid(b)
    pointer, segment, low, high = _buckets(mesh, start, end, units, np.flatnonzero(~on_boundary))
    return Scene(
        mesh=mesh,
        a=start,
        b=end,
        units=units,
        face=_faces(mesh, start, end, np.flatnonzero(on_boundary)),
        bucket_pointer=pointer,
        bucket_segment=segment,
        bucket_low=low,
        bucket_high=high,
    )


def _check_units(units: IntArray) -> None:
    """Refuse more units on a segment than 64-bit numbers allow."""
    most = int(units.max(initial=0))
    if most > MOST_UNITS:
        raise InputError(f"targets: {most} units on one face, more than {MOST_UNITS}; raise --d-dis")


def _faces(mesh: Mesh, a: IntArray, b: IntArray, faces: IntArray) -> IntArray:
    """The face on each mesh edge, found by its end points.

    Raises
    ------
    StopgoError
        If a face is on no mesh edge and so could never be seen; the message names the position.
    """
    segment_at = {(*a[k].tolist(), *b[k].tolist()): int(k) for k in faces}
    found = np.full(mesh.corners.shape, -1, dtype=np.int64)
    for triangle, edge, ends in zip(*rim_of(mesh), strict=True):
        found[triangle, edge] = segment_at.pop(tuple(ends.ravel().tolist()), -1)
    for lost in segment_at:
        raise StopgoError(f"open space: none along the face {ends_of(lost)}; redraw the floor there")
    return found


def _buckets(
    mesh: Mesh, a: IntArray, b: IntArray, units: IntArray, free: IntArray
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Free segments by triangle, each with its first and last unit whose midpoint is in the triangle."""
    unit_segment = np.repeat(free, units[free])
    unit_number = np.concatenate([np.arange(n) for n in units[free]] or [np.empty(0)]).astype(np.int64)
    unit, triangle = _units_in_triangles(
        mesh, a[unit_segment], b[unit_segment], unit_number, units[unit_segment]
    )
    segment, number = unit_segment[unit], unit_number[unit]
    order = np.lexsort((number, segment, triangle))
    segment, number, triangle = segment[order], number[order], triangle[order]
    new = np.ones(len(order), dtype=bool)
    new[1:] = (np.diff(segment) != 0) | (np.diff(triangle) != 0) | (np.diff(number) != 1)
    starts = np.flatnonzero(new)
    ends = np.append(starts[1:], len(order))[: len(starts)] - 1
    pointer = np.searchsorted(triangle[starts], np.arange(mesh.triangles + 1)).astype(np.int64)
    return pointer, segment[starts], number[starts], number[ends]


def _units_in_triangles(
    mesh: Mesh, a: IntArray, b: IntArray, number: IntArray, units: IntArray
) -> tuple[IntArray, IntArray]:
    """(unit, triangle) pairs, a triangle's edges included; decided exactly.

    A midpoint is a fraction of a grid step, so orientations are taken in steps × 2 units.
    """
    if not len(number) or not mesh.triangles:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    odd, pieces = 2 * number + 1, 2 * units
    middle = (a + (odd / pieces)[:, None] * (b - a)) * GRID
    unit, triangle = mesh.tree.query(shapely.points(middle), predicate="dwithin", distance=2 * GRID)
    inside = np.ones(len(unit), dtype=bool)
    for k in range(3):
        p = mesh.vertices[mesh.corners[triangle, k]]
        q = mesh.vertices[mesh.corners[triangle, (k + 1) % 3]]
        at_a, at_b = _turns(p, q, a[unit]), _turns(p, q, b[unit])
        inside &= not_negative(at_a, at_b, odd[unit], pieces[unit])
    return unit[inside], triangle[inside]


def _turns(p: IntArray, q: IntArray, r: IntArray) -> IntArray:
    return (q[:, 0] - p[:, 0]) * (r[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (r[:, 0] - p[:, 0])


def sight(
    scene: Scene, viewpoints: NDArray[np.int64], *, reach: float | None, between: IntArray | None = None
) -> Runs:
    """Runs of units that each viewpoint (n, 2), in grid steps, sees within `reach` metres (None: no limit).

    With `between` (n, 2, 2) it looks only from the direction of the first point on, to the left, to that of
    the second, less than a half turn; all round where both points are the viewpoint itself.
    """
    mesh = scene.mesh
    point, triangle = containing(mesh, viewpoints)
    start = np.searchsorted(point, np.arange(len(viewpoints) + 1)).astype(np.int64)
    limits = np.empty((0, 2, 2), dtype=np.int64) if between is None else between
    right, left = (_limits(mesh, viewpoints, limits, side)[point] for side in range(2))
    vertices = np.concatenate([mesh.vertices, limits[:, 0], limits[:, 1]])
    steps = -1 if reach is None else min(round(reach / GRID), FARTHEST)
    arrays = [
        np.ascontiguousarray(array, dtype=np.int64)
        for array in (
            *(viewpoints[:, 0], viewpoints[:, 1], start, triangle, right, left),
            *(vertices[:, 0], vertices[:, 1]),
            *(mesh.corners.ravel(), mesh.neighbour.ravel(), scene.face.ravel()),
            *(scene.bucket_pointer, scene.bucket_segment, scene.bucket_low, scene.bucket_high),
            *(scene.a[:, 0], scene.a[:, 1], scene.b[:, 0], scene.b[:, 1], scene.units),
        )
    ]
    kernel = compiled(look_all, large=len(viewpoints) * mesh.triangles > LARGE)
    if kernel is not None:
        return _run(kernel, arrays, steps, mesh.triangles, interpreted=False)
    return _run(look_all, [array.tolist() for array in arrays], steps, mesh.triangles, interpreted=True)


def _limits(mesh: Mesh, viewpoints: IntArray, limits: IntArray, side: int) -> IntArray:
    """The vertex, numbered after the mesh's, that limits each viewpoint's view on one side; else -1."""
    if not len(limits):
        return np.full(len(viewpoints), -1, dtype=np.int64)
    number = len(mesh.vertices) + side * len(limits) + np.arange(len(limits))
    return np.where((limits[:, side] == viewpoints).all(axis=1), -1, number)


def _run(
    kernel: Callable[..., int], arrays: list[Any], reach: int, triangles: int, *, interpreted: bool
) -> Runs:
    """Call the kernel for as many viewpoints as its output has room for, until all are done.

    What it found is kept in half of the bits, since long ranges have many runs: segments, and units on one
    segment, fit.
    """
    rows = len(arrays[0])
    stack = _zeros(4 * (2 * triangles + 16), interpreted=interpreted)
    pointer = _zeros(rows + 1, interpreted=interpreted)
    out = [_zeros(min(max(4096, 32 * rows), ROOM), interpreted=interpreted) for _ in range(3)]
    found: tuple[list[NDArray[Any]], ...] = ([], [], [])
    counts, done = np.zeros(rows, dtype=np.int64), 0
    while done < rows:
        pointer[done], begin = 0, done
        done = kernel(begin, pointer, *arrays, reach, stack, *out)
        counts[begin:done] = np.diff(pointer[begin : done + 1])
        for parts, column in zip(found, out, strict=True):
            parts.append(np.array(column[: pointer[done]], dtype=np.int32))
        if done == begin:
            out = [_zeros(2 * len(column), interpreted=interpreted) for column in out]
    return Runs(np.concatenate([[0], np.cumsum(counts)]), *map(_joined, found))


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """The parts in one array; they are forgotten."""
    whole = np.concatenate([np.empty(0, dtype=np.int32), *parts])
    parts.clear()
    return whole


def _zeros(size: int, *, interpreted: bool) -> Any:
    """A list where the kernel is interpreted, since lists index faster there; else an array."""
    return [0] * size if interpreted else np.zeros(size, dtype=np.int64)
