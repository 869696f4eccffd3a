"""Use of each storey: the floor with head room, what covers it, and the reason not to plan it by default."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from stopgo.planner.floors.ifc.areas import slabs_at
from stopgo.planner.floors.ifc.levels import HEADROOM, LEAST_SLAB, NEAR, Level, surfaces_of, walked_on
from stopgo.planner.floors.ifc.model import Model, Surface
from stopgo.planner.floors.ifc.section import NOTHING, union_of, upward
from stopgo.planner.floors.rings import Region

STANDABLE = 0.1
"""A floor with doors or rooms is for people if this fraction of it has head room …"""
STANDABLE_BARE = 0.67
"""… and one without them if this fraction has."""
OVER = 0.05
"""Faces higher above a floor than this cover it, metres."""
AT_DOOR, AT_STAIR, AT_SPACE = 0.3, 0.4, 0.6
"""Distance in height between a floor and the foot of its doors, stairs and spaces, metres."""
BUILT_UP = 0.5
"""A topmost floor is under construction if its walls and columns span this fraction of it."""
LEAST_UNNAMED = 10.0
"""Floor that no storey names is listed from this area on, m²."""
MOST_UNNAMED = 8

FOUNDATION = "below the lowest storey with doors or rooms, and no stair reaches it: a foundation"
ROOF = "nothing above it, no walls on it: a roof, or a floor that is not built up yet"
OPEN = "nothing above it, but walls or columns stand on it: a storey under construction"
NO_FLOOR = "no slab, no rooms and no doors there, though the model has slabs: nothing to stand on"
UNNAMED = "no storey of the model names this floor"


def with_uses(levels: tuple[Level, ...], model: Model) -> tuple[Level, ...]:
    """Return the same floors; those not for people have a reason; an only floor never has."""
    lively = [_is_lively(level, model) for level in levels]
    if len(levels) < 2:
        return tuple(replace(level, lively=lively[0]) for level in levels)
    first = lively.index(True) if any(lively) else 0
    return tuple(
        _with_use(level, model, is_below=number < first, above=above, lively=lively[number])
        for number, (level, above) in enumerate(zip(levels, (*levels[1:], None), strict=True))
    )


def _with_use(level: Level, model: Model, *, is_below: bool, above: Level | None, lively: bool) -> Level:
    floor = slabs_at(level, walked_on(model))
    reason = _unfit(floor, level, model, above, lively=lively)
    note = ""
    if not reason and is_below and not _has_stair(level, model):
        reason = FOUNDATION
    if not reason and not lively and _is_under_the_sky(level, model):
        reason, note = ("", OPEN) if _is_built_up(floor, level, model) else (ROOF, "")
    told = (item for item in (reason, note) if item)
    return replace(level, reason=reason, lively=lively, notes=(*level.notes, *told))


def _unfit(floor: Region, level: Level, model: Model, above: Level | None, *, lively: bool) -> str:
    """Return the reason why nobody can stand on a floor; empty if people can."""
    if floor.area >= LEAST_SLAB:
        left = floor.difference(_overhead(level, model)).area
        if left >= max(LEAST_SLAB, (STANDABLE if lively else STANDABLE_BARE) * floor.area):
            return ""
        return f"head room of {HEADROOM:g} m over {left:.0f} of its {floor.area:.0f} m²: nobody walks there"
    if lively or _has_space(level, model):
        return ""
    if surfaces_of(model)[1].sum() >= LEAST_SLAB and not _has_proxy_floor(level, model):
        return NO_FLOOR
    if above is not None and above.z - level.z < HEADROOM:
        return f"only {above.z - level.z:.2f} m below '{above.name}': nobody walks there"
    return ""


def _overhead(level: Level, model: Model) -> Region:
    """Return the area with less than the head room below slabs; pitched roofs and ceilings do not count."""
    shapes = []
    for mesh in walked_on(model):
        if mesh.z[0] >= level.z + HEADROOM or mesh.z[1] <= level.z + OVER:
            continue
        triangles, heights, _ = upward(mesh)
        shapes.append(union_of(triangles[(heights > level.z + OVER) & (heights < level.z + 2 * HEADROOM)]))
    return shapely.union_all(shapes) if shapes else NOTHING


def _is_lively(level: Level, model: Model) -> bool:
    """Return True if a floor has a door, or several rooms."""
    doors = any(abs(mesh.z[0] - level.z) < AT_DOOR for _, mesh in model.of_role("doors"))
    return doors or sum(abs(mesh.z[0] - level.z) < AT_SPACE for _, mesh in model.of_role("spaces")) > 1


def _has_space(level: Level, model: Model) -> bool:
    return any(abs(mesh.z[0] - level.z) < AT_SPACE for _, mesh in model.of_role("spaces"))


def _has_stair(level: Level, model: Model) -> bool:
    return any(abs(mesh.z[0] - level.z) < AT_STAIR for _, mesh in model.of_role("stairs"))


def _has_proxy_floor(level: Level, model: Model) -> bool:
    return bool(slabs_at(level, [mesh for _, mesh in model.of_role("other")]).area >= LEAST_SLAB)


def _is_under_the_sky(level: Level, model: Model) -> bool:
    """Return True if less than half of the floor lies under a slab or a roof, in a model that has any."""
    if not model.of_role("slabs", "roofs"):
        return False
    heights, areas = surfaces_of(model)
    below = float(areas[np.abs(heights - level.z) <= OVER].sum())
    above = sum(_shade(mesh) for _, mesh in model.of_role("slabs", "roofs") if mesh.z[1] > level.z + HEADROOM)
    return above < below / 2 if below else not above


def _is_built_up(floor: Region, level: Level, model: Model) -> bool:
    """Return True if walls and columns of a person's height stand all over a floor: no parapet."""
    tall = [
        shapely.MultiPoint(mesh.vertices[:, :2])
        for _, mesh in model.of_role("walls", "columns")
        if mesh.z[0] < level.z + AT_DOOR and mesh.z[1] > level.z + HEADROOM and mesh.z[1] > level.z
    ]
    if not tall or floor.is_empty:
        return False
    return bool(shapely.union_all(tall).convex_hull.intersection(floor).area >= BUILT_UP * floor.area)


def _shade(mesh: Surface) -> float:
    """Return the area in plan of a closed body, m²: half of what all its faces cover."""
    a, b, c = (mesh.triangles[:, index, :2] for index in range(3))
    u, v = b - a, c - a
    return float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()) / 4


def unnamed_floors(levels: tuple[Level, ...], model: Model) -> tuple[Level, ...]:
    """Return the floors with head room that no storey names: mezzanines, half levels, decks; from below."""
    heights, areas = surfaces_of(model, _storey_floors(model))
    taken = [level.z for level in levels]
    found: list[Level] = []
    steps = np.round(heights / OVER).astype(np.int64)
    for step in sorted(np.unique(steps), key=lambda item: -areas[steps == item].sum()):
        own = steps == step
        z = round(float(np.average(heights[own], weights=areas[own])), 3)
        if areas[own].sum() < LEAST_UNNAMED or len(found) == MOST_UNNAMED:
            break
        if any(abs(z - other) <= NEAR for other in taken):
            continue
        level = Level(f"level {z:g}", z, z + HEADROOM)
        if not _unfit(slabs_at(level, walked_on(model)), level, model, None, lively=False):
            taken.append(z)
            lively = _is_lively(level, model)
            found.append(replace(level, lively=lively, reason=UNNAMED, notes=_unnamed(level, model)))
    return tuple(sorted(found, key=lambda level: level.z))


def _unnamed(level: Level, model: Model) -> tuple[str, ...]:
    return (UNNAMED, ROOF) if _is_under_the_sky(level, model) else (UNNAMED,)


def _storey_floors(model: Model) -> list[Surface]:
    """Return the slabs and proxies that are no roof and no landing of a stair."""
    others = ("ROOF", "LANDING")
    return [mesh for item, mesh in model.of_role("slabs", "other") if item.predefined not in others]
