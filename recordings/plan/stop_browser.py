"""Reasons for each stop: at its planning step, and by stop on a timeline of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from stopgo.mission.document import Mission
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import Route, Visibility
from stopgo.mission.stages.stop_reasons import StopReason
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.fans import sight_outline
from stopgo.recordings.drawing.markdown import plain
from stopgo.recordings.drawing.pens import BOLD, ORDER, THICK, THIN, Pen, style
from stopgo.recordings.plan.drive import Drive
from stopgo.recordings.plan.mission import legs_of, route_lines
from stopgo.recordings.plan.selection import sight_of_row
from stopgo.recordings.plan.story import FIRST_CHOICE, describe_step, step_of_choice

GUIDE = (
    "Choose the timeline `stage_step` at the bottom of the window and drag: floor, navigable space, "
    "candidates, each stop as it is chosen with the outline of what it sees, and the route. The log "
    "describes each step.",
    "On the timeline `stop`, the tab *Stops* gives the reason for each stop.",
)


def describe_stops(
    canvas: Canvas, route: Route, mission: Mission, reasons: Sequence[StopReason], drive: Drive
) -> None:
    """Describe each choice and the route by planning step, and each stop by its number."""
    visibility = route.visibility
    seen = [sight_of_row(visibility, item.candidate) for item in reasons]
    eyes = route.xy
    outlines = [sight_outline(eye, lines) for eye, lines in zip(eyes, seen, strict=True)]
    texts = ["\n\n".join(map(plain, item.sentences())) for item in reasons]
    chosen = np.argsort([item.step for item in reasons]).tolist()
    _describe_choices(canvas, [reasons[k] for k in chosen], [texts[k] for k in chosen])
    _draw_outlines(canvas, entities.SELECTION_SIGHT, _steps(len(reasons)), [outlines[k] for k in chosen])
    _describe_route(canvas, route, mission)
    index = _stop_times(drive)
    _draw_outlines(canvas, entities.WHY_SIGHT, index, outlines)
    _rows(canvas, entities.WHY_SEEN, index, seen, Pen(palette.SEEN.colour, "seen", THICK))
    alone = _seen_alone(visibility, [item.candidate for item in reasons])
    _rows(canvas, entities.WHY_ALONE, index, alone, Pen(palette.LOST, "ray", BOLD))
    _draw_stop(canvas, index, eyes, [item.stop for item in reasons])
    _draw_runners(canvas, index, reasons)
    pages = [f"# Why {plain(item.stop)}?\n\n{text}" for item, text in zip(reasons, texts, strict=True)]
    canvas.columns(entities.STOP_STORY, index, _documents(pages))


def _steps(count: int) -> rr.TimeColumn:
    return rr.TimeColumn(entities.STEP, sequence=np.arange(count) + FIRST_CHOICE)


def _stop_times(drive: Drive) -> list[rr.TimeColumn]:
    """Return each stop by its number, and on mission time while it is driven to and scanned."""
    begins = np.concatenate([[0.0], drive.leaving_s[:-1]])
    return [
        rr.TimeColumn(entities.STOP_NUMBER, sequence=np.arange(len(begins)) + 1),
        rr.TimeColumn(entities.MISSION_TIME, duration=begins),
    ]


def _describe_choices(canvas: Canvas, chosen: Sequence[StopReason], texts: Sequence[str]) -> None:
    count = len(chosen)
    titles = [
        f"step {step_of_choice(item.step)}: choice {item.step} of {count} is {item.stop}" for item in chosen
    ]
    pages = [f"# {plain(title.capitalize())}\n\n{text}" for title, text in zip(titles, texts, strict=True)]
    lines = rr.TextLog.columns(text=titles, level=["INFO"] * count)
    canvas.columns(entities.LOG_PLAN, _steps(count), lines)
    canvas.columns(entities.STORY, _steps(count), _documents(pages))
    overview = rr.TextDocument("\n\n".join(("# How the plan was made", *GUIDE)), media_type="text/markdown")
    canvas.at(entities.STORY, overview, mission_s=0.0, candidate=0, stop=1)


def _describe_route(canvas: Canvas, route: Route, mission: Mission) -> None:
    after = step_of_choice(len(route.order) + 1)
    for entity in (entities.SELECTION_SIGHT, entities.SELECTION_NEW):
        canvas.at(entity, rr.LineStrips2D.from_fields(strips=[]), step=after)
    title = f"route ({route.method}, {route.tour}): {route.length:.2f} m, at least {route.bound:.2f} m"
    describe_step(canvas, after, title, f"It begins at {route.start_reason}.")
    legs, colours = legs_of(mission)
    if legs:
        flat, _ = route_lines(canvas, legs, colours)
        canvas.since(entities.SELECTION_ROUTE, flat, step=after)


def _draw_outlines(
    canvas: Canvas, entity: str, index: rr.TimeColumn | list[rr.TimeColumn], outlines: Sequence[FloatArray]
) -> None:
    """Draw one outline per row."""
    canvas.columns(entity, index, rr.LineStrips2D.columns(strips=canvas.strips(outlines)))
    style(canvas, entity, Pen(palette.EYE, "ray", THIN))


def _seen_alone(visibility: Visibility, rows: Sequence[int]) -> list[FloatArray]:
    """Return, per row, the visible units that too few other rows see, as lines."""
    targets = visibility.targets
    sights = [visibility.seen_by(row) for row in rows]
    often: IntArray = np.bincount(np.concatenate(sights), minlength=targets.total)
    lonely: BoolArray = (often == visibility.asked) & visibility.visible
    return [_lines(visibility, sight[lonely[sight]]) for sight in sights]


def _lines(visibility: Visibility, units: IntArray) -> FloatArray:
    """Return units, ascending, as lines (k, 2, 2); neighbours on a segment form one line."""
    if not len(units):
        return np.empty((0, 2, 2))
    segment = visibility.targets.unit_segment[units]
    new = np.flatnonzero((np.diff(units) != 1) | (np.diff(segment) != 0)) + 1
    first, last = np.concatenate([[0], new]), np.concatenate([new - 1, [len(units) - 1]])
    return strokes.range_lines(visibility.targets, segment[first], units[first], units[last])


def _rows(
    canvas: Canvas, entity: str, index: list[rr.TimeColumn], rows: Sequence[FloatArray], pen: Pen
) -> None:
    strips = canvas.local(np.concatenate(rows))
    column = rr.LineStrips2D.columns(strips=strips).partition([len(row) for row in rows])
    canvas.columns(entity, index, column)
    style(canvas, entity, pen)


def _draw_stop(canvas: Canvas, index: list[rr.TimeColumn], eyes: FloatArray, names: Sequence[str]) -> None:
    points = rr.Points2D.columns(positions=canvas.local(eyes), labels=list(names))
    canvas.columns(entities.WHY_STOP, index, points)
    look = rr.Points2D.from_fields(
        colors=palette.EYE, radii=on_screen(6), draw_order=ORDER["robot"], show_labels=True
    )
    canvas.show(entities.WHY_STOP, look)


def _draw_runners(canvas: Canvas, index: list[rr.TimeColumn], reasons: Sequence[StopReason]) -> None:
    runners = [runner for item in reasons for runner in item.runners]
    positions = np.array([(runner.x, runner.y) for runner in runners]).reshape(-1, 2)
    labels = [f"{runner.new:.1f}" for runner in runners]
    counts = [len(item.runners) for item in reasons]
    columns = rr.Points2D.columns(positions=canvas.local(positions), labels=labels).partition(counts)
    canvas.columns(entities.WHY_RUNNERS, index, columns)
    look = rr.Points2D.from_fields(
        colors=palette.RUNNER_UP, radii=on_screen(4), draw_order=ORDER["stop"], show_labels=True
    )
    canvas.show(entities.WHY_RUNNERS, look)


def _documents(texts: Sequence[str]) -> rr.ComponentColumnList:
    return rr.TextDocument.columns(text=texts, media_type=["text/markdown"] * len(texts))
