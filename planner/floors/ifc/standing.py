"""Bodies of a model that reach into the robot's height on one floor, from their triangles alone.

Nothing here uses the sections and outlines of which floor plans are made: plans are checked against it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

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
    upper = _above(np.arange(len(there)), there, low, 1.0)
    parts = [part for number, points in upper for part in _above(number, points, high, -1.0)]
    parts = [(number, points) for number, points in parts if points.shape[1] > 1]
    if not parts:
        return []
    hulls = np.concatenate([_hulls(points) for _, points in parts])
    order = np.argsort(np.concatenate([number for number, _ in parts]))
    return list(hulls[order])


def _hulls(points: FloatArray) -> NDArray[np.object_]:
    """The convex hulls in plan of polygons (n, k, 3)."""
    flat = shapely.points(points[..., :2].reshape(-1, 2))
    index = np.repeat(np.arange(len(points)), points.shape[1])
    hulls: NDArray[np.object_] = shapely.convex_hull(shapely.multipoints(flat, indices=index))
    return hulls


def _above(
    number: NDArray[np.int64], points: FloatArray, height: float, sign: float
) -> Iterator[tuple[NDArray[np.int64], FloatArray]]:
    """Yield the parts of polygons (n, k, 3) above a height, or below it where the sign is negative.

    Those with the same corners above it come together, with their numbers: they have as many vertices.
    """
    up = sign * (points[..., 2] - height)
    following, up_next = np.roll(points, -1, axis=1), np.roll(up, -1, axis=1)
    crossing = (up < 0) != (up_next < 0)
    fraction = np.divide(up, up - up_next, out=np.zeros_like(up), where=crossing)[..., None]
    crossed = points + fraction * (following - points)
    pattern = (up < 0) @ (1 << np.arange(points.shape[1]))
    for same in np.unique(pattern):
        these = pattern == same
        first = np.argmax(these)
        kept = points[these][:, up[first] >= 0]
        yield number[these], np.concatenate([kept, crossed[these][:, crossing[first]]], axis=1)
