"""Visibility: what each candidate sees, as rows on the candidate timeline."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import rerun as rr

from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.stages import Visibility
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, arrow_of_lines, on_screen
from stopgo.recordings.drawing.pens import BOLD, HAIR, ORDER, Pen, style
from stopgo.recordings.plan.story import CANDIDATES

MOST_FANS = 5000
"""Number of candidates above which rays are left out: they are most of a large floor's recording."""
MOST_LINES = 2_000_000
"""Most visible lines on the timeline, about: of more, it has one candidate in so many."""


class _Shown(NamedTuple):
    """The candidates on the timeline, and what they see."""

    numbers: IntArray
    """Number of each among all candidates (rows,)."""
    eyes: FloatArray
    """Positions (rows, 2)."""
    visibility: Visibility
    """Of these rows alone."""
    has_rays: bool

    @classmethod
    def of(cls, visibility: Visibility) -> _Shown:
        step = -(-max(1, len(visibility.first)) // MOST_LINES)
        numbers = np.arange(0, visibility.rows, step)
        eyes: FloatArray = visibility.candidates.xy[visibility.candidates.kept[numbers]]
        of_these = visibility if step == 1 else _of_rows(visibility, numbers)
        return cls(numbers, eyes, of_these, visibility.rows <= MOST_FANS)


def _of_rows(visibility: Visibility, rows: IntArray) -> Visibility:
    """Return what some rows see, as rows from 0 on; the candidates stay all."""
    pointer = visibility.pointer
    own = np.concatenate([np.arange(pointer[row], pointer[row + 1]) for row in rows])
    return replace(
        visibility,
        pointer=frozen(np.concatenate([[0], np.cumsum(np.diff(pointer)[rows])]), np.int64),
        segment=visibility.segment[own],
        first=visibility.first[own],
        last=visibility.last[own],
    )


def draw_visibility(canvas: Canvas, visibility: Visibility) -> None:
    """Draw what each candidate sees on the candidate timeline: its position, rays and visible lines."""
    if not visibility.rows:
        return
    shown = _Shown.of(visibility)
    begin, none = 0, (np.empty(0, dtype=np.int64),) * 4
    for runs in shown.visibility.runs_apart_by_rows():
        end = int(runs[0].max(initial=begin - 1)) + 1
        _draw_rows(canvas, shown, range(begin, end), runs)
        begin = end
    _draw_rows(canvas, shown, range(begin, len(shown.numbers)), none)
    if shown.has_rays:
        style(canvas, entities.RAYS, Pen(palette.RAY, "ray", HAIR))
    style(canvas, entities.SEEN, Pen(palette.SEEN.colour, "target", BOLD))
    index = rr.TimeColumn(entities.CANDIDATE, sequence=shown.numbers)
    eye = entities.EYE
    canvas.columns(eye, index, rr.Points2D.columns(positions=canvas.local(shown.eyes)))
    canvas.show(
        eye, rr.Points2D.from_fields(colors=palette.EYE, radii=on_screen(6), draw_order=ORDER["stop"])
    )
    visible = int(visibility.visible.sum())
    _plot_sight(canvas, frozen(shown.visibility.units_seen * (100.0 / max(1, visible))), index)
    text = f"visibility ({visibility.method}): {visible} of {visibility.targets.total} units visible from any"
    left_out = visibility.rows - len(shown.numbers)
    part = f"; the timeline has {len(shown.numbers)} of {visibility.rows} candidates" if left_out else ""
    canvas.say(f"{text}{part}", step=CANDIDATES)


def _draw_rows(canvas: Canvas, shown: _Shown, rows: range, runs: tuple[IntArray, ...]) -> None:
    """Draw what some candidates see: runs by row, and by unit."""
    if not rows:
        return
    row, segment, first, last = runs
    counts = np.bincount(row - rows.start, minlength=len(rows))
    index = rr.TimeColumn(entities.CANDIDATE, sequence=shown.numbers[rows.start : rows.stop])
    lines = canvas.local(strokes.range_lines(shown.visibility.targets, segment, first, last))
    if shown.has_rays:
        eyes = canvas.local(shown.eyes[row])
        fans = np.stack([lines[:, 0], eyes, lines[:, 1]], axis=1)
        columns = rr.LineStrips2D.columns(strips=fans)
        canvas.columns(entities.RAYS, index, columns.partition(counts))
    columns = rr.LineStrips2D.columns(strips=arrow_of_lines(lines))
    canvas.columns(entities.SEEN, index, columns.partition(counts))


def _plot_sight(canvas: Canvas, seen: FloatArray, index: rr.TimeColumn) -> None:
    """Plot the fraction of all visible that each candidate sees, in percent (candidates,)."""
    sight = entities.CANDIDATE_COVERAGE
    canvas.columns(sight, index, rr.Scalars.columns(scalars=seen))
    canvas.show(sight, rr.SeriesLines(colors=palette.EYE, names="visible from the candidate", widths=1))
