"""Visibility: what each candidate sees, as rows on the candidate timeline."""

from __future__ import annotations

import numpy as np
import rerun as rr

from stopgo.mission.geometry import IntArray
from stopgo.mission.stages import Visibility
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, arrow_of_lines, on_screen
from stopgo.recordings.drawing.pens import BOLD, HAIR, ORDER, Pen, style
from stopgo.recordings.plan.story import CANDIDATES

MOST_FANS = 5000
"""Number of candidates above which rays are left out: they are most of a large floor's recording."""


def draw_visibility(canvas: Canvas, visibility: Visibility) -> None:
    """Draw what each candidate sees on the candidate timeline: its position, rays and visible lines."""
    if not visibility.rows:
        return
    eyes = visibility.candidates.xy[visibility.candidates.kept]
    begin, none = 0, (np.empty(0, dtype=np.int64),) * 4
    for runs in visibility.runs_apart_by_rows():
        end = int(runs[0].max(initial=begin - 1)) + 1
        _draw_rows(canvas, visibility, range(begin, end), runs)
        begin = end
    _draw_rows(canvas, visibility, range(begin, visibility.rows), none)
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


def _draw_rows(canvas: Canvas, visibility: Visibility, rows: range, runs: tuple[IntArray, ...]) -> None:
    """Draw what some candidates see: runs by row, and by unit."""
    if not rows:
        return
    row, segment, first, last = runs
    index = rr.TimeColumn(entities.CANDIDATE, sequence=np.array(rows))
    lines = canvas.local(strokes.range_lines(visibility.targets, segment, first, last))
    if visibility.rows <= MOST_FANS:
        eyes = canvas.local(visibility.candidates.xy[visibility.candidates.kept[row]])
        fans = np.stack([lines[:, 0], eyes, lines[:, 1]], axis=1)
        columns = rr.LineStrips2D.columns(strips=fans)
        canvas.columns(entities.RAYS, index, columns.partition(_counts(row, rows)))
    columns = rr.LineStrips2D.columns(strips=arrow_of_lines(lines))
    canvas.columns(entities.SEEN, index, columns.partition(_counts(row, rows)))


def _counts(row: IntArray, rows: range) -> IntArray:
    """Return how many of the lines each row has (rows,)."""
    return np.bincount(row - rows.start, minlength=len(rows))


def _plot_sight(canvas: Canvas, visibility: Visibility, index: rr.TimeColumn) -> None:
    visible = max(1, int(visibility.visible.sum()))
    seen = visibility.units_seen * (100.0 / visible)
    sight = entities.CANDIDATE_COVERAGE
    canvas.columns(sight, index, rr.Scalars.columns(scalars=seen))
    canvas.show(sight, rr.SeriesLines(colors=palette.EYE, names="visible from the candidate", widths=1))
