"""Reader of a storey of an IFC model: its two functions, `read` and `survey`."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import replace

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import bounds
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.ifc.class_kinds import IGNORED, with_given_kinds
from stopgo.planner.floors.ifc.laser_solids import laser_solids
from stopgo.planner.floors.ifc.levels import NEAR, Level, chosen_level, levels_of, standing_at, walked
from stopgo.planner.floors.ifc.loading import load
from stopgo.planner.floors.ifc.model import Model
from stopgo.planner.floors.ifc.standing import standing_on
from stopgo.planner.floors.ifc.storey_plan import as_on_day, floor_on, heights_of, odd_products
from stopgo.planner.floors.ifc.storey_use import unnamed_floors, with_uses
from stopgo.planner.floors.parts import in_order
from stopgo.planner.floors.reader import FloorFile, FloorOptions
from stopgo.planner.floors.standing_body import StandingBody
from stopgo.planner.floors.survey import FloorChoice, LayerUse, Survey

WORKED_OUT = (
    *("floor_from_rooms", "floor_from_proxies", "floor_from_walls", "rooms_derived"),
    *("spaces_overlap", "beside_floor"),
)
"""Codes of findings on elements that the model does not state and the reader inferred."""


def read(file: FloorFile, options: FloorOptions) -> FloorPlan:
    """Read the storey that the options choose in a model.

    Raises
    ------
    InputError
        When the file is not a model, or the storey is not given, not there or without a floor.
    """
    model = with_given_kinds(load(file), options, file.path)
    levels = with_uses(levels_of(model), model)
    level = chosen_level(levels, model=model, storey=options.storey, z=options.level, path=file.path)
    there, _, _ = as_on_day(model, level, options)
    return replace(floor_on(level, model, file, options), solids=laser_solids(level, there))


def standing(file: FloorFile, options: FloorOptions) -> tuple[StandingBody, ...]:
    """Return the bodies of the model that reach into the robot's height on the storey that `read` reads."""
    model = with_given_kinds(load(file), options, file.path)
    levels = with_uses(levels_of(model), model)
    level = chosen_level(levels, model=model, storey=options.storey, z=options.level, path=file.path)
    there, _, _ = as_on_day(model, level, options)
    return tuple(standing_on(level, there, heights_of(options)))


def survey(file: FloorFile, options: FloorOptions) -> Survey:
    """Return the survey of a model: its storeys, and the meaning of its classes of elements.

    Raises
    ------
    InputError
        As `read` does, except for a storey that is not given.
    """
    model = with_given_kinds(load(file), options, file.path)
    levels = with_uses(levels_of(model), model)
    is_chosen = options.storey is not None or options.level is not None or len(walked(levels)) == 1
    own = (
        chosen_level(levels, model=model, storey=options.storey, z=options.level, path=file.path)
        if is_chosen
        else None
    )
    unnamed = [level for level in unnamed_floors(levels, model) if own is None or abs(level.z - own.z) > NEAR]
    shown = (*levels, *unnamed, *([own] if own is not None and own not in levels else []))
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
        inferred=() if levels else (f"no storeys; elements are at {standing_at(model)}: --level Z",),
        findings=in_order(odd_products(model)),
    )


def _choice(
    level: Level, model: Model, file: FloorFile, options: FloorOptions, *, chosen: bool
) -> FloorChoice:
    option = f"--storey {shlex.quote(level.name)}" if level.storey else f"--level {level.z:g}"
    reason = level.reason
    head = FloorChoice(
        *(level.name, option, level.z),
        notes=level.notes,
        aside=bool(reason),
        reason=reason,
        has_rooms=level.lively,
        chosen=chosen,
    )
    try:
        floor = floor_on(level, model, file, options)
    except InputError as error:
        why = reason or str(error).partition(": ")[2].partition(";")[0]
        return replace(head, notes=tuple(dict.fromkeys((*level.notes, why))), aside=True, reason=why)
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
    """Meaning of each class of products."""
    products = model.described.products
    found = Counter(
        (item.ifc_class, item.role) for item in products if item.faces[1] and item.role != IGNORED
    )
    bare = Counter(
        (item.ifc_class, item.role)
        for item in products
        if item.role == IGNORED or not (item.faces[1] or item.parts)
    )
    return tuple(
        LayerUse(name, role, "its class", taken=found[name, role], ignored=bare[name, role])
        for name, role in sorted({*found, *bare})
    )
