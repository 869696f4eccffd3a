"""Selection: the choice step by step, and the coverage it reaches."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mission.geometry import FloatArray, IntArray
from mission.planning import Selection
from recordings import entities, palette, strokes
from recordings.canvas import Canvas, on_screen
from recordings.pens import ORDER, THICK
from recordings.stages.floor import CUT
from recordings.stages.mission import MOST_NAMES

SKIN = 0.01
"""How far the painted targets stand clear of the cut walls, so that both are seen."""


def draw_selection(canvas: Canvas, selection: Selection) -> None:
    """The choice step by step, and what it comes to."""
    steps = len(selection.chosen)
    lines, first_step = strokes.pieces(selection.visibility.targets, step_of_units(selection))
    index = rr.TimeColumn(entities.STEP, sequence=np.arange(steps + 1))
    _draw_targets(canvas, lines, first_step, index, steps=steps)
    _draw_chosen(canvas, selection, index)
    _plot_coverage(canvas, selection, index)
    canvas.show(entities.COVERAGE, _pieces(canvas, lines, class_ids=_final(first_step, steps)))


def paint_coverage(canvas: Canvas, selection: Selection) -> None:
    """Targets as upright bands: seen by the stops, unseen, or seen by no candidate."""
    never = len(selection.chosen) + 1
    steps = step_of_units(selection)
    state = np.where(steps < 0, 2, np.where(steps == never, 1, 0))
    lines, value = strokes.pieces(selection.visibility.targets, state)
    meanings = {0: ("seen", palette.SEEN), 1: ("unseen", palette.UNSEEN), 2: ("hidden", palette.HIDDEN)}
    for number, (name, meaning) in meanings.items():
        band = [strokes.level(canvas.local(line), CUT + SKIN) for line in lines[value == number]]
        if band:
            shape = rr.LineStrips3D(band, colors=meaning.colour, radii=0.03)
            canvas.show(entities.part(entities.WORLD_COVERAGE, name), shape)


def step_of_units(selection: Selection) -> IntArray:
    """The step, from 1, that first sees each unit; steps + 1 if none does, -1 if no candidate does."""
    visibility = selection.visibility
    never = len(selection.chosen) + 1
    first = np.where(visibility.visible, never, -1)
    for step, row in enumerate(selection.chosen, start=1):
        seen = visibility.seen_by(int(row))
        first[seen] = np.where(first[seen] == never, step, first[seen])
    return first


def _draw_targets(
    canvas: Canvas, lines: FloatArray, first_step: IntArray, index: rr.TimeColumn, *, steps: int
) -> None:
    """Pieces of the targets that change their class as stops are chosen; where they are never changes."""
    targets = entities.SELECTION_TARGETS
    canvas.show(targets, _pieces(canvas, lines))
    classes = np.concatenate([_classes(first_step, step) for step in range(steps + 1)])
    column = rr.LineStrips2D.columns(class_ids=classes)
    canvas.columns(targets, index, column.partition(np.full(steps + 1, len(lines))))
    # The other timelines show what the selection came to.
    final = rr.LineStrips2D.from_fields(class_ids=_final(first_step, steps))
    canvas.at(targets, final, mission_s=0.0, candidate=0)


def _pieces(canvas: Canvas, lines: FloatArray, class_ids: IntArray | None = None) -> rr.LineStrips2D:
    return rr.LineStrips2D(
        canvas.local(lines), class_ids=class_ids, radii=THICK, show_labels=False, draw_order=ORDER["target"]
    )


def _classes(first_step: IntArray, step: int) -> IntArray:
    """Class ids of the target pieces once `step` stops are chosen."""
    conditions = [first_step < 0, first_step < step, first_step == step]
    choices = [palette.HIDDEN.number, palette.SEEN.number, palette.NEW.number]
    return np.select(conditions, choices, default=palette.UNSEEN.number)


def _final(first_step: IntArray, steps: int) -> IntArray:
    """Class ids when all stops are chosen, and none of it is new any more."""
    classes = _classes(first_step, steps)
    return np.where(classes == palette.NEW.number, palette.SEEN.number, classes)


def _draw_chosen(canvas: Canvas, selection: Selection, index: rr.TimeColumn) -> None:
    """The stops chosen so far, numbered in the order of choice as long as numbers do not bury the plan."""
    stops = entities.SELECTION_STOPS
    counts = np.arange(len(selection.chosen) + 1)
    xy = canvas.local(selection.xy)
    labels = [str(number + 1) for number in range(len(xy))]
    numbered = len(xy) <= MOST_NAMES
    columns = rr.Points2D.columns(
        positions=np.concatenate([xy[:count] for count in counts]),
        labels=[label for count in counts for label in labels[:count]] if numbered else None,
    )
    canvas.columns(stops, index, columns.partition(counts))
    canvas.at(stops, rr.Points2D.from_fields(positions=xy, labels=labels), mission_s=0.0, candidate=0)
    style = rr.Points2D.from_fields(
        colors=palette.STOP, radii=on_screen(4), show_labels=numbered, draw_order=ORDER["stop"]
    )
    canvas.show(stops, style)


def _plot_coverage(canvas: Canvas, selection: Selection, index: rr.TimeColumn) -> None:
    steps = len(selection.chosen)
    reached = np.concatenate([[0.0], selection.coverage_steps]) * 100
    chosen, required = entities.COVERAGE_CHOSEN, entities.COVERAGE_REQUIRED
    canvas.columns(chosen, index, rr.Scalars.columns(scalars=reached))
    canvas.columns(required, index, rr.Scalars.columns(scalars=np.full(steps + 1, selection.required * 100)))
    canvas.show(chosen, rr.SeriesLines(colors=palette.STOP, names="coverage of the chosen stops", widths=2))
    canvas.show(required, rr.SeriesLines(colors=palette.ROOM_NAME, names="required", widths=1))
    for step, share in enumerate(selection.coverage_steps, start=1):
        line = rr.TextLog(f"stop {step} of {steps} chosen: coverage {share:.1%}", level="INFO")
        canvas.at(entities.LOG_PLAN, line, step=step)
    canvas.say(
        f"selection ({selection.method}): {steps} stops, coverage {selection.coverage:.1%},"
        f" at least {selection.bound} are needed",
        step=steps,
    )
