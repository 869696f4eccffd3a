"""Candidate for a room too small for the grid: its best point, if any point is allowed."""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.mission.stages import KEPT
from stopgo.planner.geometry.shapes import polygon_parts, roughly_widened
from stopgo.planner.space.stop_feasibility import StopFeasibility

HAIR = 1e-6
"""Clearances are shortened by this to find strips that are allowed but have no width."""
BEYOND = 1.0
"""Metres around a room, beyond twice the clearance, in which obstacles and floor edges are considered."""


def best_point(feasibility: StopFeasibility, room: int) -> FloatArray | None:
    """The allowed point of a room farthest from elements and floor edges, or None if none is allowed."""
    settings = feasibility.space.settings
    margin = 2 * max(feasibility.element_clearance, settings.edge) + BEYOND
    obstacles, outline = feasibility.around(feasibility.rooms[room], margin)
    allowed = feasibility.rooms[room].difference(
        roughly_widened(obstacles, feasibility.element_clearance - HAIR, quad_segs=64)
    )
    edges = roughly_widened(shapely.boundary(outline), max(settings.edge - HAIR, 0.0), quad_segs=64)
    pieces = polygon_parts(allowed.intersection(outline).difference(edges))
    points = [xy for piece in pieces for xy in _middles(piece)]
    if not points:
        return None
    local = np.array(points)
    ok = feasibility.reasons(local + feasibility.origin, np.full(len(local), room)) == KEPT
    if not ok.any():
        return None
    clear = np.minimum(
        feasibility.to_element(local) - settings.d_sec, feasibility.to_edge(local) - settings.edge
    )
    order = np.lexsort((local[:, 1], local[:, 0], -np.round(np.where(ok, clear, -np.inf), 9)))
    return local[order[0]] + feasibility.origin


def _middles(piece: shapely.Polygon) -> list[FloatArray]:
    """Points likely to be farthest inside: the centroid, a point on the surface, the largest circle's."""
    shapes = [piece.centroid, piece.representative_point()]
    if piece.area > 1e-4:
        shapes.append(shapely.maximum_inscribed_circle(piece, tolerance=1e-3).interpolate(0.0))
    return [np.array([shape.x, shape.y]) for shape in shapes]
