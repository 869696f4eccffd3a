"""One storey of a model as a floor plan: drawn as a layered drawing is, for good or as of a day."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import shapely

from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError
from stopgo.mission.floor import Element, Finding, FloorPlan
from stopgo.mission.geometry import frozen
from stopgo.planner.floors.ifc.areas import Space, derived_rooms, floor_area, modelled_rooms
from stopgo.planner.floors.ifc.ceilings import without_hidden_beams
from stopgo.planner.floors.ifc.class_kinds import furniture_findings
from stopgo.planner.floors.ifc.doors import doors_on
from stopgo.planner.floors.ifc.georeference import georeference_of
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model
from stopgo.planner.floors.ifc.passages import passages
from stopgo.planner.floors.ifc.solids import Heights, Solid, solids_on
from stopgo.planner.floors.ifc.status import Statuses, on_day, statuses
from stopgo.planner.floors.ifc.timetable import read_timetable
from stopgo.planner.floors.legible_text import legible
from stopgo.planner.floors.lines_and_texts import Stroke, Word
from stopgo.planner.floors.parts import in_order, parts_of
from stopgo.planner.floors.reader import FloorFile, FloorOptions
from stopgo.planner.floors.rings import Region

MOST_NAMED = 20
"""Products that one finding names."""
BESIDE = 1.0
"""A solid farther than this from the floor is not part of its plan, metres."""


def floor_on(level: Level, model: Model, file: FloorFile, options: FloorOptions) -> FloorPlan:
    """The floor plan of one level, as it stands on the day that the options name.

    Raises
    ------
    InputError
        When there is no floor, or none on that day.
    """
    found, digest = _statuses(model, options)
    there, odd, status = on_day(model, found, level) if found else (model, [], {})
    strokes, words, worked_out = drawn_on(level, there, file, options)
    parts = parts_of(strokes, words, source=file.path, layers=())
    known = (item for item in parts.findings if item.code != "unknown_layer")
    georeference, odd_place = georeference_of(model.described.place, level=level.z)
    given = {**_given_options(options), **({"schedule": digest} if digest else {})}
    return FloorPlan(
        name=" ".join(filter(None, (file.path.stem, level.name, options.date))),
        source=file.source(storey=level.name, date=options.date, since=options.since, options=given),
        outline=parts.outline,
        rooms=parts.rooms,
        openings=parts.openings,
        elements=tuple(_as_of(_with_heights(item, there, level), found, options) for item in parts.elements),
        level=level.name,
        georeference=georeference,
        status=status,
        ceiling_m=level.ceiling - level.z,
        ignored=parts.ignored,
        findings=in_order((*odd_products(model), *odd, *odd_place, *worked_out, *known)),
    )


def _statuses(model: Model, options: FloorOptions) -> tuple[Statuses | None, str]:
    """Construction status on the day of the options, and the digest of the schedule used."""
    if options.date is None:
        return None, ""
    schedule = None
    if options.schedule is not None:
        schedule = read_timetable(options.schedule, options.schedule_columns)
    tasks = schedule.tasks if schedule else {}
    found = statuses(model, day=options.date, since=options.since, schedule=tasks)
    return found, schedule.digest if schedule else ""


def _with_heights(item: Element, model: Model, level: Level) -> Element:
    """The element with the heights of its body above the floor."""
    mesh = model.meshes.get(item.global_id or "")
    if mesh is None:
        return item
    low, high = (round(z - level.z, 4) + 0.0 for z in mesh.z)  # no minus zero
    return replace(item, heights=(low, high))


def _as_of(item: Element, found: Statuses | None, options: FloorOptions) -> Element:
    """An element as on the day: a target unless scanned before or, by default, under construction.

    An element under construction is an obstacle and may occlude. Without a day it stays as it is.
    """
    if found is None:
        return item
    guid = item.global_id or ""
    begun = found.on.get(guid) == "in_progress" and options.in_progress != "target"
    if not begun and guid not in found.standing and not (found.since and guid in found.without_task):
        return item
    return replace(item, target=False, to_scan=False)


def odd_products(model: Model) -> list[Finding]:
    """Products that could not be shaped, each by name."""
    described = model.described
    spaces = [name for name in described.bodiless if name.startswith("IfcSpace ")]
    solids = [name for name in described.bodiless if name not in spaces]
    return [
        *(Finding("damaged_model", f"the file is damaged: {legible(text)}") for text in described.damage),
        *(Finding("no_geometry", f"{name} has no shape that can be made") for name in described.failed),
        *_named("no_body", solids, "have no body in the model and are left out"),
        *_named("space_without_body", spaces, "have no body in the model: their floor has no name"),
        *_named("box_shape", described.boxed, "have no shape that can be made and are shown as boxes"),
        *_named("uncut_shape", described.uncut, "are shown without the openings cut out of them"),
        *(Finding("kernel_crashed", f"{name} crashed the geometry kernel") for name in described.crashed),
    ]


_OF_ONE = {"have": "has", "are": "is"}


def _named(code: str, products: Sequence[str], problem: str) -> list[Finding]:
    """One finding on several products, each by its class, GlobalId and name."""
    if not products:
        return []
    named = legible(", ".join(products[:MOST_NAMED]))
    more = f" and {len(products) - MOST_NAMED} more" if len(products) > MOST_NAMED else ""
    told = problem if len(products) > 1 else re.sub("have|are", lambda verb: _OF_ONE[verb[0]], problem)
    return [Finding(code, f"{counted(len(products), 'element')} {told}: {named}{more}")]


def _given_options(options: FloorOptions) -> dict[str, Any]:
    names = ("scan_height", "robot_height", "in_progress", "furniture")
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return {**given, **({"layer_map": dict(sorted(options.layer_map.items()))} if options.layer_map else {})}


def heights_of(options: FloorOptions) -> Heights:
    """Heights of the scanner and of the robot above the floor."""
    return Heights(options.scan_height or Heights.scan, options.robot_height)


def as_on_day(
    model: Model, level: Level, options: FloorOptions
) -> tuple[Model, list[Finding], dict[str, int]]:
    """The model as it stands on the day of the options, findings on that, and counts by status."""
    found, _ = _statuses(model, options)
    return on_day(model, found, level) if found else (model, [], {})


def drawn_on(
    level: Level, model: Model, file: FloorFile, options: FloorOptions
) -> tuple[list[Stroke], list[Word], list[Finding]]:
    """A level as the strokes and words of a layered drawing, and what is odd about it."""
    heights = heights_of(options)
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
            Finding("rooms_derived", f"the model has no spaces there; {len(rooms)} rooms are inferred")
        )
    solids, odd_solids = _near_the_floor(solids, floor)
    solids, hidden = without_hidden_beams(solids, model, level, heights)
    findings += [*odd_solids, *_unknown(solids), *hidden]
    findings += furniture_findings(model, {item.product.global_id for item in solids})
    strokes = [
        *_rings("FLOOR", floor),
        *(ring for room in rooms for ring in _rings("ROOMS", room.region, room.global_id)),
        *(ring for item in solids for ring in _rings(item.kind.upper(), item.region, item.product.global_id)),
        *(Stroke(frozen(door.line), "DOORS", "doors", global_id=door.product.global_id) for door in doors),
        *(Stroke(frozen(line), "PASSAGES", "passages") for line in passages(floor, rooms, solids, doors)),
    ]
    return strokes, _names(rooms), findings


def _unknown(solids: list[Solid]) -> list[Finding]:
    """Products without a class of their own: their effect on the laser is unknown."""
    products = {item.product.global_id: item.product for item in solids}
    counts = Counter(item.ifc_class for item in products.values() if item.role == "other")
    named = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    text = f"{named} are obstacles, hide what is behind them and are not scanned"
    return [Finding("proxies", text)] if counts else []


def _near_the_floor(solids: list[Solid], floor: Region) -> tuple[list[Solid], list[Finding]]:
    """Return the solids without those outside the floor, such as on the roof of a lower wing."""
    near = [item for item in solids if item.region.distance(floor) <= BESIDE]
    if len(near) == len(solids):
        return near, []
    text = f"{counted(len(solids) - len(near), 'element')} more than {BESIDE:g} m outside the floor: left out"
    return near, [Finding("beside_floor", text)]


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
