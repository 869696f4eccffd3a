"""The floor and what the stops see in 3D, with walls cut at a nominal height: drawings tell no heights."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mission.floor import FloorPlan
from mission.geometry import FloatArray
from mission.planning import Selection
from recordings import entities, palette, strokes
from recordings.canvas import Canvas
from recordings.stages import step_of_units

CUT = 1.2
"""Height in metres at which elements are cut, low enough to look into the rooms."""
SPANS = {"beams": (CUT, CUT + 0.15), "stairs": (0.0, 0.4), "windows": (0.8, CUT), "railings": (0.0, 0.9)}
"""From where to where other kinds than walls and columns are drawn, so that they are told apart."""
SKIN = 0.01
"""How far the painted targets stand clear of the cut, so that both are seen."""


def raise_floor(canvas: Canvas, floor: FloorPlan) -> None:
    """Slab, and every kind of element up to the cut."""
    slab = strokes.level(canvas.local(strokes.triangles(floor.outline)), -0.02)
    _mesh(canvas, f"{entities.WORLD_FLOOR}/slab", slab, palette.SLAB)
    for kind, colour in palette.KIND_COLOURS.items():
        elements = [item for item in floor.elements if item.kind == kind]
        solids = [polygon for item in elements for polygon in item.solids]
        lines = [line for item in elements for line in item.lines]
        low, high = SPANS.get(kind, (0.0, CUT))
        sides = strokes.walls(canvas.strips(strokes.outlines(solids) + lines), low=low, high=high)
        top = strokes.level(canvas.local(strokes.triangles(solids)), high)
        _mesh(canvas, f"{entities.WORLD_FLOOR}/{kind}", np.concatenate([sides, top]), colour)


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
            canvas.show(f"{entities.WORLD_COVERAGE}/{name}", shape)


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
