"""Openings of a floor: each line on DOORS or PASSAGES lies across one."""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.floor import Finding, Opening
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.planner.floors.drawn import Anomaly, Closed, Drawn, Open, place
from stopgo.planner.floors.rings import SNAP, canonical_line

Across = tuple[FloatArray, str | None, tuple[Anomaly, ...]]
"""A line (2, 2) across an opening, its GlobalId, and its anomalies."""


def openings_of(*, doors: Drawn, passages: Drawn) -> tuple[tuple[Opening, ...], list[Finding]]:
    """Return doors, then passages, in the order of their positions; lines without length are dropped."""
    openings: list[Opening] = []
    findings: list[Finding] = []
    for kind, drawn in (("door", doors), ("passage", passages)):
        lines, dropped = _across(drawn, kind=kind)
        findings += dropped
        for number, (line, global_id, anomalies) in enumerate(lines, start=1):
            openings.append(Opening(f"{kind}-{number:03d}", kind, line, global_id))
            findings += [item.about(openings[-1].id) for item in anomalies]
    return tuple(openings), findings


def _across(drawn: Drawn, *, kind: str) -> tuple[list[Across], list[Finding]]:
    lines: list[Across] = []
    findings: list[Finding] = []
    shapes: list[Open | Closed] = [*drawn.open, *drawn.closed]
    for shape in shapes:
        line, anomalies = _line(shape)
        if isinstance(shape, Open) and shape.curved:
            findings.append(_ignored("not_an_opening", f"{kind}: a curve is not a line across it", line))
        elif float(np.hypot(*(line[1] - line[0]))) <= SNAP:
            findings.append(_ignored("no_length", f"{kind}: a line ends where it starts", line))
        else:
            lines.append((line, shape.global_id, (*shape.anomalies, *anomalies)))
    return sorted(lines, key=lambda item: item[0].tolist()), findings


def _ignored(code: str, text: str, line: FloatArray) -> Finding:
    return Finding(code, f"{text}; it is ignored", at=place(line))


def _line(shape: Open | Closed) -> tuple[FloatArray, tuple[Anomaly, ...]]:
    if isinstance(shape, Open):
        return canonical_line(shape.points[[0, -1]]), ()
    anomaly = Anomaly("closed_opening", "is drawn as a closed shape; read as the line along its middle")
    return _middle(shape), (anomaly,)


def _middle(shape: Closed) -> FloatArray:
    """The longer middle line of the smallest rectangle around a shape."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape.region))[:4]
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    one, other = middles[[0, 2]], middles[[1, 3]]
    longer = one if np.hypot(*(one[1] - one[0])) >= np.hypot(*(other[1] - other[0])) else other
    return canonical_line(frozen(longer))
