"""DXF layers with stops, route and coverage, over the floor's drawing or alone.

| layer | what |
|---|---|
| SCAN_STOPS | a block SCAN_STOP per stop: number, id, an arrow where it faces, further attributes hidden |
| SCAN_ROUTE | a polyline per leg, the return leg dashed, a mark at the start |
| SCAN_COVERAGE | stretches of boundary that the stops see |
| SCAN_NOT_SEEN | the other stretches of the targets |

The rest of the drawing stays unchanged.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from stopgo.mission.console.table import printable
from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.errors import InputError, StopgoError
from stopgo.mission.files.exports.format import Supplements

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities import Insert
    from ezdxf.layouts import Modelspace

STOPS, ROUTE, SEEN, UNSEEN = "SCAN_STOPS", "SCAN_ROUTE", "SCAN_COVERAGE", "SCAN_NOT_SEEN"
LAYERS = {STOPS: (6, 30), ROUTE: (5, 35), SEEN: (3, 50), UNSEEN: (1, 50)}
"""Colour (AutoCAD's index) and line weight (hundredths of a millimetre) of each layer."""

MODEL = "IFC"
"""Names the data of a line that hold the GlobalId of its element."""

BROKEN_DRAWING = (ArithmeticError, AssertionError, AttributeError, LookupError, TypeError, ValueError)
"""Errors of ezdxf for a drawing that is damaged inside."""

DISC = 0.3
"""Radius of a stop's disc in metres."""
TEXT = 0.22
"""Height of text in metres."""


def write(mission: Mission, supplements: Supplements) -> bytes:
    """The drawing with the layers added, in the drawing's own unit and version."""
    drawing, size = _paper(supplements)
    _make_layers(drawing)
    space = drawing.modelspace()
    found = supplements.coverage
    if found is not None and any((*found.seen_of, *found.unseen_of)) and MODEL not in drawing.appids:
        drawing.appids.add(MODEL)
    for (a, b), layer, element in _stretches(supplements):
        line = space.add_line(_at(a, size), _at(b, size), dxfattribs={"layer": layer})
        if element:
            line.set_xdata(MODEL, [(1000, element)])
    _draw_route(drawing, mission, size)
    _draw_stops(drawing, mission, size)
    return _written(drawing)[0]


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the positions of the blocks on SCAN_STOPS, in metres.

    Raises
    ------
    StopgoError
        When an audit finds more faults than in the floor's drawing alone.
    """
    drawing = _decoded(data)
    bare, size = _paper(supplements)
    if _amiss(drawing) > _amiss(bare):
        raise StopgoError(
            "the drawing is not sound with the layers added; the file was not saved, please report this"
        )
    blocks = [item for item in drawing.modelspace().query("INSERT") if item.dxf.layer == STOPS]
    return [(item.dxf.insert.x / size, item.dxf.insert.y / size) for item in blocks]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the notes on what the layers lack."""
    found = []
    if supplements.floor is None:
        found.append("no --floor: the layers stand alone, in metres, without the drawing")
    elif faults := _written(supplements.floor.open())[1]:
        found.append(
            f"the floor's drawing had {faults} faults that had to be mended to write it; compare the two"
        )
    if supplements.coverage is None:
        found.append("no --coverage-file: layers SCAN_COVERAGE and SCAN_NOT_SEEN stay empty")
    return tuple(found)


def _paper(supplements: Supplements) -> tuple[Drawing, float]:
    """The drawing to draw on, and how many of its units make a metre."""
    import ezdxf

    if supplements.floor is not None:
        return supplements.floor.open(), 1.0 / supplements.floor.unit
    return ezdxf.new("R2010", units=6), 1.0


def _make_layers(drawing: Drawing) -> None:
    for name, (colour, weight) in LAYERS.items():
        if name in drawing.layers:
            raise InputError(
                f"the floor's drawing has a layer {name} already; rename or delete it there, and plan again"
            )
        drawing.layers.add(name, color=colour, lineweight=weight)


def _stretches(supplements: Supplements) -> Iterator[tuple[list[Point], str, str]]:
    """Each stretch with its layer, and the GlobalId of the element that it is of."""
    found = supplements.coverage
    if found is not None:
        for stretches, elements, layer in (
            (found.seen, found.seen_of, SEEN), (found.unseen, found.unseen_of, UNSEEN),
        ):  # fmt: skip
            of = elements or ("",) * len(stretches)
            for stretch, element in zip(stretches.tolist(), of, strict=True):
                yield stretch, layer, element


def _draw_route(drawing: Drawing, mission: Mission, size: float) -> None:
    space = drawing.modelspace()
    look: dict[str, object] = {"layer": ROUTE}
    for stop in mission.stops:
        _polyline(space, stop.approach, size, look)
    if mission.return_ is not None:
        _polyline(space, mission.return_, size, {**look, **_dashes(drawing, size)})
    mark = _start_block(drawing)
    place = {"xscale": size, "yscale": size, "zscale": size, "rotation": math.degrees(mission.start.heading)}
    space.add_blockref(mark, _at((mission.start.x, mission.start.y), size), dxfattribs={**look, **place})


def _polyline(space: Modelspace, leg: Sequence[Point], size: float, look: dict[str, object]) -> None:
    points = [_at(point, size) for point in leg]
    if len(points) < 2:
        return
    if space.dxfversion == "AC1009":  # R12 knows no LWPOLYLINE
        space.add_polyline2d(points, dxfattribs=look)
    else:
        space.add_lwpolyline(points, dxfattribs=look)


def _dashes(drawing: Drawing, size: float) -> dict[str, object]:
    """A line type of 30 cm dashes, whatever the drawing's scale of line types."""
    name = _free("SCAN_BACK", drawing.linetypes)
    drawing.linetypes.add(name, [0.45 * size, 0.3 * size, -0.15 * size])
    scale = drawing.header.get("$LTSCALE", 1.0)
    return {"linetype": name, "ltscale": 1.0 / scale if scale > 0 else 1.0}


def _start_block(drawing: Drawing) -> str:
    """Draw a ring around the first position with an arrowhead in the robot's heading, in metres."""
    name = _free("SCAN_START", drawing.blocks)
    block = drawing.blocks.new(name)
    block.add_circle((0, 0), 1.5 * DISC, dxfattribs=_BLOCK)
    block.add_solid(_arrowhead(1.5 * DISC), dxfattribs=_BLOCK)
    return name


def _draw_stops(drawing: Drawing, mission: Mission, size: float) -> None:
    block = _stop_block(drawing)
    for number, stop in enumerate(mission.stops, 1):
        place = {"xscale": size, "yscale": size, "zscale": size, "rotation": math.degrees(stop.heading)}
        insert = drawing.modelspace().add_blockref(
            block, _at((stop.x, stop.y), size), dxfattribs={"layer": STOPS, **place}
        )
        _label(insert, number, stop, size)


def _stop_block(drawing: Drawing) -> str:
    """Draw a disc with an arrow along +x, in metres; on layer 0, with the colour of the block's layer."""
    name = _free("SCAN_STOP", drawing.blocks)
    block = drawing.blocks.new(name)
    block.add_circle((0, 0), DISC, dxfattribs=_BLOCK)
    block.add_line((DISC, 0), (1.8 * DISC, 0), dxfattribs=_BLOCK)
    block.add_solid(_arrowhead(1.8 * DISC), dxfattribs=_BLOCK)
    for tag, prompt in _PROMPTS.items():
        hidden = {} if tag in _SHOWN else {"flags": 1}
        block.add_attdef(tag, (0, 0), height=TEXT, dxfattribs={"prompt": prompt, **hidden})
    return name


_BLOCK: dict[str, object] = {"layer": "0", "color": 0}
_SHOWN = ("NUMBER", "ID")
_PROMPTS = {
    "NUMBER": "position in the order of driving",
    "ID": "stop's id",
    "X_M": "x in metres",
    "Y_M": "y in metres",
    "HEADING_DEG": "degrees counter-clockwise from +x",
    "DOORWAY": "whether it is in a doorway",
    "PROFILE": "scanner's profile",
    "SCAN_S": "scan's duration in seconds",
}


def _label(insert: Insert, number: int, stop: Stop, size: float) -> None:
    """Add upright attributes, whatever the block's rotation: the number next to the disc, the id below it.

    Inside the disc the route would cross the number.
    """
    from ezdxf.enums import TextEntityAlignment as Align

    values = {
        **{"NUMBER": str(number), "ID": printable(stop.id), "X_M": f"{stop.x:.3f}", "Y_M": f"{stop.y:.3f}"},
        **{"HEADING_DEG": f"{math.degrees(stop.heading):.1f}", "DOORWAY": "yes" if stop.doorway else "no"},
        **{"PROFILE": printable(stop.scan.profile), "SCAN_S": f"{stop.scan.duration_s:g}"},
    }
    below = _at((stop.x, stop.y - DISC - TEXT), size)
    beside = _at((stop.x + _free_side(stop.heading) * (DISC + 0.5 * TEXT), stop.y + DISC + 0.4 * TEXT), size)
    places = {"ID": below, "NUMBER": beside}
    for tag, value in values.items():
        height = TEXT * size * (0.6 if tag == "ID" else 1.0)
        place = places.get(tag, insert.dxf.insert)
        attribute = insert.add_attrib(tag, value, place, dxfattribs={"layer": STOPS, "height": height})
        attribute.set_placement(place, align=Align.MIDDLE_CENTER)
        attribute.is_invisible = tag not in _SHOWN


def _free_side(heading: float) -> int:
    """Above a disc, the side (1 right, -1 left) to which its arrow does not point."""
    return -1 if math.cos(heading) > 0 and math.sin(heading) > -0.2 else 1


def _arrowhead(at: float) -> list[Point]:
    """Draw a triangle along +x with its base at x = `at`; a SOLID repeats its last corner."""
    tip = (at + 0.15, 0.0)
    return [(at, 0.09), (at, -0.09), tip, tip]


def _at(point: Sequence[float], size: float) -> Point:
    return (point[0] * size, point[1] * size)


def _free(name: str, table: object) -> str:
    """A name that the drawing's table does not hold."""
    number = 1
    while (found := name if number == 1 else f"{name}_{number}") in table:  # type: ignore[operator]
        number += 1
    return found


def _written(drawing: Drawing) -> tuple[bytes, int]:
    """The drawing as a file, and how many faults of it were mended because it could not be written before.

    Raises
    ------
    InputError
        When it cannot be written even then.
    """
    try:
        return _encoded(drawing), 0
    except BROKEN_DRAWING:
        pass
    try:
        mended = _amiss(drawing)
        return _encoded(drawing), mended
    except BROKEN_DRAWING as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"the floor's drawing cannot be written again ({why}); "
            "leave --floor out: the layers then stand alone, at the same coordinates"
        ) from None


def _encoded(drawing: Drawing) -> bytes:
    """The drawing as text in its own encoding; letters that it lacks are escaped as DXF does."""
    buffer = io.BytesIO()
    stream = io.TextIOWrapper(buffer, encoding=drawing.output_encoding, errors="dxfreplace", newline="\r\n")
    drawing.write(stream)
    stream.flush()
    return buffer.getvalue()


def _decoded(data: bytes) -> Drawing:
    import ezdxf
    from ezdxf.filemanagement import dxf_stream_info

    encoding = dxf_stream_info(io.StringIO(data.decode("utf-8", errors="ignore"))).encoding
    return ezdxf.read(io.StringIO(data.decode(encoding, errors="surrogateescape"), newline=None))


def _amiss(drawing: Drawing) -> int:
    auditor = drawing.audit()
    return len(auditor.errors) + len(auditor.fixes)
