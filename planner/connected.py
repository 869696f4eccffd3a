"""Which pieces of the drive area are connected, by the crossings between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from mission.geometry import FloatArray, IntArray
from planner.shapes import GRID, polygon_parts


@dataclass(frozen=True, eq=False)
class Parts:
    """Pieces of the drive area and the connected part each belongs to."""

    pieces: tuple[BaseGeometry, ...]
    part: IntArray
    """Part of each piece, numbered from the largest area down."""
    gaps: FloatArray
    gap_part: IntArray

    @property
    def areas(self) -> tuple[float, ...]:
        """Area of each part in m²."""
        sizes = np.zeros(int(self.part.max(initial=-1)) + 1)
        np.add.at(sizes, self.part, [piece.area for piece in self.pieces])
        return tuple(sizes.tolist())

    def part_at(self, xy: FloatArray) -> IntArray:
        """Part of each point (n, 2), -1 where the robot's centre may not be."""
        found = np.full(len(xy), -1, dtype=np.int64)
        if len(self.pieces) and len(xy):
            point, piece = shapely.STRtree(self.pieces).query(
                shapely.points(xy), predicate="dwithin", distance=GRID
            )
            found[point] = self.part[piece]
        for way, part in zip(self.gaps, self.gap_part, strict=True):
            found[shapely.dwithin(shapely.LineString(way), shapely.points(xy), GRID)] = part
        return found

    def touching(self, line: BaseGeometry) -> set[int]:
        """Parts that a line runs through or whose gap crossings it cuts."""
        parts = {int(p) for piece, p in zip(self.pieces, self.part, strict=True) if piece.intersects(line)}
        for way, part in zip(self.gaps, self.gap_part, strict=True):
            if shapely.LineString(way).distance(line) <= GRID:
                parts.add(int(part))
        return parts

    def area_by_part(self, shape: BaseGeometry) -> dict[int, float]:
        """Drive area within `shape`, by part."""
        areas: dict[int, float] = {}
        for piece, part in zip(self.pieces, self.part, strict=True):
            if piece.intersects(shape):
                areas[int(part)] = areas.get(int(part), 0.0) + piece.intersection(shape).area
        return areas


def parts_of(drive_area: BaseGeometry, gaps: FloatArray) -> Parts:
    """Join the pieces of the drive area by the gap crossings (k, 2, 2) whose ends lie in them."""
    pieces = tuple(sorted(polygon_parts(drive_area), key=lambda piece: piece.bounds))
    ends = _piece_at(pieces, gaps.reshape(-1, 2)).reshape(-1, 2)
    links = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(pieces), len(pieces)))
    labels = connected_components(links, directed=False)[1] if pieces else np.empty(0, np.int64)
    part = _by_area(labels, np.array([piece.area for piece in pieces]))
    return Parts(pieces, part, gaps, part[ends[:, 0]] if len(ends) else np.empty(0, np.int64))


def _piece_at(pieces: tuple[BaseGeometry, ...], xy: FloatArray) -> IntArray:
    found = np.zeros(len(xy), dtype=np.int64)
    if len(xy):
        point, piece = shapely.STRtree(pieces).query(shapely.points(xy), predicate="dwithin", distance=GRID)
        found[point] = piece
    return found


def _by_area(labels: IntArray, areas: FloatArray) -> IntArray:
    """Number parts from the largest area down; equal areas keep their order."""
    if not len(labels):
        return np.empty(0, dtype=np.int64)
    totals = np.bincount(labels, weights=areas)
    rank = np.empty(len(totals), dtype=np.int64)
    rank[np.lexsort((np.arange(len(totals)), -np.round(totals, 6)))] = np.arange(len(totals))
    return rank[labels]
