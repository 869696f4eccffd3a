"""Polygons of the cells of a grid: their exact outline, or smoothed within the size of a cell."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from stopgo.mission.geometry import FloatArray

SMOOTHED = 1.01
"""Outlines are straightened by at most so many cells: steps of a slanted wall, and bumps of one cell."""


def polygons_of_cells(mask: NDArray[np.bool_]) -> list[shapely.Polygon]:
    """The outlines of the cells that are set, in cells: column and row of their corners.

    Cells that touch at a corner only are apart.
    """
    if not mask.any():
        return []
    edges = np.concatenate([_edges(mask), _edges(mask.T)[..., ::-1]])
    noded = shapely.union_all(shapely.linestrings(edges))
    faces = shapely.get_parts(shapely.polygonize([noded]))
    column, row = np.floor(shapely.get_coordinates(shapely.point_on_surface(faces))).astype(int).T
    return [face for face, is_set in zip(faces, mask[row, column], strict=True) if is_set]


def _edges(mask: NDArray[np.bool_]) -> FloatArray:
    """Segments (n, 2, 2) along the rows where set cells border on others, as long as they go straight on."""
    padded = np.pad(mask, 1)
    border = padded[1:, 1:-1] != padded[:-1, 1:-1]
    # A border that changes sides ends where it does so: there cells touch at a corner.
    side = np.where(border, np.where(padded[1:, 1:-1], np.int8(1), np.int8(-1)), np.int8(0))
    steps = np.diff(np.pad(side, ((0, 0), (1, 1))), axis=1) != 0
    row, at = np.nonzero(steps)
    same = row[:-1] == row[1:]
    drawn = same & (side[row[:-1], np.minimum(at[:-1], side.shape[1] - 1)] != 0)
    first, last, rows = at[:-1][drawn], at[1:][drawn], row[:-1][drawn]
    return np.stack([np.stack([first, rows], axis=1), np.stack([last, rows], axis=1)], axis=1).astype(float)


def smoothed(shapes: list[shapely.Polygon]) -> list[shapely.Polygon]:
    """The shapes with steps of one cell straightened."""
    plain = shapely.simplify(shapes, SMOOTHED, preserve_topology=True)
    return [part for shape in plain for part in shapely.get_parts(shapely.make_valid(shape)) if part.area > 0]


def placed(points: FloatArray, *, resolution: float, origin: tuple[float, float, float]) -> FloatArray:
    """Corners of cells (n, 2) in the map's frame, in metres."""
    x, y, yaw = origin
    along = points * resolution
    turned = along @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    return turned + np.array([x, y])
