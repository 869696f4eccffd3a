"""Shortest paths between points of the drive area: a visibility graph over its corners.

A shortest path bends only at corners that project into the drive area. So the nodes are these corners, the
given points, and the ends of gap crossings. The drive area rounds obstacles from outside with 16 corners
per full circle, so a path is at most 2 % of a radius longer at a right-angled bend than the true arc.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.geometry.shapes import (
    GRID,
    local_origin,
    polygon_parts,
    snapped,
    whole_steps,
)
from stopgo.planner.routing.nearby_paths import NearbyPaths
from stopgo.planner.routing.paths import Paths, shortest_paths
from stopgo.planner.routing.tangents import straight_pieces
from stopgo.planner.space.local_shapes import drive_area_of
from stopgo.planner.space.reach import reach_of
from stopgo.planner.visibility.sight.mesh import Mesh, mesh_of

TOUCH = 1e-9
"""Products of areas (m⁴) below this are floating-point noise."""


def paths_between(space: NavigableSpace, points: FloatArray, *, trees: bool = False) -> Paths:
    """Shortest paths between all pairs of points (n, 2) of the drive area; `trees` as in `shortest_paths`."""
    return shortest_paths(*graph_of(space, points), len(points), trees=trees)


def nearby_paths_between(space: NavigableSpace, points: FloatArray) -> NearbyPaths:
    """Shortest paths from each point (n, 2) of the drive area to the points near it."""
    return NearbyPaths(*graph_of(space, points), len(points))


def graph_of(space: NavigableSpace, points: FloatArray) -> tuple[FloatArray, IntArray]:
    """The nodes (n, 2), points first, and the straight pieces (m, 2) of shortest paths between points."""
    origin = local_origin(space.floor)
    corners = outward_corners(space)
    ends, crossing = np.unique(space.gaps.reshape(-1, 2) - origin, axis=0, return_inverse=True)
    anchors, anchored = anchors_of(space, points - origin)
    nodes = np.concatenate([points - origin, corners.xy, ends, anchors])
    links = crossing.reshape(-1, 2) + len(points) + len(corners.xy)
    to_anchors = np.stack([anchored, np.arange(len(nodes) - len(anchors), len(nodes))], axis=1)
    edges = [
        _pieces(space, nodes, corners, first=len(points)),
        links,
        on_crossings(points - origin, nodes, links),
        to_anchors,
    ]
    return nodes + origin, np.concatenate(edges)


def anchors_of(space: NavigableSpace, points: FloatArray) -> tuple[FloatArray, IntArray]:
    """Anchors (k, 2) of the points at the edge of the drive area, and the indices of those points."""
    anchors = reach_of(space).anchors(points)
    moved = np.flatnonzero(np.any(anchors != points, axis=1) & np.isfinite(anchors[:, 0]))
    return anchors[moved], moved


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of the drive area with an inner angle above 180°, in local coordinates."""

    xy: FloatArray
    """(n, 2)."""
    sides: FloatArray
    """Vectors to the previous and to the next corner (n, 2, 2); zero where rings touch."""


@instance_cached
def outward_corners(space: NavigableSpace) -> Corners:
    """Every corner once, in a canonical order."""
    found, sides = [np.empty((0, 2))], [np.empty((0, 2, 2))]
    for piece in polygon_parts(_drive_area(space)):
        for ring in _oriented_rings(piece):
            back, on = np.roll(ring, 1, axis=0) - ring, np.roll(ring, -1, axis=0) - ring
            outward = _cross(back, on) > 0
            found.append(ring[outward])
            sides.append(np.stack([back, on], axis=1)[outward])
    xy, first, times = np.unique(np.concatenate(found), axis=0, return_index=True, return_counts=True)
    return Corners(xy, np.where((times == 1)[:, None, None], np.concatenate(sides)[first], 0.0))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def _oriented_rings(piece: shapely.Polygon) -> list[FloatArray]:
    """Rings with the drive area on the left: the exterior counter-clockwise, holes clockwise."""
    turned = shapely.orient_polygons(piece)
    return [shapely.get_coordinates(ring)[:-1] for ring in (turned.exterior, *turned.interiors)]


@instance_cached
def _drive_area(space: NavigableSpace) -> BaseGeometry:
    return snapped(drive_area_of(space))


@instance_cached
def drive_mesh(space: NavigableSpace) -> Mesh:
    """A mesh of the drive area."""
    return mesh_of(whole_steps(_drive_area(space)))


@instance_cached
def corner_pieces(space: NavigableSpace) -> IntArray:
    """Pairs (m, 2) of mutually visible corners that may be a straight piece of a shortest path."""
    corners = outward_corners(space)
    found = straight_pieces(drive_mesh(space), corners.xy, np.arange(len(corners.xy)), corners.sides)
    return _tangent(found, corners.xy, corners.sides)


def on_crossings(points: FloatArray, nodes: FloatArray, links: IntArray) -> IntArray:
    """Links (k, 2) from points that lie on a gap crossing, such as stops in doorways, to its ends."""
    if not len(links):
        return np.empty((0, 2), dtype=np.int64)
    crossings = shapely.STRtree(shapely.linestrings(nodes[links]))
    point, crossing = crossings.query(shapely.points(points), predicate="dwithin", distance=GRID)
    order = np.lexsort((crossing, point))
    point, crossing = point[order], crossing[order]
    return np.stack([np.repeat(point, 2), links[crossing].ravel()], axis=1).astype(np.int64)


def _pieces(space: NavigableSpace, nodes: FloatArray, corners: Corners, *, first: int) -> IntArray:
    """Pairs (m, 2) of mutually visible nodes that may be a straight piece of a shortest path.

    Nodes from `first` on are the corners.
    """
    sides = np.zeros((len(nodes), 2, 2))
    of_corners = np.arange(first, first + len(corners.xy))
    sides[of_corners] = corners.sides
    some = straight_pieces(drive_mesh(space), nodes, of_corners, corners.sides, between_corners=False)
    return np.concatenate([_tangent(some, nodes, sides), first + corner_pieces(space)])


def _tangent(edges: IntArray, nodes: FloatArray, sides: FloatArray) -> IntArray:
    """The edges that a shortest path may use: those that pass by the corners at their ends.

    If the sides of a corner (n, 2, 2) lie on different sides of the edge, a shorter path cuts the corner.
    Edges too close to decide stay. Edges leave their first corner past it, so most end at their last.
    """
    for end in (1, 0):
        along = (nodes[edges[:, 1]] - nodes[edges[:, 0]])[:, None]
        turn = _cross(along, sides[edges[:, end]])
        edges = edges[turn[:, 0] * turn[:, 1] >= -TOUCH]
    return edges
