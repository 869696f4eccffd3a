"""Closing of the joints between slabs: a gap that narrow is not an edge that a robot falls from."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawn import place
from stopgo.planner.floors.rings import SNAP, Region, polygons_of
from stopgo.planner.geometry.shapes import SLACK, polygon_parts, segments_of

JOINT = 0.02
"""The widest gap in a floor, in metres, that is a joint between slabs."""
_FACING = -0.9
"""Two edges face each other if the cosine between their directions is at most this."""


def without_joints(floor: Region) -> tuple[Region, list[Finding]]:
    """Return the floor with its joints closed, and a finding for each; the same floor if it has none.

    Closed is what lies straight between two edges that face each other, and every hole as narrow.
    """
    bridges = _bridges(floor).tolist()
    bridges += _narrow_holes(shapely.union_all([floor, *bridges]))
    closed = shapely.union_all([floor, *bridges])
    if floor.length - closed.length <= SNAP:
        return floor, []
    return closed, [
        _joint_finding(joint) for joint in polygons_of(shapely.union_all(bridges).difference(floor))
    ]


def _bridges(floor: Region) -> NDArray[np.object_]:
    """A polygon over each gap between two facing edges, and over a little of the slabs on its sides."""
    edges = segments_of(shapely.orient_polygons(shapely.MultiPolygon(polygon_parts(floor))))
    length = np.hypot(*(edges[:, 1] - edges[:, 0]).T)
    edges, length = edges[length > 0], length[length > 0]
    direction = (edges[:, 1] - edges[:, 0]) / length[:, None]
    lines = shapely.linestrings(edges)
    one, other = shapely.STRtree(lines).query(lines, predicate="dwithin", distance=JOINT + SLACK)
    facing = (one < other) & (np.einsum("ij,ij->i", direction[one], direction[other]) <= _FACING)
    one, other = one[facing], other[facing]
    sides = [_side(lines, direction, one, other), _side(lines, direction, other, one)]
    return shapely.convex_hull(shapely.union(*sides))


def _side(
    lines: NDArray[np.object_], direction: FloatArray, one: NDArray[np.int64], other: NDArray[np.int64]
) -> NDArray[np.object_]:
    """The part of each edge near the other one, and the same part moved slightly into its slab."""
    near = shapely.intersection(lines[one], shapely.buffer(lines[other], JOINT + SLACK))
    inward = SNAP * np.stack([-direction[one][:, 1], direction[one][:, 0]], axis=1)
    xy, owner = shapely.get_coordinates(near, return_index=True)
    return shapely.union(near, shapely.set_coordinates(near.copy(), xy + inward[owner]))


def _narrow_holes(floor: Region) -> list[shapely.Polygon]:
    """Holes as narrow as a joint: at crossings of joints, or a joint that was drawn as a hole."""
    holes = [shapely.Polygon(ring) for part in polygons_of(floor) for ring in part.interiors]
    return [hole for hole in holes if hole.buffer(-(JOINT / 2 + SLACK)).is_empty]


def _joint_finding(joint: shapely.Polygon) -> Finding:
    """The width is that of a rectangle of the same area and outline."""
    half = joint.length / 2
    width = (half - math.sqrt(max(0.0, half * half - 4 * joint.area))) / 2
    text = f"FLOOR: a joint {1000 * width:.1f} mm wide was closed"
    return Finding("joint_closed", text, at=place(shapely.get_coordinates(joint)))
