"""Bodies of a model that reach into the robot's height on one floor, from their triangles alone.

Nothing here uses the sections and outlines of which floor plans are made: plans are checked against it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.class_kinds import IGNORED
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model, Product
from stopgo.planner.floors.ifc.solids import KERB, OBJECTS, ON_FLOOR, TREADS, Heights
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.standing_body import StandingBody

PASSABLE = ("doors", "spaces", "openings", IGNORED)
"""Roles that a robot drives through: leaves stand open, the others are no bodies."""


def standing_on(level: Level, model: Model, heights: Heights) -> Iterator[StandingBody]:
    """Every body between the kerb of a floor and the robot's top."""
    roles = sorted({item.role for item in model.described.products}.difference(PASSABLE))
    for product, mesh in model.of_role(*roles):
        low, high = level.z + _lowest(product), level.z + heights.top
        if mesh.z[1] > low and mesh.z[0] < high:
            faces = _faces(mesh.triangles, low, high)
            if faces:
                name = legible(f"{product.ifc_class} {product.global_id} '{product.name}'")
                yield StandingBody(name, tuple(faces), mesh.triangles, (low + high) / 2)


def _lowest(product: Product) -> float:
    """Height above the floor from which a body is in the robot's way."""
    if product.role == "stairs":
        return TREADS[0]
    return ON_FLOOR if product.role in OBJECTS else KERB


def _faces(triangles: FloatArray, low: float, high: float) -> list[shapely.Geometry]:
    """The part of each face between two heights, in plan: an area, or a line where it is upright."""
    z = triangles[..., 2]
    there = triangles[(z.max(axis=1) > low) & (z.min(axis=1) < high)]
    points = (_above(_above(face, low, 1.0), high, -1.0) for face in there)
    return [shapely.MultiPoint(part[:, :2]).convex_hull for part in points if len(part) > 1]


def _above(points: FloatArray, height: float, sign: float) -> FloatArray:
    """The part of a polygon above a height, or below it where the sign is negative."""
    if not len(points):
        return points
    up = sign * (points[:, 2] - height)
    following, up_next = np.roll(points, -1, axis=0), np.roll(up, -1)
    crossing = (up < 0) != (up_next < 0)
    fraction = np.divide(up, up - up_next, out=np.zeros_like(up), where=crossing)[:, None]
    return np.vstack([points[up >= 0], (points + fraction * (following - points))[crossing]])
