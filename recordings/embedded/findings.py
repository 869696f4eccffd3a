"""Findings about a floor, and rooms that its plan leaves out, embedded in a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sized
from dataclasses import dataclass

import numpy as np
import rerun as rr

from stopgo.mission.stages.figures import Figures
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.values import Cells, Values


@dataclass(frozen=True)
class EmbeddedFindings:
    """Findings as (rank, code, message), and rooms left out as (room, area in m², reason)."""

    findings: tuple[tuple[str, str, str], ...] = ()
    unreached: tuple[tuple[str, float, str], ...] = ()


def embed_findings(canvas: Canvas, figures: Figures) -> None:
    """Embed the findings of a plan, and the rooms that it leaves out."""
    values: dict[str, Sized] = {
        "rank": [item.rank.name.lower() for item in figures.findings],
        "code": [item.code for item in figures.findings],
        "message": [item.message for item in figures.findings],
        "room": [item.room for item in figures.unreached],
        "area_m2": np.array([float(item.area_m2) for item in figures.unreached]),
        "why": [item.why for item in figures.unreached],
    }
    present = {name: value for name, value in values.items() if len(value)}
    if present:
        canvas.show(entities.FINDINGS, rr.DynamicArchetype("Findings", components=present))


def findings_in(values: Values) -> EmbeddedFindings:
    """Return the findings of a recording's plan, and the rooms that it leaves out."""
    rows = list(values.rows(entities.FINDINGS))
    return EmbeddedFindings(
        tuple(item for row in rows for item in _texts(row, "rank", "code", "message")),
        tuple(
            (room, float(area), why)
            for row in rows
            for room, area, why in _texts(row, "room", "area_m2", "why")
        ),
    )


def _texts(row: Cells, *names: str) -> Iterator[tuple]:
    return zip(*(row.get(name, ()) for name in names), strict=False)
