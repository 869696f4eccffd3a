"""Selection: each choice of a stop as a planning step, and the coverage it reaches."""

from __future__ import annotations

import numpy as np
import rerun as rr

from stopgo.mission.console.table import counted
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import Selection, Visibility
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.plan_results import PlanResults
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import BOLD, ORDER, THICK, Pen, style
from stopgo.recordings.plan.floor import CUT
from stopgo.recordings.plan.mission import MOST_NAMES
from stopgo.recordings.plan.story import FIRST_CHOICE, step_of_choice

SKIN = 0.01
"""Distance of the painted targets from the cut walls, so that both are visible."""


def draw_selection(canvas: Canvas, selection: Selection) -> None:
    """Draw the choice step by step, and the result."""
    count = len(selection.chosen)
    lines, first_step = strokes.lines_by_value(selection.visibility.targets, step_of_units(selection))
    steps = np.arange(count) + FIRST_CHOICE
    _clear_space(canvas)
    _draw_targets(canvas, lines, first_step)
    _draw_seen(canvas, lines, first_step, steps)
    _draw_chosen(canvas, selection, steps)
    _plot_coverage(canvas, selection)
    canvas.show(entities.COVERAGE, _target_lines(canvas, lines, class_ids=_final(first_step, count)))


def paint_coverage(canvas: Canvas, selection: Selection) -> None:
    """Paint targets as upright bands: seen by the stops, unseen, or seen by no candidate."""
    never = len(selection.chosen) + 1
    steps = step_of_units(selection)
    state = np.where(steps < 0, 2, np.where(steps == never, 1, 0))
    lines, value = strokes.lines_by_value(selection.visibility.targets, state)
    meanings = {0: ("seen", palette.SEEN), 1: ("unseen", palette.UNSEEN), 2: ("hidden", palette.HIDDEN)}
    for number, (name, meaning) in meanings.items():
        band = strokes.level(canvas.local(lines[value == number]), CUT + SKIN)
        if len(band):
            shape = rr.LineStrips3D(band, colors=meaning.colour, radii=0.03)
            canvas.show(entities.child(entities.WORLD_COVERAGE, name), shape)


def step_of_units(selection: Selection) -> IntArray:
    """Return the choice, from 1, at which each unit is first seen enough.

    The value is the number of choices + 1 for a unit that no chosen stop covers, and -1 for an invisible one.
    """
    visibility = selection.visibility
    never = len(selection.chosen) + 1
    first = np.where(visibility.visible, never, -1)
    views = np.zeros(len(first), dtype=np.int64)
    for step, row in enumerate(selection.chosen, start=1):
        seen = visibility.seen_by(int(row))
        views[seen] += 1
        enough = (views[seen] >= visibility.asked[seen]) & (first[seen] == never)
        first[seen] = np.where(enough, step, first[seen])
    return first


def sight_of_row(visibility: Visibility, row: int) -> FloatArray:
    """Return what a candidate sees, as lines (k, 2, 2)."""
    rows = slice(int(visibility.pointer[row]), int(visibility.pointer[row + 1]))
    parts = (visibility.segment[rows], visibility.first[rows], visibility.last[rows])
    return strokes.range_lines(visibility.targets, *parts)


def _draw_targets(canvas: Canvas, lines: FloatArray, first_step: IntArray) -> None:
    """Draw all targets from the first choice on: before, they were only outlined."""
    colours = np.where(first_step < 0, palette.HIDDEN.number, palette.UNSEEN.number)
    shape = _target_lines(canvas, lines, class_ids=colours)
    canvas.since(entities.SELECTION_TARGETS, shape, step=FIRST_CHOICE)


def _draw_seen(canvas: Canvas, lines: FloatArray, first_step: IntArray, steps: IntArray) -> None:
    """Draw what each choice newly sees; views show the rows of all choices so far.

    A second entity shows only the newest: there, a row replaces the one before.
    """
    order = np.argsort(first_step, kind="stable")
    counts = np.bincount(first_step[first_step > 0], minlength=len(steps) + 2)[1:-1]
    seen = order[np.isin(first_step[order], np.arange(1, len(steps) + 1))]
    strips = canvas.local(lines[seen])
    column = rr.LineStrips2D.columns(strips=strips).partition(counts)
    canvas.columns(entities.SELECTION_SEEN, _so_far(steps), column)
    canvas.columns(entities.SELECTION_NEW, rr.TimeColumn(entities.STEP, sequence=steps), column)
    style(canvas, entities.SELECTION_SEEN, Pen(palette.SEEN.colour, "seen", THICK))
    style(canvas, entities.SELECTION_NEW, Pen(palette.NEW.colour, "ray", BOLD))


def _so_far(steps: IntArray) -> list[rr.TimeColumn]:
    """Times of rows that accumulate along the planning steps, and are all visible on mission time."""
    return [
        rr.TimeColumn(entities.STEP, sequence=steps),
        rr.TimeColumn(entities.MISSION_TIME, duration=np.zeros(len(steps))),
    ]


def _target_lines(canvas: Canvas, lines: FloatArray, class_ids: IntArray | None = None) -> rr.LineStrips2D:
    return rr.LineStrips2D(
        canvas.local(lines), class_ids=class_ids, radii=THICK, show_labels=False, draw_order=ORDER["target"]
    )


def _final(first_step: IntArray, count: int) -> IntArray:
    """Return class ids when all stops are chosen."""
    conditions = [first_step < 0, first_step <= count]
    return np.select(conditions, [palette.HIDDEN.number, palette.SEEN.number], palette.UNSEEN.number)


def _draw_chosen(canvas: Canvas, selection: Selection, steps: IntArray) -> None:
    """Draw the stops chosen so far, numbered in the order of choice unless numbers would cover the plan."""
    stops = entities.SELECTION_STOPS
    numbered = len(steps) <= MOST_NAMES
    labels = [str(number + 1) for number in range(len(steps))]
    if len(steps):
        columns = rr.Points2D.columns(positions=canvas.local(selection.xy), labels=labels)
        canvas.columns(stops, _so_far(steps), columns)
    look = rr.Points2D.from_fields(
        colors=palette.STOP, radii=on_screen(4), show_labels=numbered, draw_order=ORDER["stop"]
    )
    canvas.show(stops, look)


def _plot_coverage(canvas: Canvas, selection: Selection) -> None:
    count = len(selection.chosen)
    index = rr.TimeColumn(entities.STEP, sequence=np.arange(count + 1) + FIRST_CHOICE - 1)
    reached = np.concatenate([[0.0], selection.coverage_steps]) * 100
    chosen, required = entities.COVERAGE_CHOSEN, entities.COVERAGE_REQUIRED
    canvas.columns(chosen, index, rr.Scalars.columns(scalars=reached))
    canvas.columns(required, index, rr.Scalars.columns(scalars=np.full(count + 1, selection.required * 100)))
    canvas.show(chosen, rr.SeriesLines(colors=palette.GREEN, names="coverage of the chosen stops", widths=2))
    canvas.show(required, rr.SeriesLines(colors=palette.OUTLINE, names="required", widths=1))
    canvas.say(
        f"selection ({selection.method}): {counted(count, 'stop')}, coverage {percent(selection.coverage)},"
        f" {PlanResults.of({Selection: selection}).bound_text}",
        step=step_of_choice(max(count, 1)),
    )


def _clear_space(canvas: Canvas) -> None:
    """Remove the hatches before the choices."""
    for entity in (entities.DRIVE_AREA, entities.STOP_AREA, entities.TARGETS):
        if entity in canvas.counts:
            canvas.at(entity, rr.LineStrips2D.from_fields(strips=[]), step=FIRST_CHOICE)
