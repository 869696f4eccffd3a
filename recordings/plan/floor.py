"""Floor: outline, holes, rooms, elements and openings in 2D, and walls up to a nominal height in 3D."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr

from stopgo.mission.console.table import counted
from stopgo.mission.floor import Element, Finding, FloorPlan, Room
from stopgo.mission.geometry import FloatArray, Polygon, closed, outlines
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER, THICK, THIN, Pen, draw
from stopgo.recordings.plan import story
from stopgo.recordings.plan.story import describe_step

MOST_NAMES = 30
"""Number of rooms above which names would cover one another; they are then shown at the mouse pointer."""
CUT = 1.2
"""Height in metres at which walls are cut, low enough to look into the rooms: drawings contain no heights."""
SPANS = {"beams": (CUT, CUT + 0.15), "stairs": (0.0, 0.4), "windows": (0.8, CUT), "railings": (0.0, 0.9)}
"""Heights between which kinds other than walls and columns are drawn, to distinguish them."""


def draw_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Draw outline, holes, rooms with names, elements by kind, and openings."""
    edges = outlines(floor.outline)
    draw(canvas, entities.OUTLINE, edges, Pen(palette.OUTLINE, "floor", THICK))
    holes = [hole for polygon in floor.outline for hole in polygon.holes]
    draw(canvas, entities.HOLES, map(closed, holes), Pen(palette.HOLE, "line", THICK))
    _draw_rooms(canvas, floor.rooms)
    for kind in palette.KIND_COLOURS:
        _draw_elements(canvas, floor, kind)
    openings = [opening.line for opening in floor.openings]
    draw(canvas, entities.OPENINGS, openings, Pen(palette.PASSABLE, "line", THICK))
    log_findings(canvas, floor.findings)
    parts = f"{counted(len(floor.rooms), 'room')}, {counted(len(openings), 'opening')}"
    title = f"floor {floor.name}: {floor.area:.1f} m², {parts}"
    describe_step(canvas, story.FLOOR, title)


def raise_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Draw the slab, and every kind of element up to the cut."""
    slab = strokes.level(canvas.local(strokes.triangles(floor.outline)), -0.02)
    _mesh(canvas, entities.SLAB, slab, palette.SLAB)
    for kind, colour in palette.KIND_COLOURS.items():
        solids, lines = _shapes(floor, kind)
        low, high = SPANS.get(kind, (0.0, CUT))
        sides = strokes.walls(canvas.strips(outlines(solids) + lines), low=low, high=high)
        top = strokes.level(canvas.local(strokes.triangles(solids)), high)
        _mesh(canvas, entities.child(entities.WORLD_FLOOR, kind), np.concatenate([sides, top]), colour)


def log_findings(canvas: Canvas, findings: Iterable[Finding], *, step: int = story.FLOOR) -> None:
    """Log each finding as a warning."""
    for finding in findings:
        canvas.say(f"{finding.code}: {finding.message}", level="WARN", step=step)


def _draw_rooms(canvas: Canvas, rooms: tuple[Room, ...]) -> None:
    polygons = [polygon for room in rooms for polygon in room.polygons]
    draw(canvas, entities.ROOMS, outlines(polygons), Pen(palette.ROOM, "room", THIN))
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
    canvas.show(entities.ROOM_NAMES, points)


def _draw_elements(canvas: Canvas, floor: FloorPlan, kind: str) -> None:
    solids, lines = _shapes(floor, kind)
    colour, element = palette.KIND_COLOURS[kind], entities.child(entities.FLOOR, kind)
    filled = strokes.fill(solids, spacing=0.05)
    if len(filled.lines):
        shape = rr.LineStrips2D(
            canvas.local(filled.lines), radii=filled.radii, colors=colour, draw_order=ORDER["solid"]
        )
        canvas.show(entities.child(element, "fill"), shape)
    edges = outlines(solids) + lines
    draw(canvas, element, edges, Pen(colour, "solid", THIN), names=_names(floor, kind))


def _names(floor: FloorPlan, kind: str) -> list[str]:
    """Return the element of each edge of a kind, by the model's GlobalIds; empty if no element has one."""
    elements = _of_kind(floor, kind)
    if not any(item.global_id for item in elements):
        return []
    rings = [item for item in elements for polygon in item.solids for _ in polygon.rings]
    owners = [*rings, *(item for item in elements for _ in item.lines)]
    return [f"{item.id} {item.global_id or ''}".rstrip() for item in owners]


def _of_kind(floor: FloorPlan, kind: str) -> list[Element]:
    """Return elements of one kind; kinds without a colour count as `other`."""
    known = palette.KIND_COLOURS
    return [item for item in floor.elements if kind == (item.kind if item.kind in known else "other")]


def _shapes(floor: FloorPlan, kind: str) -> tuple[list[Polygon], list[FloatArray]]:
    """Return solids and open lines of one kind."""
    elements = _of_kind(floor, kind)
    solids = [polygon for item in elements for polygon in item.solids]
    return solids, [line for item in elements for line in item.lines]


def _mesh(canvas: Canvas, entity: str, faces: FloatArray, colour: palette.Colour) -> None:
    """Draw triangles (k, 3, 3) in one colour, shaded by the direction of each face."""
    if not len(faces):
        return
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    shape = rr.Mesh3D(
        vertex_positions=faces.reshape(-1, 3),
        vertex_normals=np.repeat(normal, 3, axis=0),
        albedo_factor=colour,
    )
    canvas.show(entity, shape)
