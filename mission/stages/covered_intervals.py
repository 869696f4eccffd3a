"""Covered stretches of the targets' boundary, as runs of units along segments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import Selection, Targets


@dataclass(frozen=True, eq=False)
class SeenStretches:
    """Stretches of boundary; run k lies on `segment[k]`, from fraction `t0[k]` to `t1[k]` of a to b."""

    segment: IntArray
    t0: FloatArray
    t1: FloatArray


def seen_units(selection: Selection) -> BoolArray:
    """Return True for units that enough of the chosen stops see (n,)."""
    return selection.visibility.seen_from(selection.chosen)


def runs_of(targets: Targets, units: BoolArray) -> SeenStretches:
    """Return the units of a mask (n,) joined into runs as long as each segment allows, in segment order."""
    segment, total = targets.unit_segment, targets.total
    joined = units[1:] & units[:-1] & (segment[1:] == segment[:-1])
    first = np.flatnonzero(units & ~np.concatenate([[False], joined])[:total])
    last = np.flatnonzero(units & ~np.concatenate([joined, [False]])[:total])
    on = segment[first]
    begin, count = targets.first_unit[on], targets.units[on]
    return SeenStretches(
        frozen(on, np.int64), frozen((first - begin) / count), frozen((last + 1 - begin) / count)
    )


def lines_along(targets: Targets, units: BoolArray) -> FloatArray:
    """Return the units of a mask (n,) as lines (k, 2, 2), one per run."""
    runs = runs_of(targets, units)
    a, b = targets.a[runs.segment], targets.b[runs.segment]
    return np.stack([a + (b - a) * runs.t0[:, None], a + (b - a) * runs.t1[:, None]], axis=1)
