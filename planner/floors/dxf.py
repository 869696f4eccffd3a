"""Reader of DXF files: one floor, on layers named FLOOR, ROOMS, WALLS and so on, or as an architect drew it.

The bytes become a drawing, the drawing shapes on layers, these strokes in metres, the strokes a floor plan.
What no layer shows is derived from the line work.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import shapely
from ezdxf.document import Drawing

from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.geometry import bounds
from stopgo.mission.settings.layer_kinds import layer_option
from stopgo.planner.floors.drawing import open_drawing
from stopgo.planner.floors.drawn_shapes import ignored_in
from stopgo.planner.floors.dxf_sheet import DxfSheet, drawings_text, sheet_of
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.linework import Derived, as_room_name, completed, derived
from stopgo.planner.floors.linework.patterns import pattern_in
from stopgo.planner.floors.parts import in_order, parts_of
from stopgo.planner.floors.raised_floor import with_heights
from stopgo.planner.floors.reader import FloorFile, FloorOptions
from stopgo.planner.floors.survey import FloorChoice, LayerUse, Survey, SurveyLine, choice_of
from stopgo.planner.floors.units.unit_lengths import METRES
from stopgo.planner.floors.wall_layers import (
    MOST_STRAY,
    NOT_ENCLOSING,
    UNTOLD,
    WIDEST_GAP,
    Deriving,
    WallLayers,
    has_wall_layers,
    labelled,
    wall_layers,
)
from stopgo.planner.geometry.instance_cache import instance_cached


def read(file: FloorFile, options: FloorOptions) -> FloorPlan:
    """Read the floor in a DXF.

    Raises
    ------
    InputError
        When the bytes are no complete DXF, when they show no floor, or several and none is chosen.
    """
    drawing, odd_file = open_drawing(file.data, source=file.path)
    return _read_sheet(file, options, *_sheet(drawing, options, file.path), odd_file)


def _read_sheet(
    file: FloorFile,
    options: FloorOptions,
    sheet: DxfSheet,
    tried: WallLayers | None,
    odd_file: Sequence[Finding],
) -> FloorPlan:
    """The floor of a drawing as interpreted, with the findings on its file."""
    floor = _floor_of(sheet, file.path, _source(file, options), tried)
    floor = with_heights(floor, options)
    return replace(floor, findings=in_order((*odd_file, *floor.findings)))


def _sheet(drawing: Drawing, options: FloorOptions, path: Path) -> tuple[DxfSheet, WallLayers | None]:
    """The drawing as interpreted; and the layers tried as its walls, where no name shows any."""

    def derive(sheet: DxfSheet) -> Derived:
        return _derived(sheet, path)

    if has_wall_layers(drawing, options, source=path):
        return _named_sheet(drawing, options, path, derive)
    found = wall_layers(drawing, options, derive, source=path)
    if found is None or not found.is_told:
        other = wall_layers(drawing, options, derive, source=path, roles=NOT_ENCLOSING, more_than=UNTOLD)
        found = other if other is not None and (other.is_told or found is None or not found.area) else found
    if found is None or not found.is_told:
        return _sheet_without_unit(drawing, options, path), found or WallLayers()
    return _tried_sheet(found), found


def _named_sheet(
    drawing: Drawing, options: FloorOptions, path: Path, derive: Deriving
) -> tuple[DxfSheet, WallLayers | None]:
    """The drawing by the names of its layers; if the walls named so enclose no floor, with other layers."""
    sheet = sheet_of(drawing, options, source=path)
    if "walls" in options.layers.values():
        return labelled(sheet), None
    if not sheet.layered and not sheet.outlined:
        try:
            derive(sheet)
        except NothingEnclosed:
            found = wall_layers(drawing, options, derive, source=path, roles=NOT_ENCLOSING)
            if found is not None and found.is_told:
                return _tried_sheet(found), found
            return sheet, found if found is not None and found.area else None
        except InputError:
            pass  # the floor is derived again, and the message given there
    return sheet, None


def _tried_sheet(found: WallLayers) -> DxfSheet:
    """The sheet of the trial that found the walls."""
    assert found.sheet is not None, "layers that show walls were tried"
    return found.sheet


def _sheet_without_unit(drawing: Drawing, options: FloorOptions, path: Path) -> DxfSheet:
    """The sheet of a drawing without walls; its unit does not matter, and is not asked for."""
    for units in (options.units, *ANY_UNIT):
        try:
            return sheet_of(drawing, replace(options, units=units), source=path)
        except InputError:
            continue
    return sheet_of(drawing, options, source=path)


ANY_UNIT = ("m", "cm", "mm")
"""Units in which a drawing is shown that is no floor."""


def _source(file: FloorFile, options: FloorOptions) -> FloorSource:
    more: dict[str, Any] = {}
    if options.layer_map:
        more["layer_map"] = dict(sorted(options.layer_map.items()))
    if options.heights:
        more["heights"] = {kind: list(span) for kind, span in sorted(options.heights.items())}
        names = ("scan_height", "robot_height")
        more |= {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return file.source(drawing=options.drawing, region=options.region, units=options.units, options=more)


def floor_in(drawing: Drawing, *, source: Path, digest: str, d_dis: float) -> FloorPlan:
    """Return the floor drawn in the model space of a drawing, from any file."""
    sheet = sheet_of(drawing, FloorOptions(d_dis=d_dis), source=source)
    return _floor_of(sheet, source, FloorSource(source.name, digest))


def _floor_of(sheet: DxfSheet, path: Path, source: FloorSource, tried: WallLayers | None = None) -> FloorPlan:
    if tried is not None and not tried.is_told:
        raise InputError(f"{path}: {_no_walls(sheet, tried)}")
    made = _derived(sheet, path)
    parts = parts_of(
        made.strokes,
        made.words,
        source=path,
        layers=[shape.layer for shape in sheet.shapes],
        known=_known(sheet),
        skipped=_skipped(sheet.findings),
    )
    return FloorPlan(
        name=path.stem,
        source=source,
        outline=parts.outline,
        rooms=parts.rooms,
        openings=parts.openings,
        elements=parts.elements,
        ignored=parts.ignored,
        findings=in_order((*_tried_findings(tried), *sheet.findings, *made.findings, *parts.findings)),
    )


def _tried_findings(tried: WallLayers | None) -> list[Finding]:
    return [] if tried is None else [tried.finding]


def _derived(sheet: DxfSheet, path: Path) -> Derived:
    """Return the strokes and words of a layered drawing; for other drawings they are derived."""
    if pattern := pattern_in(sheet.strokes):
        raise InputError(f"{path}: {pattern}")
    return Derived(sheet.strokes, sheet.words, []) if sheet.layered else _from_lines(sheet, path)


def _from_lines(sheet: DxfSheet, path: Path) -> Derived:
    """Return what is derived from the lines of a drawing without layers of its own for all kinds."""
    roles = {stroke.role for stroke in sheet.strokes}
    if not sheet.outlined and "walls" not in roles:
        raise InputError(f"{path}: {_no_walls(sheet)}")
    size = _size(sheet)
    if sheet.outlined:
        named = [as_room_name(word) for word in sheet.words]
        large = size > LARGEST_FLOOR
        return Derived(sheet.strokes, named, []) if large else completed(sheet.strokes, sheet.words)
    if len(sheet.drawings) > 1 and sheet.chosen is None:
        count = len(sheet.drawings)
        listed = drawings_text(sheet.drawings)
        raise InputError(f"{path}: {count} drawings side by side, choose one with --drawing N{listed}")
    if size > LARGEST_FLOOR:
        raise InputError(
            f"{path}: the walls are {size:.4g} m across, read in {_unit_name(sheet)}; "
            "say the drawing's unit with --units, or the part that is meant with --region"
        )
    try:
        made = _line_work(sheet)
    except shapely.errors.GEOSException as error:
        raise InputError(
            f"{path}: the lines of the walls cannot be intersected ({legible(str(error))}); delete "
            "overlapping lines, or put the walls on a layer of their own"
        ) from None
    if made.cells:
        raise InputError(
            f"{path}: what was taken for walls encloses {made.cells} cells smaller than a room: that is a "
            "pattern, no walls; put the walls on a layer of their own, or ask for such an export"
        )
    if _encloses_nothing(made):
        raise NothingEnclosed(
            f"{path}: {_enclose_nothing(sheet)}; draw its outline on a layer FLOOR, "
            "close the walls, or say which layer holds more of them (--layer NAME=walls)"
        )
    return made


def _encloses_nothing(made: Derived) -> bool:
    """True if walls enclose no floor, or only a corner between a few of them, or no room and no opening."""
    roles = {stroke.role for stroke in made.strokes}
    if "floor" not in roles:
        return True
    shown = made.shown
    is_corner = sum(room.area for room in shown.rooms) < _CORNER_M2
    is_bare = not (shown.doors or shown.passages or "rooms" in roles)
    return (is_corner and shown.stray > MOST_STRAY) or (
        (is_corner or is_bare) and shown.closed_over > WIDEST_GAP
    )


def _enclose_nothing(sheet: DxfSheet) -> str:
    walls = _listed(sorted({stroke.layer for stroke in sheet.strokes if stroke.role == "walls"}))
    return f"the walls on {walls} enclose no floor"


_CORNER_M2 = 5.0
"""Least area in m² of a floor whose walls are open, or lie mostly elsewhere."""


@instance_cached
def _line_work(sheet: DxfSheet) -> Derived:
    """Walls, doors, rooms and floor derived from a sheet's line work, once for trial and floor."""
    return derived(sheet.strokes, sheet.words)


class NothingEnclosed(InputError):
    """The walls of a drawing enclose no floor."""


def _size(sheet: DxfSheet) -> float:
    """The longer side in metres of what the walls' layers show."""
    points = [item.points for item in sheet.strokes if item.role == "walls"]
    x0, y0, x1, y1 = bounds(points)
    return max(x1 - x0, y1 - y0)


LARGEST_FLOOR = 2000.0
"""Greatest length of a storey, in metres."""


def _no_walls(sheet: DxfSheet, tried: WallLayers | None = None) -> str:
    """Message for a drawing without any known layer, with the remedy."""
    layers = sorted({shape.layer for shape in sheet.shapes}, key=str.casefold)
    has_walls = any(stroke.role == "walls" for stroke in sheet.strokes)
    missing = (
        _enclose_nothing(sheet)
        if has_walls
        else "no closed outline on layer FLOOR, and no layer that shows walls"
    )
    why = f"{missing}; layers present: {_listed(layers)}"
    if tried is None or not tried.layers:
        return f"{why}; say which one holds the walls, such as {layer_option('NAME', 'walls')}"
    if tried.units:
        choices = " or ".join(f"{tried.option} {unit} {makes}" for unit, makes in tried.units)
        return f"{why}, and the unit is not certain; give {choices}"
    if tried.refusal:
        return f"{why}; say which one holds the walls (with {tried.option}: {tried.refusal})"
    seen = f" ({'; '.join(tried.evidence)})" if tried.evidence else ""
    return (
        f"{why}; the lines on {_listed(tried.layers)} enclose {tried.area:.4g} m²{seen}, which is not "
        f"enough to show that they are walls; {tried.option} accepts them"
    )


def _listed(names: Sequence[str], *, most: int = 20) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(names[:most]) or "none") + more


def _known(sheet: DxfSheet) -> frozenset[str]:
    """Layers with a known meaning that is not a kind of element."""
    return frozenset(
        shape.layer for shape in sheet.shapes if shape.role in ("furniture", "names", "openings")
    )


def metres_in(drawing: Drawing, *, source: Path, options: FloorOptions | None = None) -> float:
    """Length of one drawing unit in metres, as `read` uses it; drawings over a floor need it."""
    return sheet_of(drawing, options or FloorOptions(), source=source).scale


def survey(file: FloorFile, options: FloorOptions) -> Survey:
    """Return the survey of a DXF: drawings, meanings of layers, elements inferred and left out."""
    drawing, odd_file = open_drawing(file.data, source=file.path)
    sheet, tried = _sheet(drawing, options, file.path)
    try:
        floor, refusal = _read_sheet(file, options, sheet, tried, odd_file), None
    except InputError as error:
        floor, refusal = None, str(error)
    return Survey(
        file=file.path.name,
        kind=f"DXF drawing, {drawing.dxfversion}",
        digest=file.digest,
        units=_unit(sheet),
        floors=tuple(_choices(sheet, floor)),
        layers=tuple(_layers(drawing, sheet, file.path)),
        inferred=_messages(floor, "inferred_"),
        ignored=_messages(floor, "not_a_wall"),
        findings=tuple(
            item for item in (floor or sheet).findings if not item.code.startswith(_REPORTED_ELSEWHERE)
        ),
        lines=tuple(SurveyLine(item.points, item.role not in _LEFT, item.closed) for item in sheet.strokes),
        floor=floor,
        refusal=refusal,
    )


def _unit(sheet: DxfSheet) -> str:
    """The unit's name and the source of it."""
    name = _unit_name(sheet)
    why = next((item.message for item in sheet.findings if item.code.startswith("units_")), "")
    return f"{name} ({why})" if why else f"{name}, as the header says"


def _unit_name(sheet: DxfSheet) -> str:
    return next((word for word, factor in METRES.values() if factor == sheet.scale), f"{sheet.scale:g} m")


_LEFT = ("other", "ignore")
_REPORTED_ELSEWHERE = ("inferred_", "layer_", "units_", "drawings_found", "not_a_wall")
"""Codes of findings that a survey reports in separate lines."""


def _messages(floor: FloorPlan | None, code: str) -> tuple[str, ...]:
    findings = floor.findings if floor else ()
    return tuple(item.message for item in findings if item.code.startswith(code))


def _choices(sheet: DxfSheet, floor: FloorPlan | None) -> Iterable[FloorChoice]:
    """The drawings side by side, or the only floor."""
    if floor is not None and len(sheet.drawings) < 2:
        yield choice_of(floor)
        return
    for number, item in enumerate(sheet.drawings, start=1):
        option = f"--drawing {number}" if len(sheet.drawings) > 1 else ""
        name, notes = f"drawing {number}", (item.description,)
        if floor is not None and item is sheet.chosen:
            yield replace(choice_of(floor), name=name, option=option, notes=notes)
        else:
            yield FloorChoice(name, option, bounds=item.box, notes=notes)


def _layers(drawing: Drawing, sheet: DxfSheet, source: Path) -> Iterable[LayerUse]:
    """Meaning of each layer that is not empty, with its counts of entities."""
    counts = Counter((shape.layer, shape.role, shape.why) for shape in sheet.shapes)
    for (layer, role, why), count in sorted(counts.items()):
        known = role != "other"
        yield LayerUse(layer, role, why, taken=count if known else 0, ignored=0 if known else count)
    for layer, reading, count in ignored_in(drawing, source=source, layers=sheet.layers):
        yield LayerUse(layer, reading.role, reading.why, ignored=count)


def _skipped(findings: Sequence[Finding]) -> str:
    """The first damaged shape on FLOOR, for the error about the missing outline."""
    damaged = [finding.message for finding in findings if "on FLOOR is skipped" in finding.message]
    return f" ({damaged[0]})" if damaged else ""
