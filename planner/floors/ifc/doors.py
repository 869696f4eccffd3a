"""Doors of a floor: each as a line across its opening, from jamb to jamb in the middle of the wall."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model, Product, Surface
from stopgo.planner.floors.rings import Region

SILL = 0.3
"""The bottom of a door lies at most so far above its floor, metres."""
LEAST_HEIGHT = 1.0
"""An opening lower than this is a hatch."""


@dataclass(frozen=True, eq=False)
class Door:
    """A door: its line (2, 2), and the area of the opening in its wall."""

    product: Product
    line: FloatArray
    threshold: Region


def doors_on(level: Level, model: Model, walls: dict[str, Region]) -> list[Door]:
    """The doors of a floor; `walls` are the cut walls by GlobalId. One without a body is as its opening."""
    found = []
    for product in sorted(model.products.values(), key=lambda item: item.global_id):
        mesh = model.meshes.get(product.global_id, model.meshes.get(product.opening or ""))
        if product.role == "doors" and mesh is not None:
            found.append(_door(product, mesh, level, model, walls))
    return [door for door in found if door is not None]


def _door(
    product: Product, mesh: Surface, level: Level, model: Model, walls: dict[str, Region]
) -> Door | None:
    if not (level.z - 0.6 < mesh.z[0] < level.z + SILL and mesh.z[1] > level.z + LEAST_HEIGHT):
        return None
    frame = _frame(product, mesh)
    opening = model.meshes.get(product.opening or "", mesh)
    box = _box(opening.vertices[:, :2], frame)
    if np.ptp(box[:, 0]) < np.ptp(box[:, 1]) and _is_turned(box, product):
        frame = np.array([frame[0], frame[2], -frame[1]])
        box = _box(opening.vertices[:, :2], frame)
    near, far = _faces_of_wall(box, frame, _host(product, model, walls))
    ends = np.array([[x, (near + far) / 2] for x in box[:, 0]])
    corners = np.array([[box[i, 0], (near, far)[j]] for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
    return Door(product, _world(ends, frame), shapely.Polygon(_world(corners, frame)))


def _frame(product: Product, mesh: Surface) -> FloatArray:
    """Origin and axes (3, 2) of a door in plan: x along it, y through it."""
    if product.placement is None:
        box = shapely.get_coordinates(shapely.MultiPoint(mesh.vertices[:, :2]).minimum_rotated_rectangle)
        sides = np.diff(box[:3], axis=0)
        x = max(sides, key=lambda side: float(np.hypot(*side)))
        origin = box[0]
    else:
        matrix = np.array(product.placement).reshape(4, 4)
        origin, x = matrix[:2, 3], matrix[:2, 0]
    x = x / (np.hypot(*x) or 1.0)
    return np.array([origin, x, [-x[1], x[0]]])


def _box(points: FloatArray, frame: FloatArray) -> FloatArray:
    """Least and greatest x and y (2, 2) of points in a frame."""
    local = (points - frame[0]) @ frame[1:].T
    return np.array([local.min(axis=0), local.max(axis=0)])


def _world(local: FloatArray, frame: FloatArray) -> FloatArray:
    return np.round((frame[0] + local @ frame[1:]) / 1e-4) * 1e-4


def _is_turned(box: FloatArray, product: Product) -> bool:
    """True if the door's width lies along the frame's other axis."""
    if product.overall_width is None:
        return True
    wide, deep = np.ptp(box[:, 0]), np.ptp(box[:, 1])
    return bool(abs(deep - product.overall_width) < abs(wide - product.overall_width))


def _host(product: Product, model: Model, walls: dict[str, Region]) -> Region | None:
    opening = model.products.get(product.opening or "")
    return walls.get(opening.host or "") if opening else None


def _faces_of_wall(box: FloatArray, frame: FloatArray, wall: Region | None) -> tuple[float, float]:
    """The y of the wall's faces at the opening; of the opening itself if there is no wall."""
    if wall is not None:
        local = (shapely.get_coordinates(wall) - frame[0]) @ frame[1:].T
        x, y = local.T
        jambs = (np.abs(x - box[0, 0]) < 0.02) | (np.abs(x - box[1, 0]) < 0.02)
        at = y[jambs & (y > box[0, 1] - 0.05) & (y < box[1, 1] + 0.05)]
        if len(at) > 1:
            return float(at.min()), float(at.max())
    return float(box[0, 1]), float(box[1, 1])
