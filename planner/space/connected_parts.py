"""Connected parts of the drive area, joined by the gap crossings between its pieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.ring_index import areas_within, triangles_of
from stopgo.planner.geometry.shapes import GRID, polygon_parts


@dataclass(frozen=True, eq=False)
class Parts:
    """Pieces of the drive area with the connected part of each; points are looked up by triangles."""

    pieces: tuple[BaseGeometry, ...]
    part: IntArray
    """Part of each piece, numbered from the largest area down."""
    gaps: FloatArray
    gap_part: IntArray
    cells: NDArray[np.object_]
    """Triangles of all pieces."""
    cell_part: IntArray
    tree: shapely.STRtree

    @property
    def areas(self) -> tuple[float, ...]:
        """Area of each part in m²."""
        sizes = np.zeros(int(self.part.max(initial=-1)) + 1)
        np.add.at(sizes, self.part, [piece.area for piece in self.pieces])
        return tuple(sizes.tolist())

    def part_at(self, xy: FloatArray) -> IntArray:
        """Part of each point (n, 2), -1 where the robot's centre may not be."""
        found = np.full(len(xy), -1, dtype=np.int64)
        points = shapely.points(xy)
        point, cell = self.tree.query(points, predicate="dwithin", distance=GRID)
        found[point] = self.cell_part[cell]
        for crossing, part in zip(self.gaps, self.gap_part, strict=True):
            found[shapely.dwithin(shapely.LineString(crossing), points, GRID)] = part
        return found

    def touching(self, line: BaseGeometry) -> set[int]:
        """Parts that a line runs through or whose gap crossings it cuts."""
        parts = set(self.cell_part[self.tree.query(line, predicate="intersects")].tolist())
        if len(self.gaps):
            near = shapely.dwithin(shapely.linestrings(self.gaps), line, GRID)
            parts |= set(self.gap_part[near].tolist())
        return parts

    def only_part_in(self, shape: BaseGeometry) -> int | None:
        """The part of which a triangle lies within `shape`, if no other part comes near; else None."""
        near = self.tree.query(shape)
        if len(near) and (self.cell_part[near] == self.cell_part[near[0]]).all():
            shapely.prepare(shape)
            if shapely.contains_properly(shape, self.cells[near]).any():
                return int(self.cell_part[near[0]])
        return None

    def area_by_part(self, shape: BaseGeometry) -> dict[int, float]:
        """Drive area within `shape`, by part."""
        inside = np.sort(self.tree.query(shape))
        sizes = areas_within(self.cells[inside], shape)
        inside, sizes = inside[sizes > 0], sizes[sizes > 0]
        totals = np.bincount(self.cell_part[inside], weights=sizes, minlength=0)
        return {part: float(totals[part]) for part in np.unique(self.cell_part[inside]).tolist()}


def parts_of(drive_area: BaseGeometry, gaps: FloatArray) -> Parts:
    """Join the pieces of the drive area by the chains of gap crossings (k, 2, 2) between them."""
    pieces = tuple(sorted(polygon_parts(drive_area), key=lambda piece: piece.bounds))
    triangles = [triangles_of(piece) for piece in pieces]
    cells = np.concatenate([np.empty(0, dtype=object), *triangles])
    piece_of = np.repeat(np.arange(len(pieces)), [len(some) for some in triangles]).astype(np.int64)
    tree = shapely.STRtree(cells)
    nodes = _end_nodes(len(pieces), tree, piece_of, gaps)
    total = int(max(len(pieces), nodes.max(initial=-1) + 1))
    links = coo_array((np.ones(len(nodes)), (nodes[:, 0], nodes[:, 1])), shape=(total, total))
    labels = connected_components(links, directed=False)[1] if total else np.empty(0, np.int64)
    part = _by_area(labels, np.array([*(piece.area for piece in pieces), *[0.0] * (total - len(pieces))]))
    return Parts(
        pieces=pieces,
        part=part[: len(pieces)],
        gaps=gaps,
        gap_part=part[nodes[:, 0]],
        cells=cells,
        cell_part=part[piece_of],
        tree=tree,
    )


def _end_nodes(pieces: int, tree: shapely.STRtree, piece_of: IntArray, gaps: FloatArray) -> IntArray:
    """Node numbers of both ends of each crossing (k, 2): the piece they lie in, else a new number."""
    _, own = np.unique(gaps.reshape(-1, 2), axis=0, return_inverse=True)
    nodes = own.reshape(-1) + pieces
    point, cell = tree.query(shapely.points(gaps.reshape(-1, 2)), predicate="dwithin", distance=GRID)
    nodes[point] = piece_of[cell]
    return nodes.reshape(-1, 2).astype(np.int64)


def _by_area(labels: IntArray, areas: FloatArray) -> IntArray:
    """Number parts from the largest area down; equal areas keep their order."""
    if not len(labels):
        return np.empty(0, dtype=np.int64)
    totals = np.bincount(labels, weights=areas)
    rank = np.empty(len(totals), dtype=np.int64)
    rank[np.lexsort((np.arange(len(totals)), -np.round(totals, 6)))] = np.arange(len(totals))
    return rank[labels]
