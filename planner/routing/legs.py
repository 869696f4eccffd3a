"""The ways of a graph, held against what they must be where another's program gave them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from stopgo.mission.console.plugins import Variant
from stopgo.mission.geometry import FloatArray, frozen, polyline_length
from stopgo.planner.routing.ways import Ways

TOLERANCE = 1e-6
"""Metres by which a way may miss its ends, or its length."""


@dataclass(frozen=True, eq=False)
class Legs:
    """Ways between points (n, 2), by a graph of the settings."""

    graph: Variant[Any]
    ways: Ways
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
        if not np.array_equal(lengths, lengths.T):
            raise self.graph.wrong("lengths differ by direction")

    @property
    def lengths(self) -> FloatArray:
        """(n, n) in metres; infinite where there is no way."""
        return np.asarray(self.ways.lengths, dtype=np.float64)

    def way(self, start: int, end: int) -> FloatArray:
        """The polyline (n, 2) from one point to another, both included."""
        if self.graph.ours:
            return self.ways.way(start, end)
        with self.graph.named_errors():
            given = self.ways.way(start, end)
        line = frozen(self.graph.array(given, "a way", (None, 2)))
        ends = self.points[[start, end]]
        if not len(line) or np.abs(line[[0, -1]] - ends).max() > TOLERANCE:
            raise self.graph.wrong(f"the way from point {start} to point {end} does not lead there")
        told = float(self.lengths[start, end])
        if abs(polyline_length(line) - told) > TOLERANCE * max(1.0, told):
            raise self.graph.wrong(f"a way of {told:.6f} m is {polyline_length(line):.6f} m long")
        return line
