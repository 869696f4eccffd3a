"""Paths of a graph, checked where a plug-in computed them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.console.plugins import Variant
from stopgo.mission.geometry import FloatArray, IntArray, frozen, polyline_length
from stopgo.planner.routing.paths import Paths

TOLERANCE = 1e-6
"""Largest error in metres of a path's ends and of its length."""
ROUNDING = 1e-9
"""Fraction and metres by which a path may be longer in one direction, because its pieces are added up."""


@dataclass(frozen=True, eq=False)
class Legs:
    """Paths between points (n, 2), by a graph of the settings."""

    graph: Variant[Any]
    paths: Paths
    points: FloatArray

    def __post_init__(self) -> None:
        if self.graph.ours:
            return
        with self.graph.named_errors():
            lengths = self.lengths
        count = len(self.points)
        finite = self.graph.array(np.where(np.isposinf(lengths), 0.0, lengths), "lengths", (count, count))
        if (finite < 0).any() or np.diag(finite).any():
            raise self.graph.wrong("lengths are not all positive, and 0 from a point to itself")
        if not np.allclose(lengths, lengths.T, rtol=ROUNDING, atol=ROUNDING):
            raise self.graph.wrong("lengths differ by direction")

    @property
    def lengths(self) -> FloatArray:
        """(n, n) in metres; infinite where there is no path."""
        return np.asarray(self.paths.lengths, dtype=np.float64)

    @property
    def are_over_pieces(self) -> bool:
        """True if `path` is that of `Paths`, over pieces that are known."""
        return type(self.paths).path is Paths.path

    def path(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one point to another, both included: the same in both directions."""
        if start > end:
            return frozen(self.path(end, start)[::-1])
        if self.graph.ours:
            return self.paths.path(start, end)
        with self.graph.named_errors():
            given = self.paths.path(start, end)
        line = frozen(self.graph.array(given, "a path", (None, 2)))
        ends = self.points[[start, end]]
        if not len(line) or np.abs(line[[0, -1]] - ends).max() > TOLERANCE:
            raise self.graph.wrong(f"the path from point {start} to point {end} does not lead there")
        stated = float(self.lengths[start, end])
        if abs(polyline_length(line) - stated) > TOLERANCE * max(1.0, stated):
            raise self.graph.wrong(f"a path of {stated:.6f} m is {polyline_length(line):.6f} m long")
        return line


@dataclass(frozen=True, eq=False)
class SomeLegs:
    """Paths between some of the points of others."""

    legs: Legs
    which: IntArray
    """Indices of these points."""

    @property
    def lengths(self) -> FloatArray:
        """(n, n) in metres."""
        return self.legs.lengths[np.ix_(self.which, self.which)]

    def path(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one of these points to another."""
        return self.legs.path(int(self.which[start]), int(self.which[end]))
