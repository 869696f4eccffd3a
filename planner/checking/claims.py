"""Mission + navigable space -> coverage claims that a recount, line by line, does not confirm.

The recount uses the stops of the mission, and tests every line of sight against every wall. Of the data
behind the plan's own figures it uses only the floor's faces and their units.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from msgspec import UNSET

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.problems import Problem
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import DIGITS, Coverage
from stopgo.mission.geometry import BoolArray, IntArray, frozen
from stopgo.mission.stages import Candidates, NavigableSpace, Visibility, weights_of
from stopgo.mission.stages.coverage_totals import totals_of
from stopgo.mission.stages.figures import percent
from stopgo.planner.candidates import STRATEGIES, candidates
from stopgo.planner.checking.coverage_claims import OTHER_FLOOR, coverage_overclaims
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.space.reach import reach_of
from stopgo.planner.visibility.exact_sight import sides_of_doors, viewpoints_of
from stopgo.planner.visibility.headings import in_view, with_headings
from stopgo.planner.visibility.sight.sightlines import SightLines
from stopgo.planner.visibility.unit_ranges import visibility_of

ROUNDED = 10.0**-DIGITS
"""Tolerance of fractions in coverage.json, which come from rounded lengths."""
APART = (math.sqrt(5.0) - 1.0) / 2.0
"""Multiples of it, without their whole part, are spread evenly from the first ones on."""
NOISE = 1e-12
"""Fractions that differ by less are equal: they are quotients of whole numbers."""


@dataclass(frozen=True, eq=False)
class Recount:
    """Recounted visibility: units seen by the stops, and units visible from the candidates."""

    space: NavigableSpace
    by_stop: tuple[IntArray, ...]
    """Units that each stop sees, ascending."""
    candidate_views: IntArray | None
    """Number of candidates that see each unit, up to the required views; None if unknown."""
    why_not: str = ""
    """Reason why it is unknown."""

    @cached_property
    def visible(self) -> BoolArray | None:
        """True for each unit that is visible from a candidate; None if unknown."""
        return None if self.candidate_views is None else frozen(self.candidate_views > 0, np.bool_)

    @cached_property
    def seen(self) -> BoolArray:
        """True for each unit that enough stops see; if the required number is unknown, any stop."""
        views = np.zeros(self.space.targets.total, dtype=np.int64)
        for units in self.by_stop:
            views[units] += 1
        return frozen(
            views >= (1 if self.candidate_views is None else np.maximum(1, self.candidate_views)), np.bool_
        )

    @property
    def share(self) -> float | None:
        """Fraction of the visible units that the stops see, by the plan's rule."""
        if self.visible is None or not self.visible.any():
            return None
        weight = weights_of(self.space.targets, self.space.settings)
        return float(weight[self.seen & self.visible].sum() / weight[self.visible].sum())

    def in_words(self) -> str:
        """Return one line for a person."""
        seen = int(self.seen.sum())
        if self.visible is None:
            return f"{seen} units, counted line by line; total unknown: {self.why_not}"
        share = "nothing" if self.share is None else percent(self.share, digits=3)
        seen = int((self.seen & self.visible).sum())
        return f"{share} ({seen} of {self.visible.sum()} units), counted line by line"

    def as_json(self) -> dict[str, Any]:
        """Return the object for `--json`; null where a value is unknown."""
        visible = None if self.visible is None else int(self.visible.sum())
        seen = self.seen if self.visible is None else self.seen & self.visible
        return {"seen": int(seen.sum()), "visible": visible, "share": self.share}


def recount(mission: Mission, space: NavigableSpace) -> Recount:
    """Count the units that the mission's stops see, and the units visible from any candidate."""
    lines = SightLines(space)
    by_stop = tuple(_seen_from(stop, space, lines) for stop in mission.stops)
    try:
        views = _candidate_views(candidates_of(mission, space), lines)
    except (NegativeResult, InputError) as error:
        return Recount(space, by_stop, None, str(error))
    return Recount(space, by_stop, views)


def _seen_from(stop: Stop, space: NavigableSpace, lines: SightLines) -> IntArray:
    """Units that a stop sees along its heading."""
    xy = np.array([stop.x, stop.y])
    closed_door = stop.doorway and space.settings.doors == "closed" and bool(space.openings)
    eyes = sides_of_doors(space, xy[None])[0] if closed_door else xy[None]
    units = np.unique(np.concatenate([lines.seen_from(eye, scanner=xy) for eye in eyes]))
    if space.settings.fov >= 360:
        return units
    direction = space.targets.unit_xy[units] - xy
    return units[in_view(direction, stop.heading, fov=math.radians(space.settings.fov))]


def candidates_of(mission: Mission, space: NavigableSpace) -> Candidates:
    """All candidates in the mission's part of the floor."""
    if space.settings.candidates not in STRATEGIES:
        raise InputError(
            f"--candidates {space.settings.candidates} come from a plugin, which the check does not run"
        )
    positions = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    parts = reach_of(space).part_at(positions - local_origin(space.floor))
    counts = Counter(parts[parts >= 0].tolist())
    if not counts:
        raise InputError("the robot can reach no stop")
    return candidates(space, part=counts.most_common(1)[0][0])


def _candidate_views(found: Candidates, lines: SightLines) -> IntArray:
    """Number of candidates that see each unit, up to the required views.

    Candidates that count for overlap only are left out.
    """
    if found.space.settings.fov < 360 and (len(found.must_rows) or len(found.doorway_rows)):
        return frozen(_seen_by_heading(found, lines).visible, np.int64)
    seen_by = _viewer(found, lines)
    views = np.zeros(found.space.targets.total, dtype=np.int64)
    rows = np.setdiff1d(np.arange(len(found.kept)), found.extra_rows)
    from_all_over = rows[np.argsort(rows * APART % 1.0)]  # so most units are seen soon
    is_left = np.ones(len(views), dtype=bool)
    for k in from_all_over.tolist():
        seen = seen_by(k, is_left)
        views[seen] += 1
        is_left[seen] = views[seen] < found.space.settings.least_views
    return frozen(views, np.int64)


def candidates_by_heading(mission: Mission, space: NavigableSpace) -> Candidates:
    """All candidates in the mission's part; with a field of view, one for each heading of the scanner."""
    found = candidates_of(mission, space)
    return found if space.settings.fov >= 360 else _seen_by_heading(found, SightLines(space)).candidates


def _seen_by_heading(found: Candidates, lines: SightLines) -> Visibility:
    """Units that each candidate sees along each heading of the scanner."""
    seen = map(_viewer(found, lines), range(len(found.kept)))
    return with_headings(visibility_of(found, seen, method="line by line"))


def _viewer(found: Candidates, lines: SightLines) -> Callable[..., IntArray]:
    """Return the function of the units that a kept candidate sees all round, among some of them if given."""
    eyes, row = viewpoints_of(found)
    scanners = found.xy[found.kept]
    first = np.searchsorted(row, np.arange(len(scanners) + 1)).tolist()

    def seen_by(k: int, among: BoolArray | None = None) -> IntArray:
        own = eyes[first[k] : first[k + 1]]
        views = [lines.seen_from(eye, among, scanner=scanners[k]) for eye in own]
        return views[0] if len(views) == 1 else np.unique(np.concatenate(views))

    return seen_by


def overclaims(mission: Mission, counted: Recount, coverage: Coverage | None) -> Iterator[Problem]:
    """Every figure of the mission, and of its coverage.json, that exceeds the recount."""
    for index, (stop, units) in enumerate(zip(mission.stops, counted.by_stop, strict=True)):
        if len(units) < stop.sees.units:
            yield _less(f"$.stops[{index}].sees.units", stop.sees.units, len(units), f"{stop.id} sees")
    claimed, seen = sum(stop.sees.new_units for stop in mission.stops), int(counted.seen.sum())
    if seen < claimed:
        yield _less("$.stops[*].sees.new_units", claimed, seen, "all stops see")
    if mission.share is UNSET and claimed:  # else the other missions cover the rest
        yield from _shortfalls(counted)
    if coverage is not None:
        yield from _coverage_overclaims(coverage, mission, counted)


def _shortfalls(counted: Recount) -> Iterator[Problem]:
    """Required coverages, of the whole and of every room and kind, that the stops do not reach."""
    least, share = counted.space.settings.coverage, counted.share
    if share is not None and share < least - NOISE:
        yield Problem("$.origin.parameters.coverage", f"is {least:g}, but the stops see {counted.in_words()}")
    if counted.visible is None:
        return
    found = totals_of(counted.space, counted.visible, frozen([1], np.int64)).coverage(counted.seen)
    for key, groups in (("room_coverage", found.rooms), ("kind_coverage", found.kinds)):
        for item in (item for item in groups if not item.met):
            text = f"is {item.required:g}, but the stops see {percent(item.coverage)} of {item.name}"
            yield Problem(f"$.origin.parameters.{key}", f"{text}, counted line by line")


def _less(path: str, claimed: int, counted: int, who: str) -> Problem:
    return Problem(path, f"is {claimed}, but {who} {counted}, counted line by line")


def _coverage_overclaims(coverage: Coverage, mission: Mission, counted: Recount) -> Iterator[Problem]:
    """Every figure of coverage.json that exceeds the recount, and a floor that is not the mission's."""
    floor, origin = coverage.floor, mission.origin
    if floor is not None and (floor.name, floor.digest) != (origin.floor, origin.floor_digest):
        text = f"is {floor.name}, sha256 {floor.digest[:12]}…, and $.origin"
        yield Problem("coverage $.floor", f"{text} {origin.floor}, {origin.floor_digest[:12]}…; plan again")
    elements = counted.space.floor.elements
    wanted = [k for k, element in enumerate(elements) if element.target]
    if [elements[k].id for k in wanted] != [element.id for element in coverage.elements]:
        yield Problem("coverage $.elements", OTHER_FLOOR)
        return
    told = tuple(_unseen_units(coverage, wanted, counted))
    yield from told
    more = coverage_overclaims(coverage, mission, counted.space, counted.seen, counted.visible)
    yield from (problem for problem in more if problem.path not in {item.path for item in told})


def stated_fractions(mission: Mission, space: NavigableSpace, coverage: Coverage) -> Iterator[Problem]:
    """Every coverage of the whole, a room or a kind in coverage.json that exceeds a recount."""
    for problem in _coverage_overclaims(coverage, mission, recount(mission, space)):
        if problem.path.endswith(".coverage") and ".elements" not in problem.path:
            yield problem


def _unseen_units(coverage: Coverage, wanted: list[int], counted: Recount) -> Iterator[Problem]:
    """Units seen, of all and of each element, that exceed the recount; and the coverage of the whole."""
    targets, elements = counted.space.targets, counted.space.floor.elements
    if (seen := int(counted.seen.sum())) < coverage.total.seen:
        yield _less("coverage $.total.seen", coverage.total.seen, seen, "all stops see")
    share, claimed = counted.share, coverage.total.coverage
    if share is not None and claimed is not None and share < claimed - ROUNDED:
        yield Problem("coverage $.total.coverage", f"is {claimed:g}, but the stops see {counted.in_words()}")
    of = np.bincount(targets.element[targets.unit_segment[counted.seen]], minlength=len(elements))
    for index, element in enumerate(coverage.elements):
        if of[wanted[index]] < element.seen:
            path, who = f"coverage $.elements[{index}].seen", f"of {element.id} all stops see"
            yield _less(path, element.seen, int(of[wanted[index]]), who)
