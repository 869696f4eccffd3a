"""Figures of a coverage.json -> those that exceed a recount, or are of another floor or network."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import msgspec
import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import Problem
from stopgo.mission.errors import InputError
from stopgo.mission.files.coverage_json import (
    Coverage,
    CoverageRoom,
    CoverageSums,
    room_row,
)
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, frozen
from stopgo.mission.stages import NavigableSpace, Targets
from stopgo.mission.stages.coverage_totals import totals_of
from stopgo.mission.stages.network import network_of, network_table

ROUNDED = 2e-4
"""Tolerance of metres in coverage.json, which are rounded."""
SAME_PLACE_M = 1e-4
"""Tolerance for the ends of segments in coverage.json, which are rounded."""
OTHER_FLOOR = "are not those of the floor; plan again"
FRACTION = 2e-6
"""Tolerance of fractions in coverage.json, which are rounded."""
NO_MORE = ("seen", "seen_m", "coverage")
"""Figures that a recount must reach."""
NO_LESS = ("visible", "visible_m")
"""Figures that a recount must not exceed: they are what coverage is a fraction of."""
EXACT = ("units", "length_m", "total")
"""Figures of the floor itself."""


def claimed_units(coverage: Coverage, targets: Targets, floor: FloorPlan) -> BoolArray:
    """Return True for each unit that coverage.json reports as seen.

    Raises
    ------
    InputError
        If a segment is not on the floor, or its fractions are not within 0 to 1.
    """
    claimed = np.zeros(targets.total, dtype=bool)
    rows = {item.id: list(item.segments) for item in coverage.elements}
    for segment, element in enumerate(targets.element.tolist()):
        name = floor.elements[element].id
        if not rows.get(name):
            raise _other_reading(name)
        row = rows[name].pop(0)
        ends = np.array([row.a, row.b]) - np.array([targets.a[segment], targets.b[segment]])
        if np.abs(ends).max() > SAME_PLACE_M or not all(0 <= a <= b <= 1 for a, b in row.seen):
            raise _other_reading(name)
        first, count = int(targets.first_unit[segment]), int(targets.units[segment])
        for begin, end in row.seen:
            claimed[first + round(begin * count) : first + round(end * count)] = True
    return frozen(claimed, np.bool_)


def _other_reading(element: str) -> InputError:
    return InputError(f"coverage.json: position of {element} differs from this floor; plan again")


def coverage_overclaims(
    coverage: Coverage, mission: Mission, space: NavigableSpace, seen: BoolArray, visible: BoolArray | None
) -> Iterator[Problem]:
    """Every figure by kind, element and room that exceeds the recount, and every segment.

    `seen` is True for the units that enough stops see, `visible` for those that any candidate sees, if known.
    """
    elements = space.floor.elements
    rows = [k for k, element in enumerate(elements) if element.target]
    sums = CoverageSums.of(space, seen if visible is None else visible, seen)
    yield from _beyond("$.total", coverage.total, sums.summary(rows), known=visible is not None)
    yield from _kinds(coverage, space, sums, known=visible is not None)
    for index, (row, claim) in enumerate(zip(rows, coverage.elements, strict=True)):
        path = f"$.elements[{index}]"
        yield from _beyond(path, claim, sums.of_element(row), known=visible is not None)
        if claim.global_id != elements[row].global_id:
            yield Problem(f"coverage {path}.global_id", f"is not that of {claim.id}")
    yield from _segments(coverage, space, seen)
    if visible is not None:
        yield from _rooms(coverage.rooms, space, seen, visible)
    if coverage.network is not None and coverage.network != _network(mission):
        yield Problem("coverage $.network", "is not that of the mission; plan again")


def _beyond(path: str, claim: msgspec.Struct, counted: dict[str, Any], *, known: bool) -> Iterator[Problem]:
    """Every figure of a row that the recount does not confirm; of seen ones only if the rest is unknown."""
    for key in (*EXACT, *(NO_LESS if known else ()), *NO_MORE):
        claimed = getattr(claim, key, None)
        if claimed is None or key not in counted or (key == "coverage" and not known):
            continue
        found = counted[key] or 0
        slack = FRACTION if key == "coverage" else ROUNDED
        too_much, too_little = claimed - found > slack, found - claimed > slack
        if (too_much and key not in NO_LESS) or (too_little and key not in NO_MORE):
            yield Problem(f"coverage {path}.{key}", f"is {claimed:g}, but {found:g} are counted line by line")


def _kinds(
    coverage: Coverage, space: NavigableSpace, sums: CoverageSums, *, known: bool
) -> Iterator[Problem]:
    rows: dict[str, list[int]] = {}
    for k, element in enumerate(space.floor.elements):
        if element.target:
            rows.setdefault(element.kind, []).append(k)
    if coverage.kinds and coverage.kinds.keys() != rows.keys():
        yield Problem("coverage $.kinds", OTHER_FLOOR)
        return
    for kind, claim in coverage.kinds.items():
        yield from _beyond(f"$.kinds.{kind}", claim, sums.summary(rows[kind]), known=known)


def _segments(coverage: Coverage, space: NavigableSpace, seen: BoolArray) -> Iterator[Problem]:
    """The first element with a segment that is not on the floor, or that the stops do not see."""
    targets = space.targets
    try:
        beyond = claimed_units(coverage, targets, space.floor) & ~seen
    except InputError as error:
        yield Problem("coverage $.elements", str(error))
        return
    of = np.bincount(targets.element[targets.unit_segment[beyond]], minlength=len(space.floor.elements))
    for row in np.flatnonzero(of).tolist():
        text = f"have {of[row]} units of {space.floor.elements[row].id} that the stops do not see"
        yield Problem("coverage $.elements[*].segments", f"{text}, counted line by line")


def _rooms(
    claims: tuple[CoverageRoom, ...], space: NavigableSpace, seen: BoolArray, visible: BoolArray
) -> Iterator[Problem]:
    """Every figure of a room; rooms of one name are compared in the order of their targets."""
    found: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for group in totals_of(space, visible, frozen([1], np.int64)).coverage(seen).rooms:
        found[group.name].append(room_row(group))
    claimed: dict[str, list[tuple[int, CoverageRoom]]] = defaultdict(list)
    for index, claim in enumerate(claims):
        claimed[claim.room].append((index, claim))
    if claims and {name: len(rows) for name, rows in found.items()} != {
        name: len(rows) for name, rows in claimed.items()
    }:
        yield Problem("coverage $.rooms", OTHER_FLOOR)
        return
    for name, same in claimed.items():
        of_name = sorted(same, key=lambda item: (item[1].total or 0, item[1].seen or 0))
        counted = sorted(found[name], key=lambda row: (row["total"], row["seen"]))
        for (index, claim), row in zip(of_name, counted, strict=True):
            yield from _beyond(f"$.rooms[{index}]", claim, row, known=True)


def _network(mission: Mission) -> Any:
    """Return the network of a mission as coverage.json has it."""
    return msgspec.json.decode(msgspec.json.encode(network_table(network_of(mission)).get("network")))
