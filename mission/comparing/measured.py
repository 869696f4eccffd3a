"""A scanner's points on a floor: targets that were hit, their deviations, and unplanned objects."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, Polygon
from stopgo.mission.stages.coverage_totals import CoverageTotals
from stopgo.mission.stages.figures import CoverageByGroup

LEAST_VISIBLE = 0.5
"""Metres, or units, of an element that must have been visible before it is called absent."""
LEAST_EMPTY = 0.9
"""Fraction of its visible part without a point, from which on an element may be absent."""


@dataclass(frozen=True)
class Absent:
    """An element of the plan that the clouds hardly show, though it was visible."""

    id: str
    visible: float
    """Fraction of the element that was visible from the scans."""
    empty: float
    """Fraction of the visible part without a point."""


@dataclass(frozen=True, eq=False)
class Unplanned:
    """An object on the floor that is not in the plan."""

    outline: Polygon
    """Convex, a little wider than the points."""
    hits: int
    """Number of sweeps that hit it, at its most visible position."""
    sweeps: int
    """Number of all sweeps."""

    @property
    def middle(self) -> tuple[float, float]:
        x, y = self.outline.exterior.mean(axis=0)
        return (float(x), float(y))

    @property
    def size_m(self) -> float:
        """Its greatest width or depth."""
        return float(np.ptp(self.outline.exterior, axis=0).max())


@dataclass(frozen=True, eq=False)
class Measured:
    """Points assigned to the floor's targets."""

    totals: CoverageTotals
    """The units of the floor, n of them."""
    hit: BoolArray
    """True for units with a point within the tolerance (n,)."""
    tolerance_m: float
    points: int
    edges_m: FloatArray
    """Bounds of the histogram of deviations (k + 1,); positive lies outside the element."""
    histogram: IntArray
    """Points by element and deviation (elements, k)."""
    unplanned: tuple[Unplanned, ...]
    misplaced_m: tuple[float, ...] | None = None
    """Of the surveying scanner's clouds, how far each lies off the floor: 0 on it, NaN if it fits nowhere.

    None for a laser in the log: it navigates, and its points decide nothing.
    """

    part: BoolArray | None = None
    """Of a mission that shares its floor, true for the units that its stops see (n,): only these count."""

    @property
    def decides(self) -> bool:
        """True for clouds of the surveying scanner."""
        return self.misplaced_m is not None

    @property
    def placing_text(self) -> str:
        """Return the reason why the clouds cannot be compared with the floor; empty if all lie on it."""
        off = [away for away in self.misplaced_m or () if away != 0]
        if not off:
            return ""
        shifted = [away for away in off if np.isfinite(away)]
        how = f"they fit it if shifted by {max(shifted):.1f} m" if shifted else "no shift fits them to it"
        count = f"{len(off)} of {len(self.misplaced_m or ())} clouds"
        return f"{count} do not lie on the floor ({how}); give clouds in the drawing's frame"

    def absent(self, visible: BoolArray) -> tuple[Absent, ...]:
        """Return the elements that hardly have a point, though much of them was visible: units (n,)."""
        totals, size = self.totals, len(self.totals.elements)

        def amounts(mask: BoolArray) -> FloatArray:
            weight = np.where(mask, totals.weight, 0).astype(float)
            return np.asarray(np.bincount(totals.element, weight, minlength=size) * totals.scale, np.float64)

        could, did = amounts(visible & totals.visible), amounts(visible & totals.visible & self.hit)
        whole = amounts(totals.visible)
        return tuple(
            Absent(item.id, float(could[k] / whole[k]), float(1 - did[k] / could[k]))
            for k, item in enumerate(totals.elements)
            if could[k] >= LEAST_VISIBLE and did[k] <= (1 - LEAST_EMPTY) * could[k]
        )

    @cached_property
    def coverage(self) -> CoverageByGroup:
        asked = self.totals if self.part is None else self.totals.of_part(self.part)
        return asked.coverage(self.hit)

    @cached_property
    def deviations(self) -> tuple[tuple[str, int, float, float], ...]:
        """Each element with points: id, number of points, and their mean and rms deviation in metres."""
        middles = (self.edges_m[1:] + self.edges_m[:-1]) / 2
        found = []
        for element, counts in zip(self.totals.elements, self.histogram, strict=True):
            many = int(counts.sum())
            if many:
                mean = float((counts * middles).sum() / many)
                rms = float(np.sqrt((counts * middles**2).sum() / many))
                found.append((element.id, many, mean, rms))
        return tuple(found)
