"""Writes coverage.json: what of each building element the mission's stops see, and where along its faces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from mission.document import Mission
from mission.files.atomic import write_atomic
from mission.floor import Element
from mission.geometry import IntArray
from mission.planning import Route, Targets
from mission.seen import runs_of, seen_units

_DIGITS = 6
"""A micrometre, and a millionth of a segment."""


def coverage_json(route: Route, mission: Mission) -> bytes:
    """The coverage of every target element as JSON, one boundary segment a line.

    `visible` counts the units that any reachable candidate sees, `seen` those that the stops see, and
    `coverage` is seen / visible (null where nothing is visible). Each segment runs from `a` to `b`, in
    metres; `seen` holds fractions from a to b.
    """
    floor = route.selection.visibility.candidates.space.floor
    counts = _counts_by_element(route)
    targets = [index for index, element in enumerate(floor.elements) if element.target]
    by_kind: dict[str, list[int]] = {}
    for index in targets:
        by_kind.setdefault(floor.elements[index].kind, []).append(index)
    head = {
        "schema": "stopgo/coverage",
        "version": 1,
        "mission": {"id": mission.id, "revision": mission.revision, "digest": mission.digest},
        "floor": {"name": floor.name, "digest": floor.digest},
        "total": _summary(counts[targets]),
        "kinds": {kind: _summary(counts[rows]) for kind, rows in sorted(by_kind.items())},
    }
    segments = _segments_by_element(route)
    elements = [
        {
            **_named(floor.elements[index]),
            **_summary(counts[[index]], with_elements=False),
            "segments": segments.get(index, []),
        }
        for index in targets
    ]
    return _written(head, elements)


def write_coverage(route: Route, mission: Mission, path: Path | str) -> None:
    """Write coverage.json whole or not at all."""
    write_atomic(path, coverage_json(route, mission))


def _counts_by_element(route: Route) -> IntArray:
    """Units, visible units and seen units of each element of the floor (elements, 3)."""
    visibility = route.selection.visibility
    targets = visibility.targets
    elements = targets.element[targets.unit_segment]
    size = len(visibility.candidates.space.floor.elements)
    masks = (np.ones(targets.total, dtype=bool), visibility.visible, seen_units(route.selection))
    return np.stack([np.bincount(elements[mask], minlength=size) for mask in masks], axis=1)


def _named(element: Element) -> dict[str, Any]:
    return {"id": element.id, "kind": element.kind, "global_id": element.global_id}


def _summary(counts: IntArray, *, with_elements: bool = True) -> dict[str, Any]:
    units, visible, seen = (int(number) for number in counts.sum(axis=0))
    share = round(seen / visible, _DIGITS) if visible else None
    summary = {"units": units, "visible": visible, "seen": seen, "coverage": share}
    return {"elements": len(counts), **summary} if with_elements else summary


def _segments_by_element(route: Route) -> dict[int, list[dict[str, Any]]]:
    targets = route.selection.visibility.targets
    seen = _seen_by_segment(targets, route)
    segments: dict[int, list[dict[str, Any]]] = {}
    for index, element in enumerate(targets.element.tolist()):
        a, b = (np.round(end[index], _DIGITS).tolist() for end in (targets.a, targets.b))
        segments.setdefault(element, []).append({"a": a, "b": b, "seen": seen.get(index, [])})
    return segments


def _seen_by_segment(targets: Targets, route: Route) -> dict[int, list[list[float]]]:
    runs = runs_of(targets, seen_units(route.selection))
    seen: dict[int, list[list[float]]] = {}
    for segment, t0, t1 in zip(runs.segment.tolist(), runs.t0.tolist(), runs.t1.tolist(), strict=True):
        seen.setdefault(segment, []).append([round(t0, _DIGITS), round(t1, _DIGITS)])
    return seen


def _written(head: dict[str, Any], elements: list[dict[str, Any]]) -> bytes:
    """One line per key, per element and per segment: compact, and still comparable line by line."""
    lines = [f"{_json(key)}: {_json(value)}" for key, value in head.items()]
    lines.append('"elements": [' + ",".join(_element(element) for element in elements) + "\n]")
    return ("{\n" + ",\n".join(lines) + "\n}\n").encode()


def _element(element: dict[str, Any]) -> str:
    segments = element.pop("segments")
    lines = "".join(f"\n  {_json(segment)}," for segment in segments).removesuffix(",")
    return f'\n {_json(element)[:-1]},"segments":[{lines}]}}'


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
