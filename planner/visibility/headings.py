"""A field of view below 360°: each position becomes one candidate per heading of the scanner.

The paper has the field of view as a parameter and plans with v = 360°, where no heading is needed. Below
that the selection chooses the heading with the position. If a stop must look all round, its position is
chosen more than once, each time with another heading.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from stopgo.mission.document.specs import rounded
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.stages import Candidates, Visibility
from stopgo.planner.geometry.room_grid import main_axes
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.visibility.unit_ranges import visibility_of

FEWEST = 8
"""Headings of each position, at least; more where the field of view is below 90°."""
SLACK = 1e-6
"""Radians added to a field of view, so that its rounded limits belong to it."""


def with_headings(seen: Visibility) -> Visibility:
    """The visibility with one row for each candidate and heading.

    Required stops and doorways keep only the heading that sees most, so that one stop is made there. The
    test of a unit's midpoint against heading ± fov / 2 is in floating point.
    """
    candidates = seen.candidates
    fov = math.radians(candidates.settings.fov)
    headings = headings_of(candidates, fov=fov)
    once = set(candidates.must_rows.tolist()) | set(candidates.doorway_rows.tolist())
    views = [list(_views(seen, row, headings, fov=fov, once=row in once)) for row in range(seen.rows)]
    turned = _turned(candidates, [[heading for heading, _ in view] for view in views])
    units = (units for view in views for _, units in view)
    name = f"{seen.method}, field of view {candidates.settings.fov:g}°"
    found = visibility_of(turned, units, method=name)
    return replace(found, in_sight=seen.in_sight, hidden_m=seen.hidden_m)


def headings_of(candidates: Candidates, *, fov: float) -> FloatArray:
    """Headings all round as missions hold them, at most fov / 2 apart, beginning at the floor's main axis.

    Their number is a multiple of four, so that a floor turned by 90° or mirrored has the same ones.
    """
    floor = candidates.floor
    axis = main_axes(to_shape(floor.outline, local_origin(floor)))[0]
    number = 4 * math.ceil(max(FEWEST, 2 * math.tau / fov - 1e-9) / 4)
    first = math.atan2(axis[1], axis[0])
    return frozen([rounded(math.remainder(first + k * math.tau / number, math.tau)) for k in range(number)])


def _views(
    seen: Visibility, row: int, headings: FloatArray, *, fov: float, once: bool
) -> Iterator[tuple[float, IntArray]]:
    """Headings of one position and the units seen along each; with `once` the best one only."""
    candidates, units = seen.candidates, seen.seen_by(row)
    offset = seen.targets.unit_xy[units] - candidates.xy[candidates.kept[row]]
    inside = in_view(offset, headings[:, None], fov=fov)
    wanted = [int(inside.sum(axis=1).argmax())] if once else range(len(headings))
    for k in wanted:
        yield float(headings[k]), units[inside[k]]


def in_view(offset: FloatArray, heading: FloatArray | float, *, fov: float) -> BoolArray:
    """True for points at `offset` (n, 2) from a scanner that are within heading ± fov / 2 (radians)."""
    bearing = np.arctan2(offset[:, 1], offset[:, 0])
    aside = np.abs((bearing - heading + math.pi) % math.tau - math.pi)
    inside: BoolArray = aside <= fov / 2 + SLACK
    return inside


def _turned(candidates: Candidates, headings: list[list[float]]) -> Candidates:
    """The candidates with each kept one repeated for its headings; dropped ones stay as they are."""
    heading_of = {int(index): list(view) for index, view in zip(candidates.kept, headings, strict=True)}
    per_candidate = [heading_of.get(index, [0.0]) for index in range(len(candidates.xy))]
    source = np.repeat(np.arange(len(candidates.xy)), [len(view) for view in per_candidate])
    return replace(
        candidates,
        xy=frozen(candidates.xy[source]),
        room=frozen(candidates.room[source], np.int64),
        reason=frozen(candidates.reason[source], np.int64),
        part=frozen(candidates.part[source], np.int64),
        doorway=frozen(candidates.doorway[source] if len(candidates.doorway) else [], np.bool_),
        must=frozen(candidates.must[source] if len(candidates.must) else [], np.bool_),
        extra=frozen(candidates.extra[source] if len(candidates.extra) else [], np.bool_),
        heading=frozen(np.concatenate([np.empty(0), *per_candidate])),
    )
