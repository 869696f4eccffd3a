"""Navigable space: where the robot may drive and stop, what it passes, and what is to be scanned."""

from __future__ import annotations

import numpy as np
import rerun as rr

from stopgo.mission.console.table import counted
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import bounds, outlines
from stopgo.mission.stages import NavigableSpace, OpeningState
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.drawing.pens import ORDER, THICK, THIN, Pen, draw
from stopgo.recordings.plan.floor import log_findings
from stopgo.recordings.plan.story import SPACE, describe_step


def draw_space(canvas: Canvas, space: NavigableSpace) -> None:
    """Draw the navigable space, the openings that the robot passes, and the targets."""
    spacing = _hatch_spacing(space.floor)
    drive = strokes.hatch(space.drive_area, spacing=spacing, angle=np.pi / 4)
    draw(canvas, entities.DRIVE_AREA, drive, Pen(palette.DRIVE, "area", THIN), step=SPACE, planning_only=True)
    stop_polygons = [polygon for room in space.rooms for polygon in room.stop_area]
    stop_area = strokes.hatch(stop_polygons, spacing=spacing, angle=-np.pi / 4)
    inside = Pen(palette.STOP_AREA, "area", THIN)
    draw(canvas, entities.STOP_AREA, stop_area, inside, step=SPACE, planning_only=True)
    edges = outlines(stop_polygons)
    draw(canvas, entities.STOP_AREA_EDGE, edges, Pen(palette.STOP_AREA, "area", THIN), step=SPACE)
    draw(canvas, entities.GAPS, space.gaps, Pen(palette.GAP, "line", THICK), step=SPACE)
    _draw_openings(canvas, space.openings)
    targets = space.targets
    lines = np.stack([targets.a, targets.b], axis=1)
    draw(
        canvas,
        entities.TARGETS,
        lines,
        Pen(palette.TARGET.colour, "target", THIN),
        step=SPACE,
        planning_only=True,
    )
    new = [item for item in space.findings if item not in space.floor.findings]
    log_findings(canvas, new, step=SPACE)
    title = f"navigable space: {counted(len(space.rooms), 'room')}, {targets.total} target units"
    describe_step(canvas, SPACE, title, "Blue: where the robot may drive. Green: where it may stop and scan.")


def _hatch_spacing(floor: FloorPlan) -> float:
    """Wide enough that hatches of a large floor do not run together on a screen."""
    left, low, right, high = bounds(polygon.exterior for polygon in floor.outline)
    return float(np.clip(max(right - left, high - low) / 90, 0.2, 1.0))


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
    canvas.show(entities.OPENINGS, lines, rr.AnyValues(clear_width=widths, why=why))
