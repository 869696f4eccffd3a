"""coverage.json: the covered part of each building element, and its position along the faces."""

from __future__ import annotations

from codecs import BOM_UTF8
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from stopgo.mission.document import Mission, digest_of
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import bytes_of
from stopgo.mission.floor import Element
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import NavigableSpace, Route, Targets
from stopgo.mission.stages.covered_intervals import runs_of, seen_units
from stopgo.mission.stages.figures import Figures, GroupCoverage
from stopgo.mission.stages.network import network_of, network_table
from stopgo.mission.stages.seen_area import SeenSurface

DIGITS = 6
"""A micrometre, and a millionth of a segment."""


class CoverageSegment(msgspec.Struct, frozen=True):
    """A straight segment of boundary in metres; `seen` holds its covered fractions from a to b."""

    a: tuple[float, float]
    b: tuple[float, float]
    seen: tuple[tuple[float, float], ...]


class CoverageCounts(msgspec.Struct, frozen=True):
    """Units in all, the visible ones, the seen ones, and the coverage of the visible ones."""

    units: int
    visible: int
    seen: int
    coverage: float | None
    length_m: float | None = None
    visible_m: float | None = None
    seen_m: float | None = None


class CoverageElement(CoverageCounts, frozen=True, kw_only=True):
    id: str
    segments: tuple[CoverageSegment, ...]
    global_id: str | None = None
    """Of the element in the building's model."""


class CoverageRoom(msgspec.Struct, frozen=True):
    """A room by name, and the coverage of its visible targets; amounts in the plan's unit."""

    room: str
    coverage: float | None
    total: float | None = None
    visible: float | None = None
    seen: float | None = None


class CoverageArea(msgspec.Struct, frozen=True):
    """Area in m² of the targets of a kind that count as seen, and its part that rays reach."""

    total_m2: float
    seen_m2: float


class CoverageSurface(msgspec.Struct, frozen=True):
    """Area that the stops see by the solids of the floor's model."""

    height_m: float
    kinds: dict[str, CoverageArea]
    hidden_m: float = 0.0


class CoverageOf(msgspec.Struct, frozen=True):
    id: str
    digest: str
    revision: int = 1


class CoverageFloor(msgspec.Struct, frozen=True):
    name: str
    digest: str


class Coverage(msgspec.Struct, frozen=True):
    """A coverage.json as it is read."""

    schema: Literal["stopgo/coverage"]
    version: Literal[1]
    mission: CoverageOf
    total: CoverageCounts
    elements: tuple[CoverageElement, ...]
    floor: CoverageFloor | None = None
    """The floor of its mission; None if the file has none."""
    kinds: dict[str, CoverageCounts] = {}
    rooms: tuple[CoverageRoom, ...] = ()
    surface: CoverageSurface | None = None
    network: dict[str, Any] | None = None


def read_coverage(path: Path, mission: Mission) -> Coverage:
    """Return the coverage.json of `mission`.

    Raises
    ------
    InputError
        When the file cannot be read, or holds the coverage of another mission.
    """
    data = bytes_of(path, "give a coverage.json").removeprefix(BOM_UTF8)
    try:
        coverage = decoded(data, Coverage)
    except msgspec.DecodeError as error:
        raise InputError(f"{path}: not a coverage.json of this version ({error}); plan again") from None
    _check_mission(coverage.mission, mission, path)
    return coverage


def _check_mission(of: CoverageOf, mission: Mission, path: Path) -> None:
    if of.id != mission.id:
        raise InputError(
            f"{path}: is the coverage of mission {of.id}, not of {mission.id}; "
            "give the file that was written with the mission"
        )
    if of.digest != mission.digest and not _is_placed_since(of, mission):
        raise InputError(
            f"{path}: is the coverage of another revision (digest {of.digest[:12]}…, the mission has "
            f"{mission.digest[:12]}…); give the file that was written with the mission"
        )


def _is_placed_since(of: CoverageOf, mission: Mission) -> bool:
    """True if the mission differs by its place in a robot's map alone, as `stopgo align` sets it."""
    unplaced = msgspec.structs.replace(mission.frame, to_map=None)
    before = msgspec.structs.replace(mission, frame=unplaced, revision=of.revision)
    return mission.frame.to_map is not None and digest_of(before) == of.digest


def coverage_json(
    route: Route, mission: Mission, figures: Figures | None = None, surface: SeenSurface | None = None
) -> bytes:
    """Return the coverage of every target element as JSON, one boundary segment a line; rooms if given.

    `visible` counts the units that any reachable candidate sees, `seen` those of them that the stops see,
    `visible_m` and `seen_m` are their metres. `coverage` is seen / visible by the plan's rule, in metres or
    units (null where nothing is visible). Each segment runs from `a` to `b`, in metres; `seen` holds
    fractions from a to b.
    """
    space = route.space
    floor = space.floor
    visible = route.visibility.visible
    counts = CoverageSums.of(space, visible, seen_units(route.selection))
    targets = [index for index, element in enumerate(floor.elements) if element.target]
    by_kind: dict[str, list[int]] = {}
    for index in targets:
        by_kind.setdefault(floor.elements[index].kind, []).append(index)
    head = {
        "schema": "stopgo/coverage",
        "version": 1,
        "mission": {"id": mission.id, "revision": mission.revision, "digest": mission.digest},
        "floor": {"name": floor.name, "digest": floor.digest},
        "rule": space.settings.coverage_rule,
        "total": counts.summary(targets),
        "kinds": {kind: counts.summary(rows) for kind, rows in sorted(by_kind.items())},
        **({} if figures is None else {"rooms": [room_row(group) for group in figures.rooms]}),
        **({} if surface is None else {"surface": surface.as_json()}),
        **network_table(network_of(mission)),
    }
    segments = _segments_by_element(route)
    elements = [
        {
            **_named(floor.elements[index]),
            **counts.of_element(index),
            "segments": segments.get(index, []),
        }
        for index in targets
    ]
    return _written(head, elements)


@dataclass(frozen=True, eq=False)
class CoverageSums:
    """Sums of each element of the floor: all, visible and seen (elements, 3)."""

    units: IntArray
    metres: FloatArray
    by_units: bool
    """True if coverage is a fraction of units, the paper's rule."""

    @classmethod
    def of(cls, space: NavigableSpace, visible: BoolArray, seen: BoolArray) -> CoverageSums:
        """Return the sums of the visible units, and of the seen ones among them (n,)."""
        targets = space.targets
        elements = targets.element[targets.unit_segment]
        size, length = len(space.floor.elements), np.rint(targets.unit_length * 1e6) * 1e-6
        masks = (np.ones(targets.total, dtype=bool), visible, visible & seen)
        units = [np.bincount(elements[mask], minlength=size) for mask in masks]
        metres = [np.bincount(elements[mask], length[mask], minlength=size) for mask in masks]
        by_units = space.settings.coverage_rule == "paper"
        return cls(np.stack(units, axis=1), np.stack(metres, axis=1, dtype=np.float64), by_units)

    def summary(self, rows: list[int]) -> dict[str, Any]:
        """Return the sums of some elements."""
        sums = self.units[rows].sum(axis=0), self.metres[rows].sum(axis=0)
        return {"elements": len(rows), **self._summary(*sums)}

    def of_element(self, row: int) -> dict[str, Any]:
        """Return the sums of one element."""
        return self._summary(self.units[row], self.metres[row])

    def _summary(self, units: IntArray, metres: FloatArray) -> dict[str, Any]:
        (total, visible, seen), (length_m, visible_m, seen_m) = units.tolist(), metres.tolist()
        part, whole = (seen, visible) if self.by_units else (seen_m, visible_m)
        return {
            **{"units": total, "visible": visible, "seen": seen},
            **{"length_m": round(length_m, 4), "visible_m": round(visible_m, 4), "seen_m": round(seen_m, 4)},
            "coverage": round(part / whole, DIGITS) if whole else None,
        }


def room_row(group: GroupCoverage) -> dict[str, Any]:
    """Return a room's row, in the plan's unit."""
    numbers = (group.total, group.visible, group.seen)
    total, visible, seen = (round(number, 4) for number in numbers)
    coverage = None if group.coverage is None else round(group.coverage, DIGITS)
    row = {"room": group.name, "total": total, "visible": visible, "seen": seen, "coverage": coverage}
    return {**row, "required": group.required, "why": group.why}


def _named(element: Element) -> dict[str, Any]:
    return {"id": element.id, "kind": element.kind, "global_id": element.global_id}


def _segments_by_element(route: Route) -> dict[int, list[dict[str, Any]]]:
    targets = route.visibility.targets
    seen = _seen_by_segment(targets, route)
    segments: dict[int, list[dict[str, Any]]] = {}
    ends = (np.round(end, DIGITS).tolist() for end in (targets.a, targets.b))
    for index, (element, a, b) in enumerate(zip(targets.element.tolist(), *ends, strict=True)):
        segments.setdefault(element, []).append({"a": a, "b": b, "seen": seen.get(index, [])})
    return segments


def _seen_by_segment(targets: Targets, route: Route) -> dict[int, list[list[float]]]:
    runs = runs_of(targets, seen_units(route.selection))
    seen: dict[int, list[list[float]]] = {}
    for segment, t0, t1 in zip(runs.segment.tolist(), runs.t0.tolist(), runs.t1.tolist(), strict=True):
        seen.setdefault(segment, []).append([round(t0, DIGITS), round(t1, DIGITS)])
    return seen


def _written(head: dict[str, Any], elements: list[dict[str, Any]]) -> bytes:
    """Return one line per key, per element and per segment: compact, and comparable line by line."""
    lines = [f"{_json(key)}: {_json(value)}" for key, value in head.items()]
    lines.append('"elements": [' + ",".join(_element(element) for element in elements) + "\n]")
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def _element(element: dict[str, Any]) -> str:
    segments = element.pop("segments")
    lines = "".join(f"\n  {_json(segment)}," for segment in segments).removesuffix(",")
    return f'\n {_json(element)[:-1]},"segments":[{lines}]}}'


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
