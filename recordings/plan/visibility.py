"""Visibility: what each candidate sees, as rows on the candidate timeline."""

from __future__ import annotations

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


def draw_visibility(canvas: Canvas, visibility: Visibility) -> None:
    """Draw what each candidate sees on the candidate timeline: its position, rays and visible lines."""
    if not visibility.rows:
        return
    index = rr.TimeColumn(entities.CANDIDATE, sequence=np.arange(visibility.rows))
    eyes = visibility.candidates.xy[visibility.candidates.kept]
    counts = np.diff(visibility.pointer)
    seen = strokes.range_lines(visibility.targets, visibility.segment, visibility.first, visibility.last)
    if visibility.rows <= MOST_FANS:
        fans = np.stack([seen[:, 0], np.repeat(eyes, counts, axis=0), seen[:, 1]], axis=1)
        _rows_of_lines(canvas, entities.RAYS, index, fans, counts)
        style(canvas, entities.RAYS, Pen(palette.RAY, "ray", HAIR))
    _rows_of_lines(canvas, entities.SEEN, index, seen, counts)
    style(canvas, entities.SEEN, Pen(palette.SEEN.colour, "target", BOLD))
    eye = entities.EYE
    canvas.columns(eye, index, rr.Points2D.columns(positions=canvas.local(eyes)))
    canvas.show(
        eye, rr.Points2D.from_fields(colors=palette.EYE, radii=on_screen(6), draw_order=ORDER["stop"])
    )
    _plot_sight(canvas, visibility, index)
    visible = int(visibility.visible.sum())
    text = f"visibility ({visibility.method}): {visible} of {visibility.targets.total} units visible from any"
    canvas.say(text, step=CANDIDATES)


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
