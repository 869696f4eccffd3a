"""Writes a floor as a layered DXF in metres, so that reading it returns the same floor.

Layers are those of the reader of layered drawings: FLOOR, ROOMS, WALLS and so on. GlobalIds are XDATA
of application IFC, group 1000.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from stopgo.mission.console.table import printable
from stopgo.mission.files.dxf_bytes import encoded, reproducible
from stopgo.mission.floor import FloorPlan, Room
from stopgo.mission.geometry import FloatArray, Polygon
from stopgo.mission.settings.element_kinds import KINDS, kind_of

if TYPE_CHECKING:
    from ezdxf.entities import DXFEntity
    from ezdxf.layouts import Modelspace

COLOURS = {"FLOOR": 8, "ROOMS": 3, "DOORS": 5, "PASSAGES": 150}
"""AutoCAD colours of the layers that hold no elements."""
TEXT = 0.2
"""Height of a room's name in metres."""


def layered_dxf(floor: FloorPlan) -> bytes:
    """Return the drawing's bytes; equal floors give equal bytes."""
    import ezdxf.colors
    import ezdxf.units

    with reproducible():
        drawing = ezdxf.new("R2010", units=ezdxf.units.M)
        drawing.appids.add("IFC")
        for name, colour in COLOURS.items():
            drawing.layers.add(name, color=colour)
        for kind in KINDS.values():
            drawing.layers.add(kind.name.upper(), true_color=ezdxf.colors.rgb2int(kind.rgb))
        _draw(drawing.modelspace(), floor)
        return encoded(drawing)


def _draw(space: Modelspace, floor: FloorPlan) -> None:
    for part in floor.outline:
        _rings(space, part, "FLOOR", None)
    for room in floor.rooms:
        for part in room.polygons:
            _rings(space, part, "ROOMS", room.global_id)
        _name(space, room)
    for element in floor.elements:
        layer = kind_of(element.kind).name.upper()
        for part in element.solids:
            _rings(space, part, layer, element.global_id)
        for line in element.lines:
            _marked(space.add_lwpolyline(line.tolist(), dxfattribs={"layer": layer}), element.global_id)
    for opening in floor.openings:
        layer = "DOORS" if opening.kind == "door" else "PASSAGES"
        a, b = opening.line.tolist()
        _marked(space.add_line(a, b, dxfattribs={"layer": layer}), opening.global_id)


def _rings(space: Modelspace, part: Polygon, layer: str, global_id: str | None) -> None:
    """Add the outer ring counter-clockwise, and its holes clockwise."""
    for ring in part.rings:
        _marked(space.add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": layer}), global_id)


def _marked(entity: DXFEntity, global_id: str | None) -> None:
    if global_id:
        entity.set_xdata("IFC", [(1000, global_id)])


def _name(space: Modelspace, room: Room) -> None:
    if room.name:
        look = {"layer": "ROOMS", "height": TEXT, "insert": _inside(room).tolist()}
        space.add_text(printable(room.name), dxfattribs=look)


def _inside(room: Room) -> FloatArray:
    """Return a point in the room's largest part, far from its edges."""
    import shapely

    parts = [shapely.Polygon(part.exterior, part.holes) for part in room.polygons]
    largest = max(parts, key=lambda part: part.area)
    return np.round(shapely.get_coordinates(largest.point_on_surface())[0], 4)
