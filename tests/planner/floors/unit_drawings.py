"""Drawings in every unit, with and without each kind of evidence of it, and what becomes of their unit."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
from ezdxf.document import Drawing
from ezdxf.entities import DXFEntity
from ezdxf.layouts import Modelspace

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions
from stopgo.planner.floors.dxf_sheet import sheet_of
from stopgo.planner.floors.units.unit_lengths import METRES

CODES = (1, 2, 4, 5, 6, 14)
"""inch, foot, millimetre, centimetre, metre, decimetre."""
EVIDENCE = (
    "header",
    "header and round wall",
    "doors",
    "doors and round wall",
    "dimensions",
    "bare dimensions",
    "areas",
    "sides",
    "furniture",
    "stairs",
    "bare",
    "round wall",
    "texts",
    "wrong header and doors",
    "wrong header and dimensions",
    "wrong header and furniture",
)


class _Pen:
    """Draws in metres into a model space of another unit."""

    def __init__(self, model: Modelspace, unit: float) -> None:
        self._model, self.per_metre = model, 1.0 / unit

    def line(self, *points: tuple[float, float], layer: str = "A-WALL") -> None:
        moved = [(x * self.per_metre, y * self.per_metre) for x, y in points]
        for a, b in pairwise(moved):
            self._model.add_line(a, b, dxfattribs={"layer": layer})

    def arc(self, x: float, y: float, radius: float, start: float, end: float, layer: str) -> None:
        center = (x * self.per_metre, y * self.per_metre)
        self._model.add_arc(center, radius * self.per_metre, start, end, dxfattribs={"layer": layer})

    def box(self, x0: float, y0: float, x1: float, y1: float, *, layer: str = "A-WALL") -> None:
        self.line((x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0), layer=layer)


def house(seed: int, code: int, kind: str) -> Drawing:
    """A house of 2 by n rooms behind double lines, of random size, in one unit."""
    rng = np.random.default_rng(seed)
    drawing = ezdxf.new("R2010")
    names_header = "header" in kind
    wrong = CODES[(CODES.index(code) + 1 + seed % (len(CODES) - 1)) % len(CODES)]
    drawing.header["$INSUNITS"] = (wrong if "wrong" in kind else code) if names_header else 0
    pen = _Pen(drawing.modelspace(), METRES[code][1])
    width, depth = float(rng.uniform(2.5, 6.0)), float(rng.uniform(2.5, 6.0))
    count, thick = int(rng.integers(2, 9)), float(rng.uniform(0.12, 0.4))
    _walls(pen, width, depth, count, thick, round_="round" in kind)
    for k in range(count if "doors" in kind else 0):
        _door(pen, k * (width + thick) + 0.5, depth, float(rng.uniform(0.75, 1.0)))
    if "dimensions" in kind:
        _dimensions(drawing, pen, width, depth, count, thick, said="bare" not in kind)
    if "areas" in kind:
        _areas(drawing, pen, width, depth, count, thick)
    if "sides" in kind:
        _sides(pen, drawing, width, depth, count, thick)
    if "furniture" in kind:
        _furniture(drawing, pen, rng)
    if "stairs" in kind:
        going = float(rng.uniform(0.25, 0.31))
        for k in range(9):
            pen.line((0.2, 0.2 + k * going), (1.2, 0.2 + k * going), layer="A-FLOR-STRS")
    if "texts" in kind:
        height = float(rng.uniform(0.1, 0.3)) * pen.per_metre
        drawing.modelspace().add_text("Hall", height=height, dxfattribs={"layer": "A-NOTE"})
    return drawing


def _walls(pen: _Pen, width: float, depth: float, count: int, thick: float, *, round_: bool) -> None:
    step, top = width + thick, 2 * depth + thick
    pen.box(-thick, -thick, count * step, top + thick)
    for k in range(count):
        pen.box(k * step, 0, k * step + width, depth)
        if not round_ or k:
            pen.box(k * step, depth + thick, k * step + width, top)
    if round_:
        radius = min(width, depth) / 2
        for r in (radius, radius + thick):
            pen.arc(radius, top - radius, r, 90, 180, "A-WALL")
        pen.line((0, depth + thick), (0, top - radius))
        pen.line((radius, top), (width, top), (width, depth + thick), (0, depth + thick))


def _door(pen: _Pen, x: float, y: float, leaf: float) -> None:
    pen.line((x, y), (x, y - leaf), layer="A-DOOR")
    pen.arc(x, y, leaf, 270, 360, "A-DOOR")


def _dimensions(
    drawing: Drawing, pen: _Pen, width: float, depth: float, count: int, thick: float, *, said: bool
) -> None:
    for k in range(count):
        start = k * (width + thick)
        text = f"{width * 100:.0f} cm" if said else f"{width:.2f}"
        dimension: Any = drawing.modelspace().add_linear_dim(
            base=(0, -1 * pen.per_metre),
            p1=(start * pen.per_metre, 0),
            p2=((start + width) * pen.per_metre, 0),
            text=text,
            dxfattribs={"layer": "A-ANNO-DIMS"},
        )
        dimension.render()


def _areas(drawing: Drawing, pen: _Pen, width: float, depth: float, count: int, thick: float) -> None:
    model = drawing.modelspace()
    for k in range(count):
        x = k * (width + thick)
        corners = [(x, 0), (x + width, 0), (x + width, depth), (x, depth)]
        moved = [(a * pen.per_metre, b * pen.per_metre) for a, b in corners]
        model.add_lwpolyline(moved, close=True, dxfattribs={"layer": "A-AREA"})
        place = ((x + 0.5) * pen.per_metre, 1.0 * pen.per_metre)
        text = model.add_text(f"Room {k} {width * depth:.1f} m2", dxfattribs={"layer": "A-AREA-IDEN"})
        text.set_placement(place)
        text.dxf.height = 0.2 * pen.per_metre


def _sides(pen: _Pen, drawing: Drawing, width: float, depth: float, count: int, thick: float) -> None:
    for k in range(count):
        place = ((k * (width + thick) + 0.4 * width) * pen.per_metre, 0.5 * depth * pen.per_metre)
        text = drawing.modelspace().add_text(f"{width:.2f}m x {depth:.2f}m", dxfattribs={"layer": "A-NOTE"})
        text.set_placement(place)


def _furniture(drawing: Drawing, pen: _Pen, rng: np.random.Generator) -> None:
    """A bed and a toilet, each a block of its own."""
    for name, low, high in (("Bed double", 1.9, 2.2), ("WC-01", 0.58, 0.75)):
        block = drawing.blocks.new(name)
        length = float(rng.uniform(low, high)) * pen.per_metre
        block.add_lwpolyline([(0, 0), (length, 0), (length, 0.6 * length), (0, 0.6 * length)], close=True)
        drawing.modelspace().add_blockref(name, (pen.per_metre, pen.per_metre), {"layer": "A-FURN"})


def rescaled(path: Path, code: int, kind: str, *, own: int = 6) -> Drawing:
    """A drawing, whose unit has the code `own`, in another unit.

    Without a header, unless `kind` is `header` or `wrong header`; without doors or dimensions if it says so.
    """
    drawing = ezdxf.readfile(path)
    headers = {"header": code, "wrong header": CODES[(CODES.index(code) + 1) % len(CODES)]}
    drawing.header["$INSUNITS"] = headers.get(kind, 0)
    factor = METRES[own][1] / METRES[code][1]
    for entity in list(drawing.modelspace()):
        if _is_left_out(entity, kind):
            drawing.modelspace().delete_entity(entity)
        else:
            entity.scale(factor, factor, factor)  # type: ignore[attr-defined]
    return drawing


def _is_left_out(entity: DXFEntity, kind: str) -> bool:
    layer = entity.dxf.layer.upper()
    if kind == "no doors":
        return "DOOR" in layer or "PASSAGE" in layer or "PUERTA" in layer
    return kind == "no dimensions" and entity.dxftype() == "DIMENSION"


def verdict(drawing: Drawing, code: int, path: Path) -> str:
    """`right` or `wrong` for a unit that is believed, `asked` where the user must name it."""
    try:
        sheet = sheet_of(drawing, FloorOptions(), source=path)
    except InputError as error:
        assert "--units" in str(error), error
        return "asked"
    return "right" if abs(sheet.scale / METRES[code][1] - 1) < 1e-6 else "wrong"
