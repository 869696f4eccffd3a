"""The floor: outline, holes, rooms, elements and openings in 2D, and walls cut at a nominal height in 3D."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr

from stopgo.mission.floor import Element, Finding, FloorPlan, Room
from stopgo.mission.geometry import FloatArray, Polygon
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.pens import ORDER, THICK, THIN, Pen, draw
from stopgo.recordings.plan import story
from stopgo.recordings.plan.story import tell_step

MOST_NAMES = 30
"""With more rooms than these their names hide one another, and are shown where the mouse points."""
CUT = 1.2
"""Height in metres at which walls are cut, low enough to look into the rooms: drawings tell no heights."""
SPANS = {"beams": (CUT, CUT + 0.15), "stairs": (0.0, 0.4), "windows": (0.8, CUT), "railings": (0.0, 0.9)}
"""From where to where other kinds than walls and columns are drawn, so that they are told apart."""


def draw_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Outline, holes, rooms with names, elements by kind, openings."""
    edges = strokes.outlines(floor.outline)
    draw(canvas, entities.OUTLINE, edges, Pen(palette.OUTLINE, "floor", THICK))
    holes = [hole for polygon in floor.outline for hole in polygon.holes]
    draw(canvas, entities.HOLES, map(strokes.closed, holes), Pen(palette.HOLE, "line", THICK))
    _draw_rooms(canvas, floor.rooms)
    for kind in palette.KIND_COLOURS:
        _draw_elements(canvas, floor, kind)
    openings = [opening.line for opening in floor.openings]
    draw(canvas, entities.OPENINGS, openings, Pen(palette.PASSABLE, "line", THICK))
    say_findings(canvas, floor.findings)
    told = f"floor {floor.name}: {floor.area:.1f} m², {len(floor.rooms)} rooms, {len(openings)} openings"
    tell_step(canvas, story.FLOOR, told)


def raise_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Slab, and every kind of element up to the cut."""
    slab = strokes.level(canvas.local(strokes.triangles(floor.outline)), -0.02)
    _mesh(canvas, entities.SLAB, slab, palette.SLAB)
    for kind, colour in palette.KIND_COLOURS.items():
        solids, lines = _shapes(floor, kind)
        low, high = SPANS.get(kind, (0.0, CUT))
        sides = strokes.walls(canvas.strips(strokes.outlines(solids) + lines), low=low, high=high)
        top = strokes.level(canvas.local(strokes.triangles(solids)), high)
        _mesh(canvas, entities.part(entities.WORLD_FLOOR, kind), np.concatenate([sides, top]), colour)


def say_findings(canvas: Canvas, findings: Iterable[Finding], *, step: int = story.FLOOR) -> None:
    """Each finding as a warning in the plan's log."""
    for finding in findings:
        canvas.say(f"{finding.code}: {finding.message}", level="WARN", step=step)


def _draw_rooms(canvas: Canvas, rooms: tuple[Room, ...]) -> None:
    polygons = [polygon for room in rooms for polygon in room.polygons]
    draw(canvas, entities.ROOMS, strokes.outlines(polygons), Pen(palette.ROOM, "room", THIN))
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
    colour, element = palette.KIND_COLOURS[kind], entities.part(entities.FLOOR, kind)
    filled = strokes.fill(solids, spacing=0.05)
    if len(filled.lines):
        shape = rr.LineStrips2D(
            canvas.local(filled.lines), radii=filled.radii, colors=colour, draw_order=ORDER["solid"]
        )
        canvas.show(entities.part(element, "fill"), shape)
    edges = strokes.outlines(solids) + lines
    draw(canvas, element, edges, Pen(colour, "solid", THIN), names=_names(floor, kind))


def _names(floor: FloorPlan, kind: str) -> list[str]:
    """What each edge of a kind belongs to, by the model's GlobalIds; empty where no element has one."""
    elements = _of_kind(floor, kind)
    if not any(item.global_id for item in elements):
        return []
    rings = [item for item in elements for polygon in item.solids for _ in polygon.rings]
    owners = [*rings, *(item for item in elements for _ in item.lines)]
    return [f"{item.id} {item.global_id or ''}".rstrip() for item in owners]


def _of_kind(floor: FloorPlan, kind: str) -> list[Element]:
    """Elements of one kind; kinds without a colour count as `other`."""
    known = palette.KIND_COLOURS
    return [item for item in floor.elements if kind == (item.kind if item.kind in known else "other")]


def _shapes(floor: FloorPlan, kind: str) -> tuple[list[Polygon], list[FloatArray]]:
    """Solids and open lines of one kind."""
    elements = _of_kind(floor, kind)
    solids = [polygon for item in elements for polygon in item.solids]
    return solids, [line for item in elements for line in item.lines]


def _mesh(canvas: Canvas, entity: str, faces: FloatArray, colour: palette.Colour) -> None:
    """Triangles (k, 3, 3) in one colour, shaded by the direction each faces."""
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
