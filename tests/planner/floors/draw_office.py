"""Draws `office.dxf`, the sample floor of the demonstration: an office of 26 by 13 m on one storey.

    python -m tests.planner.floors.draw_office [office.dxf]

Its bytes are the same every time, so that a plan of the sample can be repeated.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import ezdxf
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.layouts import Modelspace

from stopgo.mission.files.dxf_bytes import encoded, reproducible

Interval = tuple[float, float]
Box = tuple[float, float, float, float]
"""Least x, least y, greatest x, greatest y, in metres."""

LAYERS = {
    "FLOOR": 8,
    "ROOMS": 3,
    "WALLS": 7,
    "COLUMNS": 1,
    "BEAMS": 6,
    "STAIRS": 30,
    "DOORS": 5,
    "PASSAGES": 4,
    "WINDOWS": 140,
    "RAILINGS": 42,
}
"""Layer names and their colours (AutoCAD index)."""

SLAB: Box = (0.0, 0.0, 26.0, 13.0)
LIFT: Box = (10.72, 7.46, 13.0, 9.36)
STAIRWELL: Box = (14.6, 9.2, 15.6, 12.2)
FLIGHT: Box = (15.7, 9.2, 16.8, 12.2)
TREADS = 11

ROOMS: dict[str, Box] = {
    "101 Conference": (0.3, 0.3, 7.0, 5.54),
    "102 Office": (7.12, 0.3, 11.6, 5.54),
    "103 Archive": (11.72, 0.3, 15.94, 5.54),
    "104 Open office": (16.06, 0.3, 25.7, 7.34),
    "105 Corridor": (0.3, 5.66, 16.06, 7.34),
    "106 Office": (0.3, 7.46, 5.4, 12.7),
    "107 Kitchen": (5.52, 7.46, 10.4, 12.7),
    "108 WC": (10.52, 9.56, 13.2, 12.7),
    "109 Stairs": (13.32, 7.46, 16.8, 12.7),
    "110 Workshop": (16.92, 7.46, 25.7, 12.7),
}

WALLS_ALONG_X: dict[str, tuple[Interval, Interval, tuple[Interval, ...], tuple[Interval, ...]]] = {
    "south": (
        (0.0, 26.0),
        (0.0, 0.3),
        (),
        ((1.2, 3.2), (4.2, 6.2), (8.4, 10.4), (17.2, 19.2), (20.2, 22.2), (23.2, 25.2)),
    ),
    "north": (
        (0.0, 26.0),
        (12.7, 13.0),
        (),
        ((1.8, 3.8), (6.9, 8.9), (11.4, 12.2), (18.0, 21.0), (22.0, 25.0)),
    ),
    "corridor south": ((0.3, 16.06), (5.54, 5.66), ((5.6, 6.5), (7.6, 8.5), (12.2, 13.0)), ()),
    "corridor north": (
        (0.3, 25.7),
        (7.34, 7.46),
        ((4.0, 4.9), (6.2, 7.1), (11.4, 12.3), (13.6, 14.6), (17.6, 18.6)),
        (),
    ),
    "lift north": ((10.52, 13.2), (9.36, 9.56), (), ()),
}
"""Walls along x: range in x, range in y, their doors, their windows."""

WALLS_ALONG_Y: dict[str, tuple[Interval, Interval, tuple[Interval, ...], tuple[Interval, ...]]] = {
    "west": ((0.3, 12.7), (0.0, 0.3), ((5.95, 7.05),), ((1.6, 3.6), (9.4, 11.4))),
    "east": ((0.3, 12.7), (25.7, 26.0), (), ((1.2, 3.2), (4.2, 6.2))),
    "101-102": ((0.3, 5.54), (7.0, 7.12), (), ()),
    "102-103": ((0.3, 5.54), (11.6, 11.72), (), ()),
    "103-104": ((0.3, 5.54), (15.94, 16.06), (), ()),
    "106-107": ((7.46, 12.7), (5.4, 5.52), (), ()),
    "107-108": ((7.46, 12.7), (10.4, 10.52), (), ()),
    "lift west": ((7.46, 9.36), (10.52, 10.72), (), ()),
    "lift east": ((7.46, 9.36), (13.0, 13.2), (), ()),
    "108-109": ((7.46, 12.7), (13.2, 13.32), ((10.4, 11.3),), ()),
    "109-110": ((7.46, 12.7), (16.8, 16.92), (), ()),
}
"""Walls along y: range in y, range in x, their doors, their windows."""

SQUARE_COLUMNS = ((18.8, 2.4), (22.6, 2.4))
ROUND_COLUMNS = ((18.8, 5.2), (22.6, 5.2))
BEAMS_ALONG_X = (2.4, 5.2)
BEAMS_ALONG_Y = (18.8, 22.6)
OPEN_BOUNDARY = ((16.06, 5.66), (16.06, 7.34))


def draw() -> bytes:
    """Return the DXF file."""
    with reproducible():
        drawing = _empty_drawing()
        _draw_all(drawing.modelspace())
        return encoded(drawing)


def _empty_drawing() -> Drawing:
    drawing = ezdxf.new("R2010", units=ezdxf.units.M)
    drawing.appids.add("IFC")
    for name, color in LAYERS.items():
        drawing.layers.add(name, color=color)
    return drawing


def _draw_all(model: Modelspace) -> None:
    for box in (SLAB, LIFT, STAIRWELL):
        _rectangle(model, box, layer="FLOOR")
    for name, box in ROOMS.items():
        _room(model, name, box)
    for name, (along, across, doors, windows) in WALLS_ALONG_X.items():
        _wall(model, name, along, across, doors=doors, windows=windows, along_y=False)
    for name, (along, across, doors, windows) in WALLS_ALONG_Y.items():
        _wall(model, name, along, across, doors=doors, windows=windows, along_y=True)
    _structure(model)
    _stairs(model)
    model.add_line(*OPEN_BOUNDARY, dxfattribs={"layer": "PASSAGES"})


def _rectangle(model: Modelspace, box: Box, *, layer: str, global_id: str | None = None) -> None:
    x0, y0, x1, y1 = box
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    ring = model.add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
    if global_id:
        ring.set_xdata("IFC", [(1000, global_id)])


def _room(model: Modelspace, name: str, box: Box) -> None:
    _rectangle(model, box, layer="ROOMS", global_id=_global_id(f"room {name}"))
    # The name is placed where neither stairs nor columns are.
    at = (box[0] + 0.4, box[1] + 0.4)
    label = model.add_text(name, height=0.25, dxfattribs={"layer": "ROOMS"})
    label.set_placement(at, align=TextEntityAlignment.LEFT)


def _wall(
    model: Modelspace,
    name: str,
    along: Interval,
    across: Interval,
    *,
    doors: Sequence[Interval],
    windows: Sequence[Interval],
    along_y: bool,
) -> None:
    """Draw one wall, cut by its doors and windows; all its parts have the wall's GlobalId."""
    for wall_part in _wall_parts(along, (*doors, *windows)):
        _rectangle(
            model,
            _box(wall_part, across, along_y=along_y),
            layer="WALLS",
            global_id=_global_id(f"wall {name}"),
        )
    middle = (across[0] + across[1]) / 2
    for number, door in enumerate(doors):
        x0, y0, x1, y1 = _box(door, (middle, middle), along_y=along_y)
        line = model.add_line((x0, y0), (x1, y1), dxfattribs={"layer": "DOORS"})
        line.set_xdata("IFC", [(1000, _global_id(f"door {name} {number}"))])
    glass = (middle - 0.04, middle + 0.04)
    for number, window in enumerate(windows):
        box = _box(window, glass, along_y=along_y)
        _rectangle(model, box, layer="WINDOWS", global_id=_global_id(f"window {name} {number}"))


def _wall_parts(along: Interval, gaps: Sequence[Interval]) -> Iterator[Interval]:
    start = along[0]
    for gap in sorted(gaps):
        yield (start, gap[0])
        start = gap[1]
    yield (start, along[1])


def _box(along: Interval, across: Interval, *, along_y: bool) -> Box:
    if along_y:
        return (across[0], along[0], across[1], along[1])
    return (along[0], across[0], along[1], across[1])


def _structure(model: Modelspace) -> None:
    for x, y in SQUARE_COLUMNS:
        box = (x - 0.2, y - 0.2, x + 0.2, y + 0.2)
        _rectangle(model, box, layer="COLUMNS", global_id=_global_id(f"column {x} {y}"))
    for x, y in ROUND_COLUMNS:
        circle = model.add_circle((x, y), radius=0.2, dxfattribs={"layer": "COLUMNS"})
        circle.set_xdata("IFC", [(1000, _global_id(f"column {x} {y}"))])
    x0, y0, x1, y1 = ROOMS["104 Open office"]
    for y in BEAMS_ALONG_X:
        _rectangle(model, (x0, y - 0.15, x1, y + 0.15), layer="BEAMS", global_id=_global_id(f"beam y {y}"))
    for x in BEAMS_ALONG_Y:
        _rectangle(model, (x - 0.15, y0, x + 0.15, y1), layer="BEAMS", global_id=_global_id(f"beam x {x}"))


def _stairs(model: Modelspace) -> None:
    """Draw a flight up along the wall, next to it the well of the flight down, and its railing."""
    _rectangle(model, FLIGHT, layer="STAIRS", global_id=_global_id("stairs up"))
    x0, y0, x1, y1 = FLIGHT
    for tread in range(1, TREADS):
        y = y0 + (y1 - y0) * tread / TREADS
        model.add_line((x0, y), (x1, y), dxfattribs={"layer": "STAIRS"})
    x0, y0, x1, y1 = STAIRWELL
    rail = [
        *((x1, y0 - 0.05), (x0 - 0.05, y0 - 0.05), (x0 - 0.05, y1 + 0.05), (x1, y1 + 0.05)),
        *((x1, y1), (x0, y1), (x0, y0), (x1, y0)),
    ]
    ring = model.add_lwpolyline(rail, close=True, dxfattribs={"layer": "RAILINGS"})
    ring.set_xdata("IFC", [(1000, _global_id("railing"))])


def _global_id(name: str) -> str:
    """Return an IFC GlobalId, 22 digits to base 64, made from a name."""
    digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
    number = int.from_bytes(hashlib.sha256(name.encode()).digest()[:16], "big")
    return "".join(digits[number >> shift & 63] for shift in range(126, -1, -6))


def main() -> None:
    default = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    path.write_bytes(draw())


if __name__ == "__main__":
    main()
