"""Seen units as runs: stretches of consecutive units on one segment."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages import Candidates, Visibility


def visibility_of(candidates: Candidates, seen: Iterable[IntArray], *, method: str) -> Visibility:
    """The visibility in which each kept candidate sees the units given for it, ascending."""
    segments = candidates.targets.unit_segment
    runs = [runs_of(units, segments) for units in seen]
    first = np.concatenate([np.empty(0, np.int64), *(first for first, _ in runs)])
    last = np.concatenate([np.empty(0, np.int64), *(last for _, last in runs)])
    return Visibility(
        candidates=candidates,
        pointer=frozen(np.cumsum([0, *(len(first) for first, _ in runs)]), np.int64),
        segment=frozen(segments[first], np.int64),
        first=frozen(first, np.int64),
        last=frozen(last, np.int64),
        method=method,
    )


def runs_of(units: IntArray, segments: IntArray) -> tuple[IntArray, IntArray]:
    """First and last units of the runs in ascending `units`; `segments` has the segment of every unit."""
    segment = segments[units]
    new = np.ones(len(units), dtype=bool)
    new[1:] = (np.diff(units) != 1) | (np.diff(segment) != 0)
    starts = np.flatnonzero(new)
    return units[starts], units[np.append(starts[1:], len(units))[: len(starts)] - 1]
