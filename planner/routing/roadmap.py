"""Shortest ways between points of the drive area: a visibility graph over its corners.

A shortest way bends only at corners that stick out into the drive area, so these, the points asked
for, and the ends of gap crossings are its nodes. The drive area rounds obstacles from outside with 16
corners per turn, so a way is at most 2 % of a radius longer at a right-angled bend than the true arc.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from shapely.geometry.base import BaseGeometry

from mission.geometry import FloatArray, IntArray, frozen
from mission.planning import NavigableSpace
from planner.mesh import mesh_of
from planner.shapes import GRID, local_origin, polygon_parts, snapped, to_grid, to_shape
from planner.sight import scene_of, sight


@dataclass(frozen=True, eq=False)
class Ways:
    """Shortest ways between the points asked for."""

    xy: FloatArray
    """Node positions in the drawing's coordinates; the points come first."""
    lengths: FloatArray
    """(points, points) in metres; infinite where there is no way."""
    before: IntArray
    """(points, nodes): the node before each node on the way from each point, negative at its start."""

    def way(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one point to another, both included."""
        nodes = [end]
        while nodes[-1] != start:
            nodes.append(int(self.before[start, nodes[-1]]))
        line = self.xy[nodes[::-1]]
        keep = np.append(True, np.any(np.diff(line, axis=0) != 0, axis=1))
        return frozen(line[keep])


def ways_between(space: NavigableSpace, points: FloatArray) -> Ways:
    """Shortest ways between all pairs of points (n, 2) of the drive area."""
    origin = local_origin(space.floor)
    corners = outward_corners(space)
    ends, crossing = np.unique(space.gaps.reshape(-1, 2) - origin, axis=0, return_inverse=True)
    nodes = np.concatenate([points - origin, corners, ends])
    links = crossing.reshape(-1, 2) + len(points) + len(corners)
    graph = _graph(space, nodes, np.concatenate([links, _on_crossings(points - origin, nodes, links)]))
    lengths, before = dijkstra(
        graph, directed=False, indices=np.arange(len(points)), return_predecessors=True
    )
    return Ways(
        xy=frozen(nodes + origin),
        lengths=frozen(lengths[:, : len(points)]),
        before=frozen(before, np.int64),
    )


def outward_corners(space: NavigableSpace) -> FloatArray:
    """Corners (n, 2) of the drive area, local, where its inner angle is more than straight."""
    found = [np.empty((0, 2))]
    for piece in polygon_parts(_drive_area(space)):
        for ring, sign in _oriented_rings(piece):
            into, out = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
            turn = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
            found.append(ring[sign * turn < 0])
    return np.unique(np.concatenate(found), axis=0)


def _oriented_rings(piece: shapely.Polygon) -> list[tuple[FloatArray, float]]:
    """Rings with the drive area on the left: the exterior counter-clockwise, holes clockwise."""
    rings = [(np.asarray(piece.exterior.coords), piece.exterior.is_ccw)]
    rings += [(shapely.get_coordinates(hole), not hole.is_ccw) for hole in piece.interiors]
    return [(ring[:-1], 1.0 if along else -1.0) for ring, along in rings]


def _drive_area(space: NavigableSpace) -> BaseGeometry:
    return snapped(to_shape(space.drive_area, local_origin(space.floor)))


def _on_crossings(points: FloatArray, nodes: FloatArray, links: IntArray) -> IntArray:
    """Links (k, 2) from points that lie on a gap crossing, such as stops in doorways, to its ends."""
    if not len(links):
        return np.empty((0, 2), dtype=np.int64)
    ways = shapely.linestrings(nodes[links])
    near = shapely.dwithin(shapely.points(points)[:, None], ways[None, :], GRID)
    point, way = np.nonzero(near)
    return np.stack([np.repeat(point, 2), links[way].ravel()], axis=1).astype(np.int64)


def _graph(space: NavigableSpace, nodes: FloatArray, links: IntArray) -> csr_array:
    """Straight ways between nodes that see each other, and the given links (k, 2)."""
    mesh = mesh_of(_drive_area(space))
    ones = np.ones(len(nodes), dtype=np.int64)
    scene = scene_of(mesh, nodes, nodes, ones, np.zeros(len(nodes), dtype=bool))
    runs = sight(scene, to_grid(nodes), reach=None)
    start = np.repeat(np.arange(len(nodes)), np.diff(runs.pointer))
    start = np.concatenate([start, links[:, 0]])
    end = np.concatenate([runs.segment, links[:, 1]])
    useful = start != end
    start, end = start[useful], end[useful]
    low, high = np.minimum(start, end), np.maximum(start, end)
    pair = np.unique(np.stack([low, high], axis=1), axis=0)
    length = np.hypot(*(nodes[pair[:, 0]] - nodes[pair[:, 1]]).T)
    # a length of exactly 0 would mean "no edge" to the sparse solver
    return csr_array((np.maximum(length, 1e-12), (pair[:, 0], pair[:, 1])), shape=(len(nodes),) * 2)
