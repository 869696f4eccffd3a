"""Visibility: what each candidate sees, as rows on the candidate timeline."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import rerun as rr

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import Visibility
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import BOLD, HAIR, ORDER, Pen, style
from stopgo.recordings.plan.story import CANDIDATES

MOST_FANS = 5000
"""Number of candidates above which rays are left out: they are most of a large floor's recording."""


BLOCK = 500_000
"""Lines that are drawn at a time, for the memory that this takes."""


def draw_visibility(canvas: Canvas, visibility: Visibility) -> None:
    """Draw what each candidate sees on the candidate timeline: its position, rays and visible lines."""
    if not visibility.rows:
        return
    eyes = visibility.candidates.xy[visibility.candidates.kept]
    for low, high in pairwise(_blocks(visibility.pointer)):
        _draw_rows(canvas, visibility, eyes, low, high)
    if visibility.rows <= MOST_FANS:
        style(canvas, entities.RAYS, Pen(palette.RAY, "ray", HAIR))
    style(canvas, entities.SEEN, Pen(palette.SEEN.colour, "target", BOLD))
    index = rr.TimeColumn(entities.CANDIDATE, sequence=np.arange(visibility.rows))
    eye = entities.EYE
    canvas.columns(eye, index, rr.Points2D.columns(positions=canvas.local(eyes)))
    canvas.show(
        eye, rr.Points2D.from_fields(colors=palette.EYE, radii=on_screen(6), draw_order=ORDER["stop"])
    )
    _plot_sight(canvas, visibility, index)
    visible = int(visibility.visible.sum())
    text = f"visibility ({visibility.method}): {visible} of {visibility.targets.total} units visible from any"
    canvas.say(text, step=CANDIDATES)


def _blocks(pointer: IntArray) -> list[int]:
    """Return rows at which blocks of about `BLOCK` lines begin, and their number."""
    begins = np.searchsorted(pointer, np.arange(0, max(1, pointer[-1]), BLOCK), side="right") - 1
    return np.unique([0, *begins.tolist(), len(pointer) - 1]).tolist()


def _draw_rows(canvas: Canvas, visibility: Visibility, eyes: FloatArray, low: int, high: int) -> None:
    """Draw what the candidates from `low` to below `high` see."""
    index = rr.TimeColumn(entities.CANDIDATE, sequence=np.arange(low, high))
    counts = np.diff(visibility.pointer[low : high + 1])
    own = slice(visibility.pointer[low], visibility.pointer[high])
    runs = (visibility.segment[own], visibility.first[own], visibility.last[own])
    seen = strokes.range_lines(visibility.targets, *runs)
    if visibility.rows <= MOST_FANS:
        fans = np.stack([seen[:, 0], np.repeat(eyes[low:high], counts, axis=0), seen[:, 1]], axis=1)
        _rows_of_lines(canvas, entities.RAYS, index, fans, counts)
    _rows_of_lines(canvas, entities.SEEN, index, seen, counts)


def _plot_sight(canvas: Canvas, visibility: Visibility, index: rr.TimeColumn) -> None:
    visible = max(1, int(visibility.visible.sum()))
    seen = visibility.units_seen * (100.0 / visible)
    sight = entities.CANDIDATE_COVERAGE
    canvas.columns(sight, index, rr.Scalars.columns(scalars=seen))
    canvas.show(sight, rr.SeriesLines(colors=palette.EYE, names="visible from the candidate", widths=1))


def _rows_of_lines(
    canvas: Canvas, entity: str, index: rr.TimeColumn, lines: FloatArray, counts: IntArray
) -> None:
    columns = rr.LineStrips2D.columns(strips=canvas.local(lines))
    canvas.columns(entity, index, columns.partition(counts))
