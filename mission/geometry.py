"""Shapes that all folders share: read-only arrays and polygons, in metres, x right, y up."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def frozen(values: ArrayLike, dtype: Any = np.float64) -> NDArray[Any]:
    """A contiguous read-only copy of `values`."""
    array = np.array(values, dtype=dtype, order="C")
    array.flags.writeable = False
    return array


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A new contiguous array itself, read-only from now on."""
    array.flags.writeable = False
    return array


def ring_area(ring: FloatArray) -> float:
    """Signed area in m² of a ring (n, 2): positive when counter-clockwise (shoelace formula)."""
    if len(ring) < 3:
        return 0.0
    x, y = (ring - ring[0]).T  # from its first point on, which then adds nothing
    return 0.5 * float(np.dot(x[:-1], y[1:]) - np.dot(y[:-1], x[1:]))


@dataclass(frozen=True, eq=False)
class Polygon:
    """A region: `exterior` (n, 2) counter-clockwise, `holes` clockwise; first points are not repeated."""

    exterior: FloatArray
    holes: tuple[FloatArray, ...] = ()

    @classmethod
    def of(cls, exterior: ArrayLike, holes: Iterable[ArrayLike] = ()) -> Polygon:
        """A polygon from rings in any direction, closed or not."""
        return cls(_directed(exterior, 1.0), tuple(_directed(hole, -1.0) for hole in holes))

    @property
    def area(self) -> float:
        """Area in m², holes subtracted."""
        return ring_area(self.exterior) + sum(ring_area(hole) for hole in self.holes)

    @property
    def rings(self) -> tuple[FloatArray, ...]:
        return (self.exterior, *self.holes)


def _directed(ring: ArrayLike, sign: float) -> FloatArray:
    points = np.asarray(ring, dtype=np.float64).reshape(-1, 2)
    if len(points) > 1 and np.array_equal(points[0], points[-1]):
        points = points[:-1]
    if ring_area(points) * sign < 0:
        points = points[::-1]
    return frozen(points)


def closed(ring: FloatArray) -> FloatArray:
    """The ring with its first point repeated at the end."""
    return np.concatenate([ring, ring[:1]])


def is_closed(line: FloatArray) -> bool:
    """True if a line (n, 2) ends where it begins."""
    return len(line) > 2 and bool(np.allclose(line[0], line[-1]))


def outlines(polygons: Iterable[Polygon]) -> list[FloatArray]:
    """Every ring of the polygons as a closed line."""
    return [closed(ring) for polygon in polygons for ring in polygon.rings]


def bounds(parts: Iterable[FloatArray]) -> tuple[float, float, float, float]:
    """(min x, min y, max x, max y) in metres over all points of `parts`; zeros if there are none."""
    arrays = [part for part in parts if len(part)]
    if not arrays:
        return (0.0, 0.0, 0.0, 0.0)
    points = np.concatenate(arrays)
    low, high = points.min(axis=0), points.max(axis=0)
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


def polyline_length(points: FloatArray) -> float:
    """Length in metres of a polyline (n, 2)."""
    if len(points) < 2:
        return 0.0
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
