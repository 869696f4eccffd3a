"""Reads a storey of an IFC model: the reader's two functions, `read` and `survey`."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import replace

import numpy as np
import shapely

from mission.errors import InputError
from mission.floor import Finding, FloorPlan
from mission.geometry import bounds, frozen
from mission.kinds import KINDS
from planner.floors.ifc.areas import Space, derived_rooms, floor_area, modelled_rooms
from planner.floors.ifc.doors import doors_on
from planner.floors.ifc.levels import Level, chosen_level, levels_of, walked, with_uses
from planner.floors.ifc.loading import load
from planner.floors.ifc.model import Model
from planner.floors.ifc.passages import passages
from planner.floors.ifc.solids import Heights, Solid, solids_on
from planner.floors.parts import in_order, parts_of
from planner.floors.reader import FloorFile, FloorOptions
from planner.floors.rings import Region
from planner.floors.strokes import Stroke, Word
from planner.floors.survey import FloorChoice, LayerUse, Survey

WORKED_OUT = ("floor_from_rooms", "floor_from_walls", "rooms_derived", "spaces_overlap", "off_floor")
"""Findings about what the model does not say and was worked out."""
BESIDE = 1.0
"""What stands farther than this from the floor is not part of its plan, metres."""


def read(file: FloorFile, options: FloorOptions) -> FloorPlan:
    """The storey that the options choose in a model.

    Raises
    ------
    InputError
        When the file is no model, or the storey is not told or not there, or has no floor.
    """
    model = load(file)
    levels = with_uses(levels_of(model), model)
    level = chosen_level(levels, model=model, storey=options.storey, z=options.level, path=file.path)
    return floor_on(level, model, file, options)


def survey(file: FloorFile, options: FloorOptions) -> Survey:
    """What a model holds: its storeys, and what its classes of elements were taken for.

    Raises
    ------
    InputError
        As `read` does, but for a storey that is not told.
    """
    model = load(file)
    levels = with_uses(levels_of(model), model)
    told = options.storey is not None or options.level is not None or len(walked(levels)) == 1
    own = (
        chosen_level(levels, model=model, storey=options.storey, z=options.level, path=file.path)
        if told
        else None
    )
    shown = levels if own is None or own in levels else (*levels, own)
    choices = [_choice(level, model, file, options, chosen=level == own) for level in shown]
    described = model.described
    return Survey(
        file=file.path.name,
        kind=f"{described.schema} model" + (f" of {described.application}" if described.application else ""),
        digest=file.digest,
        units=f"{described.unit_m:g} m, as the model says",
        floors=tuple(choices),
        layers=_classes(model),
        ignored=tuple(f"{count} {name}" for name, count in described.left_out.items()),
        findings=in_order(odd_products(model)),
    )


def _choice(
    level: Level, model: Model, file: FloorFile, options: FloorOptions, *, chosen: bool
) -> FloorChoice:
    option = f"--storey {shlex.quote(level.name)}" if level.storey else f"--level {level.z:g}"
    head = FloorChoice(level.name, option, level.z, notes=level.notes, aside=level.aside, chosen=chosen)
    try:
        floor = floor_on(level, model, file, options)
    except InputError as error:
        said = str(error).partition(": ")[2]
        return replace(head, notes=(*level.notes, said), aside=True)
    kinds = Counter((*(item.kind for item in floor.elements), *(f"{item.kind}s" for item in floor.openings)))
    counts = {"rooms": len(floor.rooms), **{kind: kinds[kind] for kind in (*KINDS, "doors", "passages")}}
    worked_out = [item.message for item in floor.findings if item.code in WORKED_OUT]
    return replace(
        head,
        area_m2=floor.area,
        bounds=bounds([part.exterior for part in floor.outline]),
        elements={kind: count for kind, count in counts.items() if count},
        notes=(*level.notes, *worked_out),
    )


def _classes(model: Model) -> tuple[LayerUse, ...]:
    """What each class of products was taken for."""
    found = Counter((item.ifc_class, item.role) for item in model.described.products if item.faces[1])
    bare = Counter(
        (item.ifc_class, item.role) for item in model.described.products if not (item.faces[1] or item.parts)
    )
    return tuple(
        LayerUse(name, role, "its class", taken=found[name, role], ignored=bare[name, role])
        for name, role in sorted({*found, *bare})
    )


def odd_products(model: Model) -> list[Finding]:
    """Products that could not be shaped, each by name."""
    return [
        *(Finding("no_geometry", f"{name} has no shape that can be made") for name in model.described.failed),
        *(
            Finding("kernel_crashed", f"{name} crashed the geometry kernel")
            for name in model.described.crashed
        ),
    ]


def floor_on(level: Level, model: Model, file: FloorFile, options: FloorOptions) -> FloorPlan:
    """The floor plan of one level."""
    strokes, words, findings = drawn_on(level, model, file, options)
    parts = parts_of(strokes, words, source=file.path, layers=())
    findings += [item for item in parts.findings if item.code != "unknown_layer"]
    return FloorPlan(
        name=f"{file.path.stem} {level.name}".strip(),
        source=file.source(storey=level.name, options=_told(options)),
        outline=parts.outline,
        rooms=parts.rooms,
        openings=parts.openings,
        elements=parts.elements,
        level=level.name,
        ignored=parts.ignored,
        findings=in_order(
            (
                *odd_products(model),
                *findings,
                *(item for item in parts.findings if item.code != "unknown_layer"),
            )
        ),
    )


def _told(options: FloorOptions) -> dict[str, float]:
    names = ("scan_height", "robot_height")
    return {name: getattr(options, name) for name in names if getattr(options, name) is not None}


def drawn_on(
    level: Level, model: Model, file: FloorFile, options: FloorOptions
) -> tuple[list[Stroke], list[Word], list[Finding]]:
    """A level as the strokes and words of a layered drawing, and what is odd about it."""
    heights = Heights(options.scan_height or Heights.scan, options.robot_height)
    solids = solids_on(level, model, heights)
    walls = {item.product.global_id: item.region for item in solids if item.kind == "walls"}
    doors = doors_on(level, model, walls)
    rooms, findings = modelled_rooms(level, model, heights.scan)
    floor, odd_floor = floor_area(level, model, rooms, solids, doors)
    findings += odd_floor
    if floor.is_empty:
        raise InputError(
            f"{file.path}: no floor at '{level.name}' ({level.z:+.2f} m): no slab, no rooms, no walls that "
            "enclose any; choose another storey or --level"
        )
    if not rooms:
        rooms = derived_rooms(floor, solids, doors)
        findings.append(
            Finding("rooms_derived", f"the model has no spaces there; {len(rooms)} rooms are worked out")
        )
    solids, odd_solids = _near_the_floor(solids, floor)
    findings += [*odd_solids, *_unknown(solids)]
    strokes = [
        *_rings("FLOOR", floor),
        *(ring for room in rooms for ring in _rings("ROOMS", room.region, room.global_id)),
        *(ring for item in solids for ring in _rings(item.kind.upper(), item.region, item.product.global_id)),
        *(Stroke(frozen(door.line), "DOORS", "doors", global_id=door.product.global_id) for door in doors),
        *(Stroke(frozen(line), "PASSAGES", "passages") for line in passages(floor, rooms, solids, doors)),
    ]
    return strokes, _names(rooms), findings


def _unknown(solids: list[Solid]) -> list[Finding]:
    """Products without a class of their own: nobody knows what the laser makes of them."""
    count = sum(item.kind == "other" for item in solids)
    text = f"{count} IfcBuildingElementProxy stand in the robot's way, hide nothing and are not scanned"
    return [Finding("proxies", text)] if count else []


def _near_the_floor(solids: list[Solid], floor: Region) -> tuple[list[Solid], list[Finding]]:
    """Without what stands beside the floor, such as on the roof of a lower wing."""
    near = [item for item in solids if item.region.distance(floor) <= BESIDE]
    if len(near) == len(solids):
        return near, []
    text = f"{len(solids) - len(near)} elements more than {BESIDE:g} m beside the floor are left out"
    return near, [Finding("off_floor", text)]


def _rings(layer: str, region: Region, global_id: str | None = None) -> list[Stroke]:
    """The rings of a region: outer ones counter-clockwise, holes clockwise."""
    found = []
    for part in shapely.get_parts(shapely.orient_polygons(region)):
        for ring in (part.exterior, *part.interiors):
            points = np.round(shapely.get_coordinates(ring)[:-1] / 1e-4) * 1e-4
            found.append(Stroke(frozen(points), layer, layer.lower(), closed=True, global_id=global_id))
    return found


def _names(rooms: list[Space]) -> list[Word]:
    words = []
    for room in rooms:
        if room.name:
            x, y = shapely.get_coordinates(room.region.point_on_surface())[0].tolist()
            words.append(Word(room.name, "ROOMS", "rooms", ((x, y),)))
    return words
