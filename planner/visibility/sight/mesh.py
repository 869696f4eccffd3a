"""A triangle mesh of open space on the integer grid, for lines of sight and roadmaps."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from stopgo.mission.errors import StopgoError
from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.shapes import GRID, polygon_parts, segments_of


@dataclass(frozen=True, eq=False)
class Mesh:
    """Constrained Delaunay triangles of a polygonal region, counter-clockwise, in whole grid steps."""

    vertices: IntArray
    """(v, 2) in grid steps."""
    corners: IntArray
    """Vertices of each triangle (t, 3)."""
    neighbour: IntArray
    """Triangle across the edge from corner k to corner k + 1, or -1 at the region's boundary (t, 3)."""

    def __getstate__(self) -> dict[str, Any]:
        """Leave out the tree, which is made again in less time than it takes to pickle."""
        return {name: held for name, held in vars(self).items() if name != "tree"}

    @property
    def triangles(self) -> int:
        return len(self.corners)

    @cached_property
    def tree(self) -> shapely.STRtree:
        """The triangles in metres."""
        xy = self.vertices[self.corners] * GRID
        return shapely.STRtree(shapely.polygons(np.concatenate([xy, xy[:, :1]], axis=1)))


def mesh_of(region: BaseGeometry) -> Mesh:
    """Triangulate a region in whole grid steps whose touching rings share vertices.

    Raises
    ------
    StopgoError
        If the region is not valid, or the mesh lacks one of its edges, which would then be invisible; the
        message names the position.
    """
    if not shapely.is_valid(region):
        raise StopgoError(f"open space, in steps of {GRID:g} m: {shapely.is_valid_reason(region)}; redraw it")
    parts = [shapely.constrained_delaunay_triangles(part) for part in polygon_parts(region)]
    triangles = shapely.get_parts(parts) if parts else np.array([])
    xy = shapely.get_coordinates(triangles).reshape(-1, 4, 2)[:, :3]
    vertices, index = np.unique(np.rint(xy.reshape(-1, 2)).astype(np.int64), axis=0, return_inverse=True)
    corners = _counter_clockwise(vertices, index.reshape(-1, 3))
    mesh = Mesh(vertices=vertices, corners=corners, neighbour=_neighbours(corners))
    _check_rim(mesh, region)
    return mesh


def _check_rim(mesh: Mesh, region: BaseGeometry) -> None:
    """Check that the mesh's boundary is the region's boundary, edge by edge."""
    _, _, rim = rim_of(mesh)
    drawn = np.rint(segments_of(shapely.orient_polygons(region))).astype(np.int64)
    if not np.array_equal(_sorted(rim), _sorted(drawn)):
        edge = min({*map(_key, rim)} ^ {*map(_key, drawn)})
        raise StopgoError(f"open space: no triangle along {ends_of(edge)}; redraw the floor there")


def rim_of(mesh: Mesh) -> tuple[IntArray, IntArray, IntArray]:
    """Triangle (n,), number (n,) and ends (n, 2, 2) of each edge at the boundary, the region on its left."""
    triangle, number = np.nonzero(mesh.neighbour < 0)
    ends = [mesh.vertices[mesh.corners[triangle, (number + k) % 3]] for k in range(2)]
    return triangle, number, np.stack(ends, axis=1)


def ends_of(edge: tuple[int, ...]) -> str:
    """An edge's ends in words."""
    ax, ay, bx, by = (GRID * step for step in edge)
    return f"({ax:.5f}, {ay:.5f}) to ({bx:.5f}, {by:.5f}) m from the floor's lower left corner"


def _key(edge: IntArray) -> tuple[int, ...]:
    return tuple(edge.ravel().tolist())


def _sorted(edges: IntArray) -> IntArray:
    flat = edges.reshape(-1, 4)
    return flat[np.lexsort(flat.T)]


def _counter_clockwise(vertices: IntArray, corners: IntArray) -> IntArray:
    a, b, c = (vertices[corners[:, k]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    corners = np.where((turn < 0)[:, None], corners[:, [0, 2, 1]], corners)[turn != 0]
    return corners[np.lexsort(corners.T[::-1])]


def _neighbours(corners: IntArray) -> IntArray:
    """Triangles that share an edge run along it in opposite directions."""
    start, end = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    many = int(corners.max(initial=0)) + 1
    key, twin = start * many + end, end * many + start
    order = np.argsort(key, kind="stable")
    at = np.searchsorted(key[order], twin)
    at = np.minimum(at, max(len(order) - 1, 0))
    found = key[order][at] == twin if len(order) else np.zeros(0, dtype=bool)
    return np.where(found, order[at] // 3, -1).reshape(-1, 3)


def containing(mesh: Mesh, points: NDArray[np.int64]) -> tuple[IntArray, IntArray]:
    """(point, triangle) pairs for every triangle, edges included, that contains a grid point."""
    point, triangle = mesh.tree.query(shapely.points(points * GRID), predicate="dwithin", distance=2 * GRID)
    inside = np.ones(len(point), dtype=bool)
    q = points[point]
    for k in range(3):
        a = mesh.vertices[mesh.corners[triangle, k]]
        b = mesh.vertices[mesh.corners[triangle, (k + 1) % 3]]
        turn = (b[:, 0] - a[:, 0]) * (q[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (q[:, 0] - a[:, 0])
        inside &= turn >= 0
    order = np.lexsort((triangle[inside], point[inside]))
    return point[inside][order], triangle[inside][order]
