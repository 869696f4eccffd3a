"""Results of the stages between a floor and a mission; each keeps the result it was made from.

Distances are metres, areas m², angles radians counter-clockwise from +x. Arrays are read-only.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from stopgo.mission.floor import Element, Finding, FloorPlan, Opening, Room
from stopgo.mission.geometry import (
    BoolArray,
    FloatArray,
    IntArray,
    Polygon,
    frozen,
    polyline_length,
    read_only,
)
from stopgo.mission.settings import Settings


@dataclass(frozen=True, eq=False)
class Targets:
    """Boundary to scan: segments, each cut into units of at most d_dis (paper, 3.1)."""

    a: FloatArray
    """Start of each segment (m, 2)."""
    b: FloatArray
    """End of each segment (m, 2)."""
    units: IntArray
    """Units on each segment (m,); unit i of n lies at the fraction (i + 1/2) / n from a to b."""
    element: IntArray
    """Index of each segment's element in `FloorPlan.elements` (m,)."""
    occluding: BoolArray
    """True where the segment is a face of an occluding solid, seen from outside only (m,)."""
    raw: dict[str, int]
    """Units per kind before touching solids are unioned, the paper's Table 2."""

    @property
    def total(self) -> int:
        """Number of units."""
        return int(self.units.sum())

    @cached_property
    def first_unit(self) -> IntArray:
        """Number of the first unit of each segment, and the total at the end (m + 1,)."""
        return frozen(np.concatenate([[0], np.cumsum(self.units)]), np.int64)

    @cached_property
    def unit_segment(self) -> IntArray:
        """Segment of each unit (n,)."""
        return frozen(np.repeat(np.arange(len(self.units)), self.units), np.int64)

    @cached_property
    def unit_xy(self) -> FloatArray:
        """Midpoint of each unit (n, 2)."""
        within = np.arange(self.total) - self.first_unit[:-1][self.unit_segment]
        t = (within + 0.5) / self.units[self.unit_segment]
        a, b = self.a[self.unit_segment], self.b[self.unit_segment]
        return frozen(a + t[:, None] * (b - a))

    @cached_property
    def unit_length(self) -> FloatArray:
        """Length of each unit in metres (n,)."""
        return frozen((np.hypot(*(self.b - self.a).T) / self.units)[self.unit_segment])

    def by_kind(self, elements: tuple[Element, ...]) -> dict[str, int]:
        """Units per element kind."""
        counts: dict[str, int] = {}
        for index, units in zip(self.element, self.units, strict=True):
            kind = elements[int(index)].kind
            counts[kind] = counts.get(kind, 0) + int(units)
        return dict(sorted(counts.items()))


@dataclass(frozen=True, eq=False)
class OpeningState:
    """Passability of an opening for the robot."""

    opening: Opening
    rooms: tuple[int | None, int | None]
    """Indices into `FloorPlan.rooms` of the rooms on its two sides."""
    clear_width: float
    """Widest clear stretch of the line between obstacles."""
    middle: FloatArray
    """Middle of this stretch (2,); of the line if obstacles fill it."""
    passable: bool
    why: str
    """Empty when passable, else the reason in words."""


@dataclass(frozen=True, eq=False)
class RoomSpace:
    """Area of a room where stops may be (for pictures and areas: points are decided exactly)."""

    room: int | None
    """Index into `FloorPlan.rooms`; None for the floor outside every room."""
    name: str
    area: tuple[Polygon, ...]
    """The room itself, as planned, without the rooms inside it."""
    stop_area: tuple[Polygon, ...]
    """Points at least d_sec from every element and `edge` from floor edges."""


@dataclass(frozen=True, eq=False)
class NavigableSpace:
    """Area for the robot's centre, and the targets of the scans."""

    floor: FloorPlan
    settings: Settings
    rooms: tuple[RoomSpace, ...]
    openings: tuple[OpeningState, ...]
    obstacles: tuple[Polygon, ...]
    """Everything from which a robot must keep its distance, unioned."""
    occluders: tuple[Polygon, ...]
    """Everything that blocks a laser, unioned."""
    barriers: FloatArray
    """Openings that are not driven through, as segments (k, 2, 2)."""
    drive_area: tuple[Polygon, ...]
    """Area in which the robot's centre may drive."""
    gaps: FloatArray
    """Straight crossings (k, 2, 2) of openings exactly as wide as the robot, between drive areas."""
    targets: Targets
    unit_room: IntArray
    """Index into `rooms` of the room that each unit faces, -1 where it faces none (units,)."""
    ground: tuple[Polygon, ...] = ()
    """The floor layer and the floor under inner openings."""
    findings: tuple[Finding, ...] = ()


class HasSpace(Protocol):
    """A result that was made in a navigable space."""

    @property
    def space(self) -> NavigableSpace: ...


class InSpace:
    """Floor, parameters and targets of a result, from its navigable space."""

    @property
    def floor(self: HasSpace) -> FloorPlan:
        return self.space.floor

    @property
    def settings(self: HasSpace) -> Settings:
        return self.space.settings

    @property
    def targets(self: HasSpace) -> Targets:
        return self.space.targets


class HasVisibility(Protocol):
    """A result that was made from a visibility."""

    @property
    def visibility(self) -> Visibility: ...


class OfVisibility(InSpace):
    """Candidates and navigable space of a result, from its visibility."""

    @property
    def candidates(self: HasVisibility) -> Candidates:
        return self.visibility.candidates

    @property
    def space(self: HasVisibility) -> NavigableSpace:
        return self.visibility.space


def weights_of(targets: Targets, settings: Settings) -> IntArray:
    """Return each unit's weight in a coverage (n,): its length in micrometres, or 1 by the paper's rule."""
    if settings.coverage_rule == "paper":
        return frozen(np.ones(targets.total), np.int64)
    return frozen(np.maximum(1, np.rint(targets.unit_length * 1e6)), np.int64)


DROP_REASONS = (
    "kept",
    "outside the room",
    "in a hole",
    "closer than d_sec to an element",
    "closer than the edge distance to a floor edge",
    "not reachable by the robot",
    "in another part of the floor",
    "in a circle to avoid",
    "triangle too small",
    "sliver triangle",
)
"""Reasons why a candidate was dropped; `Candidates.reason` holds indices into this."""
KEPT, OUTSIDE, IN_HOLE, TOO_CLOSE, AT_EDGE, UNREACHABLE, OTHER_PART, AVOIDED, TOO_SMALL, SLIVER = range(
    len(DROP_REASONS)
)


@dataclass(frozen=True, eq=False)
class Candidates(InSpace):
    """Possible scan positions, with the dropped ones, each with the reason."""

    space: NavigableSpace
    xy: FloatArray
    """Positions (n, 2)."""
    room: IntArray
    """Index into `NavigableSpace.rooms` (n,)."""
    reason: IntArray
    """Index into DROP_REASONS (n,)."""
    part: IntArray
    """Part of the floor of each reachable candidate, else -1 (n,)."""
    strategy: str
    chosen_part: int = 0
    """The part that this plan is of."""
    part_area: tuple[float, ...] = ()
    """Free area of each part, m²."""
    doorway: BoolArray = field(default_factory=lambda: frozen([], np.bool_))
    """True for candidates in a doorway (n,); empty if there is none."""
    must: BoolArray = field(default_factory=lambda: frozen([], np.bool_))
    """True for required stops (n,); empty if there is none."""
    extra: BoolArray = field(default_factory=lambda: frozen([], np.bool_))
    """True for candidates that only save or connect stops, and do not count for what is visible (n,)."""
    heading: FloatArray = field(default_factory=lambda: frozen([]))
    """The scanner's heading at each candidate (n,); empty if the scanner sees all round."""

    @cached_property
    def kept(self) -> IntArray:
        """Indices of the reachable candidates."""
        return frozen(np.flatnonzero(self.reason == KEPT), np.int64)

    @cached_property
    def generated(self) -> int:
        """Number of different generated positions inside rooms, reachable or not."""
        never = [OUTSIDE, IN_HOLE, TOO_SMALL, SLIVER]
        return len(np.unique(self.xy[~np.isin(self.reason, never)], axis=0))

    @cached_property
    def reachable(self) -> int:
        """Positions where a stop may be; a scanner with a limited view has several headings there."""
        return len(np.unique(self.xy[self.kept], axis=0))

    @cached_property
    def doorway_rows(self) -> IntArray:
        """Rows (indices into `kept`) of the candidates in doorways."""
        return self._rows_where(self.doorway)

    @cached_property
    def must_rows(self) -> IntArray:
        """Rows (indices into `kept`) of the required stops."""
        return self._rows_where(self.must)

    @cached_property
    def extra_rows(self) -> IntArray:
        """Rows (indices into `kept`) of the candidates that do not count for what is visible."""
        return self._rows_where(self.extra)

    def _rows_where(self, flag: BoolArray) -> IntArray:
        return frozen(np.flatnonzero(flag[self.kept]) if len(flag) else [], np.int64)


RUNS_AT_A_TIME = 1_000_000
"""Runs that are sorted or counted at a time, for the memory that this takes."""


@dataclass(frozen=True, eq=False)
class Visibility(InSpace):
    """Units that each reachable candidate sees, as runs of units on segments.

    Run k of candidate row c, `pointer[c] <= k < pointer[c + 1]`, means that units `first[k]` to `last[k]`
    (inclusive, counted over all targets) are visible on `segment[k]`.
    """

    candidates: Candidates
    pointer: IntArray
    segment: IntArray
    """Whole numbers of 32 bits, as are `first` and `last`, or of 64: long ranges have many runs (runs,)."""
    first: IntArray
    last: IntArray
    method: str
    in_sight: Visibility | None = None
    """Line of sight alone, without the limits; None if that is the same."""
    hidden_m: float = 0.0
    """Length of targets that level rays reach, and no ray at the target's own heights: they do not count."""

    @property
    def space(self) -> NavigableSpace:
        return self.candidates.space

    @property
    def rows(self) -> int:
        """Number of candidates, in the order of `candidates.kept`."""
        return len(self.pointer) - 1

    def seen_by(self, row: int) -> IntArray:
        """Return the units that the candidate of this row sees, ascending."""
        start, stop = int(self.pointer[row]), int(self.pointer[row + 1])
        if start == stop:
            return frozen([], np.int64)
        order = np.argsort(self.first[start:stop], kind="stable")
        first, last = self.first[start:stop][order], self.last[start:stop][order]
        lengths = last - first + 1
        offsets = np.repeat(first - np.concatenate([[0], np.cumsum(lengths)[:-1]]), lengths)
        units = np.arange(int(lengths.sum())) + offsets
        apart = bool(np.all(first[1:] > last[:-1]))
        return frozen(units if apart else np.unique(units), np.int64)

    @cached_property
    def runs_apart(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Row, segment, first and last unit of equivalent runs (k,), with no unit twice in a row.

        They are sorted by row and, within a row, by unit.
        """
        parts = zip(*self.runs_apart_by_rows(), strict=True)
        a, b, c, d = (read_only(np.concatenate(part)) for part in parts)
        return a, b, c, d

    def runs_apart_by_rows(self) -> Iterator[tuple[IntArray, IntArray, IntArray, IntArray]]:
        """The same for some rows after the other, for the memory that all runs take."""
        for low, high in self._blocks():
            own, kind = slice(self.pointer[low], self.pointer[high]), self.first.dtype
            row = np.repeat(np.arange(low, high), np.diff(self.pointer[low : high + 1]))
            row, first, last = _in_order(row, self.first[own], self.last[own])
            far = row * (self.targets.total + 1)
            reached = np.maximum.accumulate(last + far) - far
            same = np.diff(row) == 0
            after = np.where(same, np.maximum(first[1:], reached[:-1] + 1), first[1:])
            first = np.concatenate([first[:1], after])
            real = first <= last
            row, first, last = (array[real].astype(kind) for array in (row, first, last))
            yield row, self.targets.unit_segment[first].astype(kind), first, last

    def _blocks(self) -> Iterable[tuple[int, int]]:
        """The first row and the row after the last one, of the rows of some runs at a time."""
        begins = np.searchsorted(self.pointer, np.arange(0, len(self.first), RUNS_AT_A_TIME))
        rows = np.unique([0, *begins.tolist(), self.rows]).tolist()
        return itertools.pairwise(rows if len(rows) > 1 else [0, 0])

    @cached_property
    def units_seen(self) -> IntArray:
        """Number of units that each candidate sees (rows,)."""
        counts = np.zeros(self.rows, dtype=np.int64)
        for row, _, first, last in self.runs_apart_by_rows():
            before = np.concatenate([[0], np.cumsum(last - first + 1, dtype=np.int64)])
            begin, end = int(row.min(initial=self.rows)), int(row.max(initial=-1)) + 1
            counts[begin:end] += np.diff(before[np.searchsorted(row, np.arange(begin, end + 1))])
        return frozen(counts, np.int64)

    @cached_property
    def visible(self) -> BoolArray:
        """True for units that any candidate sees, except those that do not count (n,)."""
        return self._seen_by_any(self._pattern)

    @cached_property
    def asked(self) -> IntArray:
        """Number of stops that must see each unit until it counts (n,).

        It is the required number of views. If fewer candidates see a unit, it is their number, so that
        a stricter requirement never makes a floor impossible.
        """
        most = self.settings.least_views
        views = np.ones(self.targets.total) if most == 1 else self.views_from(self._pattern)
        return frozen(np.clip(views, 1, most), np.int64)

    def seen_from(self, rows: IntArray) -> BoolArray:
        """Return True for units that enough of the candidates in `rows` see (n,)."""
        if self.settings.least_views == 1:
            return self._seen_by_any(rows)
        return frozen(self.views_from(rows) >= self.asked, np.bool_)

    def views_from(self, rows: IntArray) -> IntArray:
        """Return the number of candidates in `rows` that see each unit (n,)."""
        views = np.zeros(self.targets.total, dtype=np.int64)
        for row in rows:
            views[self.seen_by(int(row))] += 1
        return frozen(views, np.int64)

    @property
    def _pattern(self) -> IntArray:
        """Rows of the candidates that were not added near chosen ones."""
        return np.setdiff1d(np.arange(self.rows), self.candidates.extra_rows)

    def _seen_by_any(self, rows: IntArray) -> BoolArray:
        taken, most = np.zeros(self.rows, dtype=bool), self.targets.total + 1
        taken[rows] = True
        change = np.zeros(most, dtype=np.int64)
        for low, high in self._blocks():
            own = slice(self.pointer[low], self.pointer[high])
            runs = np.repeat(taken[low:high], np.diff(self.pointer[low : high + 1]))
            change += np.bincount(self.first[own][runs], minlength=most)
            change -= np.bincount(self.last[own][runs] + 1, minlength=most)
        return frozen(np.cumsum(change[:-1]) > 0, np.bool_)


def _in_order(row: IntArray, first: IntArray, last: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Runs (k,) by row, then by first unit, then by falling last unit.

    If they fit into one number each, the numbers are sorted, which takes a fifth of the time.
    """
    bits = int(last.max(initial=0)).bit_length()
    if len(row) and int(row[-1]).bit_length() + 2 * bits > 62:
        order = np.lexsort((-last, first, row))
        return row[order], first[order].astype(np.int64), last[order].astype(np.int64)
    most = (1 << bits) - 1
    number = (row << 2 * bits) + (first.astype(np.int64) << bits) + (most - last)
    number.sort()
    return number >> 2 * bits, (number >> bits) & most, most - (number & most)


@dataclass(frozen=True, eq=False)
class Selection(OfVisibility):
    """The chosen candidates, in the order they were chosen."""

    visibility: Visibility
    chosen: IntArray
    """Rows of `visibility` (k,)."""
    coverage_steps: FloatArray
    """Coverage after each choice (k,)."""
    required: float
    bound: int
    """Lower bound: no selection with the required coverage has fewer stops."""
    method: str
    everywhere: bool = False
    """True if the bound holds for every possible position, and not only for the candidates."""

    @property
    def among(self) -> str:
        """Range of the bound, in words."""
        return "all places" if self.everywhere else "these candidates"

    @property
    def coverage(self) -> float:
        """Fraction of all visible that the chosen stops see, by the rule of the parameters."""
        return float(self.coverage_steps[-1]) if len(self.coverage_steps) else 0.0

    @cached_property
    def xy(self) -> FloatArray:
        """Positions of the chosen candidates (k, 2)."""
        candidates = self.candidates
        return frozen(candidates.xy[candidates.kept[self.chosen]].reshape(-1, 2))


@dataclass(frozen=True)
class LeastTime:
    """Duration of a route whose stops and order were chosen together, for the least time."""

    seconds: float
    """By the mission's schedule."""
    two_step_s: float
    """Duration with the fewest stops and then a shortest route over them …"""
    two_step_stops: int
    """… and the number of those stops."""
    bound: float
    """Lower bound: no plan over these candidates takes less; of the exact graph none by shortest paths."""

    @property
    def saved_s(self) -> float:
        """Seconds saved against the two steps."""
        return self.two_step_s - self.seconds


@dataclass(frozen=True, eq=False)
class Route(OfVisibility):
    """The order of the stops, and the legs between them."""

    selection: Selection
    order: IntArray
    """Indices into `selection.chosen`, in the order of driving (k,)."""
    start: tuple[float, float, float]
    """Start of the route: x, y, heading."""
    start_reason: str
    approaches: tuple[FloatArray, ...]
    """For each stop in order, the polyline (n, 2) driven to it from the previous stop (or the start)."""
    return_leg: FloatArray | None
    """The polyline back to the start of a closed tour, or on to a given end."""
    tour: str
    """`closed` or `open`."""
    bound: float
    """Lower bound: no route over these stops is shorter."""
    method: str
    time: LeastTime | None = None
    """None if the plan minimises the number of stops."""

    @property
    def visibility(self) -> Visibility:
        return self.selection.visibility

    @cached_property
    def length(self) -> float:
        legs = self.approaches if self.return_leg is None else (*self.approaches, self.return_leg)
        return sum(polyline_length(leg) for leg in legs)

    @cached_property
    def xy(self) -> FloatArray:
        """Stop positions in the order of driving (k, 2)."""
        return frozen(self.selection.xy[self.order].reshape(-1, 2))


@dataclass(frozen=True, eq=False)
class Unreached:
    """A room that the plan does not enter, and the reason."""

    room: str
    why: str
    area_m2: float

    @property
    def text(self) -> str:
        """The room, its area and the reason in one line."""
        return f"{self.room} ({self.area_m2:.1f} m²): {self.why}"


__all__ = [
    "AT_EDGE",
    "AVOIDED",
    "DROP_REASONS",
    "IN_HOLE",
    "KEPT",
    "OTHER_PART",
    "OUTSIDE",
    "SLIVER",
    "TOO_CLOSE",
    "TOO_SMALL",
    "UNREACHABLE",
    "Candidates",
    "LeastTime",
    "NavigableSpace",
    "OfVisibility",
    "OpeningState",
    "Room",
    "RoomSpace",
    "Route",
    "Selection",
    "Targets",
    "Unreached",
    "Visibility",
    "weights_of",
]
