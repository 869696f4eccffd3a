"""The stages of a plan in 2D: one function per noun, from the floor to the route."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr

from mission.document import Mission
from mission.floor import Finding, FloorPlan, Room
from mission.geometry import FloatArray, IntArray, bounds
from mission.planning import (
    DROP_REASONS,
    KEPT,
    Candidates,
    NavigableSpace,
    OpeningState,
    Route,
    Selection,
    Visibility,
)
from recordings import entities, palette, strokes
from recordings.canvas import Canvas, on_screen
from recordings.drive import Drive

# What lies above what; Rerun's own defaults are 20 for lines and 30 for points.
ORDER = {
    name: float(order)
    for order, name in enumerate(
        ("room", "area", "floor", "solid", "line", "target", "ray", "route", "candidate", "stop", "robot")
    )
}
HAIR, THIN, THICK, BOLD = (on_screen(width) for width in (0.5, 0.8, 1.6, 2.5))

MOST_NAMES = 30
"""With more rooms than these their names hide one another, and are shown where the mouse points."""


def draw_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Outline, holes, rooms with names, elements by kind, openings."""
    _lines(
        canvas, f"{entities.FLOOR}/outline", strokes.outlines(floor.outline), palette.OUTLINE, "floor", THICK
    )
    holes = [hole for polygon in floor.outline for hole in polygon.holes]
    _lines(canvas, f"{entities.FLOOR}/holes", map(strokes.closed, holes), palette.HOLE, "line", THICK)
    _draw_rooms(canvas, floor.rooms)
    for kind in palette.KIND_COLOURS:
        _draw_elements(canvas, floor, kind)
    openings = [opening.line for opening in floor.openings]
    _lines(canvas, f"{entities.FLOOR}/openings", openings, palette.PASSABLE, "line", THICK)
    _say_findings(canvas, floor.findings)
    canvas.say(f"floor {floor.name}: {floor.area:.1f} m², {len(floor.rooms)} rooms, {len(openings)} openings")


def draw_space(canvas: Canvas, space: NavigableSpace) -> None:
    """Where the robot may drive and stop, which openings it passes, what it is to look at."""
    spacing = _hatch_spacing(space.floor)
    drive = strokes.hatch(space.drive_area, spacing=spacing, angle=np.pi / 4)
    _lines(canvas, f"{entities.NAVIGABLE}/drive", drive, palette.DRIVE, "area", THIN)
    stop_polygons = [polygon for room in space.rooms for polygon in room.stop_area]
    stop_area = strokes.hatch(stop_polygons, spacing=spacing, angle=-np.pi / 4)
    _lines(canvas, f"{entities.NAVIGABLE}/stop", stop_area, palette.STOP_AREA, "area", THIN)
    edges = strokes.outlines(stop_polygons)
    _lines(canvas, f"{entities.NAVIGABLE}/stop_edge", edges, palette.STOP_AREA, "area", THIN)
    _lines(canvas, f"{entities.NAVIGABLE}/gaps", space.gaps, palette.GAP, "line", THICK)
    _draw_openings(canvas, space.openings)
    targets = space.targets
    lines = np.stack([targets.a, targets.b], axis=1)
    _lines(canvas, entities.TARGETS, lines, palette.TARGET.colour, "target", THIN)
    _say_findings(canvas, [item for item in space.findings if item not in space.floor.findings])
    canvas.say(f"navigable space: {len(space.rooms)} rooms, {targets.total} target units")


def draw_candidates(canvas: Canvas, candidates: Candidates) -> None:
    """Every possible position, coloured by what became of it; hovering tells the reason and the room."""
    if not len(candidates.xy):
        canvas.say("no candidate positions", level="WARN")
        return
    kept = candidates.reason == KEPT
    points = rr.Points2D(
        canvas.local(candidates.xy),
        class_ids=[palette.reason(int(number)).number for number in candidates.reason],
        radii=np.where(kept, on_screen(2.2), on_screen(1.5)),
        show_labels=False,
        draw_order=ORDER["candidate"],
    )
    names = [candidates.space.rooms[int(room)].name for room in candidates.room]
    why = [DROP_REASONS[int(number)] for number in candidates.reason]
    canvas.show(entities.CANDIDATES, points, rr.AnyValues(room=names, reason=why))
    counts = np.bincount(candidates.reason, minlength=len(DROP_REASONS))
    told = ", ".join(f"{int(count)} {DROP_REASONS[i]}" for i, count in enumerate(counts) if count)
    canvas.say(f"candidates ({candidates.strategy}): {len(candidates.xy)} generated: {told}")


def draw_visibility(canvas: Canvas, visibility: Visibility) -> None:
    """What each candidate sees, as rows on the candidate timeline: its position, rays, and seen pieces."""
    if not visibility.rows:
        return
    index = rr.TimeColumn(entities.CANDIDATE, sequence=np.arange(visibility.rows))
    eyes = visibility.candidates.xy[visibility.candidates.kept]
    counts = np.diff(visibility.pointer)
    seen = strokes.runs(visibility.targets, visibility.segment, visibility.first, visibility.last)
    fans = np.stack([seen[:, 0], np.repeat(eyes, counts, axis=0), seen[:, 1]], axis=1)
    _rows_of_lines(canvas, f"{entities.VISIBILITY}/rays", index, fans, counts)
    _rows_of_lines(canvas, f"{entities.VISIBILITY}/seen", index, seen, counts)
    _style(canvas, f"{entities.VISIBILITY}/rays", palette.RAY, "ray", HAIR)
    _style(canvas, f"{entities.VISIBILITY}/seen", palette.SEEN.colour, "target", BOLD)
    eye = f"{entities.VISIBILITY}/candidate"
    canvas.columns(eye, index, rr.Points2D.columns(positions=canvas.local(eyes)))
    canvas.show(
        eye, rr.Points2D.from_fields(colors=palette.EYE, radii=on_screen(6), draw_order=ORDER["stop"])
    )
    _plot_sight(canvas, visibility, index)
    visible = int(visibility.visible.sum())
    canvas.say(f"visibility ({visibility.method}): {visible} of {visibility.targets.total} units seen by any")


def _plot_sight(canvas: Canvas, visibility: Visibility, index: rr.TimeColumn) -> None:
    visible = max(1, int(visibility.visible.sum()))
    seen = [len(visibility.seen_by(row)) / visible * 100 for row in range(visibility.rows)]
    sight = f"{entities.METRIC_COVERAGE}/candidate"
    canvas.columns(sight, index, rr.Scalars.columns(scalars=seen))
    canvas.show(sight, rr.SeriesLines(colors=palette.EYE, names="seen by the candidate", widths=1))


def draw_selection(canvas: Canvas, selection: Selection) -> None:
    """The choice step by step: which pieces of the targets each new stop adds."""
    steps = len(selection.chosen)
    lines, first_step = strokes.pieces(selection.visibility.targets, step_of_units(selection))
    index = rr.TimeColumn(entities.STEP, sequence=np.arange(steps + 1))
    classes = np.concatenate([_classes(first_step, step) for step in range(steps + 1)])
    targets = f"{entities.SELECTION}/targets"
    canvas.show(
        targets,
        rr.LineStrips2D(canvas.local(lines), radii=THICK, show_labels=False, draw_order=ORDER["target"]),
    )
    column = rr.LineStrips2D.columns(class_ids=classes)
    canvas.columns(targets, index, column.partition(np.full(steps + 1, len(lines))))
    final = np.where(
        classes[-len(lines) :] == palette.NEW.number, palette.SEEN.number, classes[-len(lines) :]
    )
    # The other timelines show what the selection came to.
    canvas.at(targets, rr.LineStrips2D.from_fields(class_ids=final), mission_s=0.0, candidate=0)
    _draw_chosen(canvas, selection, index)
    canvas.show(
        entities.COVERAGE,
        rr.LineStrips2D(
            canvas.local(lines), class_ids=final, radii=THICK, show_labels=False, draw_order=ORDER["target"]
        ),
    )
    _plot_coverage(canvas, selection, index)


def plot_planned_coverage(canvas: Canvas, mission: Mission, drive: Drive, *, visible: int) -> None:
    """Coverage over mission time, if every scan is done as planned."""
    gained = np.cumsum([stop.sees.new_units for stop in mission.stops]) * (100.0 / max(visible, 1))
    seconds = np.concatenate([[0.0], drive.leaving_s])
    planned = f"{entities.METRIC_COVERAGE}/planned"
    index = rr.TimeColumn(entities.MISSION_TIME, duration=seconds)
    canvas.columns(planned, index, rr.Scalars.columns(scalars=np.concatenate([[0.0], gained])))
    style = rr.SeriesLines(
        colors=palette.ROUTE, names="coverage as planned", widths=2, interpolation_mode="StepAfter"
    )
    canvas.show(planned, style)


def tell_route(canvas: Canvas, route: Route) -> None:
    """The route in words; the mission made from it is what is drawn."""
    stops = len(route.order)
    canvas.say(
        f"route ({route.method}, {route.tour}): {stops} stops, {route.length:.2f} m,"
        f" at least {route.bound:.2f} m; begins at {route.start_reason}",
        step=stops,
    )


def step_of_units(selection: Selection) -> IntArray:
    """The step, from 1, that first sees each unit; steps + 1 if none does, -1 if no candidate does."""
    visibility = selection.visibility
    never = len(selection.chosen) + 1
    first = np.where(visibility.visible, never, -1)
    for step, row in enumerate(selection.chosen, start=1):
        seen = visibility.seen_by(int(row))
        first[seen] = np.where(first[seen] == never, step, first[seen])
    return first


def _classes(first_step: IntArray, step: int) -> IntArray:
    """Class ids of the target pieces once `step` stops are chosen."""
    conditions = [first_step < 0, first_step < step, first_step == step]
    choices = [palette.HIDDEN.number, palette.SEEN.number, palette.NEW.number]
    return np.select(conditions, choices, default=palette.UNSEEN.number)


def _draw_chosen(canvas: Canvas, selection: Selection, index: rr.TimeColumn) -> None:
    steps = len(selection.chosen)
    stops = f"{entities.SELECTION}/stops"
    counts = np.arange(steps + 1)
    xy = canvas.local(selection.xy)
    positions = np.concatenate([xy[:count] for count in counts])
    labels = [str(number + 1) for count in counts for number in range(count)]
    columns = rr.Points2D.columns(positions=positions, labels=labels)
    canvas.columns(stops, index, columns.partition(counts))
    canvas.show(
        stops,
        rr.Points2D.from_fields(
            colors=palette.STOP, radii=on_screen(4), show_labels=True, draw_order=ORDER["stop"]
        ),
    )
    final = rr.Points2D.from_fields(positions=xy, labels=[str(number + 1) for number in range(steps)])
    canvas.at(stops, final, mission_s=0.0, candidate=0)


def _plot_coverage(canvas: Canvas, selection: Selection, index: rr.TimeColumn) -> None:
    steps = len(selection.chosen)
    reached = np.concatenate([[0.0], selection.coverage_steps]) * 100
    chosen, required = f"{entities.METRIC_COVERAGE}/chosen", f"{entities.METRIC_COVERAGE}/required"
    canvas.columns(chosen, index, rr.Scalars.columns(scalars=reached))
    canvas.columns(required, index, rr.Scalars.columns(scalars=np.full(steps + 1, selection.required * 100)))
    canvas.show(chosen, rr.SeriesLines(colors=palette.STOP, names="coverage of the chosen stops", widths=2))
    canvas.show(required, rr.SeriesLines(colors=palette.ROOM_NAME, names="required", widths=1))
    for step, share in enumerate(selection.coverage_steps, start=1):
        canvas.say(f"stop {step} of {steps} chosen: coverage {share:.1%}", step=step)
    canvas.say(
        f"selection ({selection.method}): {steps} stops, coverage {selection.coverage:.1%},"
        f" at least {selection.bound} are needed",
        step=steps,
    )


def _draw_rooms(canvas: Canvas, rooms: tuple[Room, ...]) -> None:
    polygons = [polygon for room in rooms for polygon in room.polygons]
    _lines(canvas, f"{entities.FLOOR}/rooms", strokes.outlines(polygons), palette.ROOM, "room", THIN)
    named = [room for room in rooms if room.polygons]
    if not named:
        return
    at = [strokes.name_point(max(room.polygons, key=lambda polygon: polygon.area)) for room in named]
    points = rr.Points2D(
        canvas.local(np.array(at)),
        labels=[room.label for room in named],
        colors=palette.ROOM_NAME,
        radii=on_screen(1.5),
        show_labels=len(named) <= MOST_NAMES,
        draw_order=ORDER["line"],
    )
    canvas.show(f"{entities.FLOOR}/room_names", points)


def _draw_elements(canvas: Canvas, floor: FloorPlan, kind: str) -> None:
    elements = [
        item
        for item in floor.elements
        if (item.kind if item.kind in palette.KIND_COLOURS else "other") == kind
    ]
    if not elements:
        return
    colour = palette.KIND_COLOURS[kind]
    solids = [polygon for item in elements for polygon in item.solids]
    filled = strokes.fill(solids, spacing=0.05)
    if len(filled.lines):
        shape = rr.LineStrips2D(
            canvas.local(filled.lines), radii=filled.radii, colors=colour, draw_order=ORDER["solid"]
        )
        canvas.show(f"{entities.FLOOR}/{kind}/fill", shape)
    open_lines = [line for item in elements for line in item.lines]
    edges = strokes.outlines(solids) + open_lines
    _lines(canvas, f"{entities.FLOOR}/{kind}", edges, colour, "solid", THIN)


def _draw_openings(canvas: Canvas, openings: tuple[OpeningState, ...]) -> None:
    """Replaces what the floor drew: now it is known which openings the robot passes."""
    if not openings:
        return
    colours = [palette.PASSABLE if state.passable else palette.BLOCKED for state in openings]
    lines = rr.LineStrips2D(
        canvas.strips(state.opening.line for state in openings),
        colors=colours,
        radii=THICK,
        draw_order=ORDER["line"],
    )
    widths = [state.clear_width for state in openings]
    why = [state.why or "passable" for state in openings]
    canvas.show(f"{entities.FLOOR}/openings", lines, rr.AnyValues(clear_width=widths, why=why))


def _hatch_spacing(floor: FloorPlan) -> float:
    """Wide enough that hatches of a large floor do not run together on a screen."""
    left, low, right, high = bounds(polygon.exterior for polygon in floor.outline)
    return float(np.clip(max(right - left, high - low) / 90, 0.2, 1.0))


def _say_findings(canvas: Canvas, findings: Iterable[Finding]) -> None:
    for finding in findings:
        canvas.say(f"{finding.code}: {finding.message}", level="WARN")


def _lines(
    canvas: Canvas,
    entity: str,
    strips: Iterable[FloatArray],
    colour: palette.Colour,
    order: str,
    radius: float,
) -> None:
    local = canvas.strips(strips)
    if local:
        shape = rr.LineStrips2D(local, colors=colour, radii=radius, draw_order=ORDER[order])
        canvas.show(entity, shape)


def _rows_of_lines(
    canvas: Canvas, entity: str, index: rr.TimeColumn, lines: FloatArray, counts: IntArray
) -> None:
    columns = rr.LineStrips2D.columns(strips=canvas.local(lines))
    canvas.columns(entity, index, columns.partition(counts))


def _style(canvas: Canvas, entity: str, colour: palette.Colour, order: str, radius: float) -> None:
    fields = rr.LineStrips2D.from_fields(colors=colour, radii=radius, draw_order=ORDER[order])
    canvas.show(entity, fields)
