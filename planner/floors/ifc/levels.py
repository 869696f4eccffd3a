"""Levels of a model: the height of each storey's slab, and the storeys that are one floor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.ifc.model import Model, Storey, Surface
from stopgo.planner.floors.ifc.section import upward
from stopgo.planner.floors.legible_text import legible

NEAR = 0.6
"""A storey's slab lies at most so far above or below the level that the model gives it, in metres."""
SAME = 0.02
"""Storeys whose floors lie closer than this are one floor."""
LEAST_SLAB = 1.0
"""Square metres of slab that make a level."""
HEADROOM = 1.9
"""Height that a person needs; a floor less than this above another is no storey over it, metres."""
LIKE_LEVEL = 0.3
"""A level means the storey whose floor is as near as this, metres."""
OPEN_ABOVE = 3.0
"""Height that is taken above the topmost floor."""

_AS_LARGE = 0.9
"""Surfaces with this fraction of the greatest area may be layers of one slab: the uppermost is the floor."""
_OF_ROOMS = ("walls", "doors", "windows", "spaces", "stairs", "slabs")
"""Roles of what makes the rooms of a storey."""


@dataclass(frozen=True)
class Level:
    """A floor of a model: where the robot drives."""

    name: str
    z: float
    """Of the floor's surface, metres."""
    ceiling: float
    """Of the next floor above."""
    storey: str | None = None
    """GlobalId; None where the user names a level and not a storey."""
    contained: tuple[int, int] = (0, 0)
    """Products that the model places in it: what makes rooms, and all."""
    also: tuple[str, ...] = ()
    """Names of the storeys merged into it: they choose it as well."""
    merged: tuple[str, ...] = ()
    """GlobalIds of those storeys."""
    notes: tuple[str, ...] = ()
    reason: str = ""
    """Reason not to plan it by default, such as a roof; empty if people walk there."""
    lively: bool = False
    """True if it has doors or several rooms."""


def levels_of(model: Model) -> tuple[Level, ...]:
    """Every storey with its floor's level, from below; storeys of one floor are merged."""
    surfaces = surfaces_of(model)
    found = [_level(storey, surfaces, model) for storey in model.described.storeys]
    found.sort(key=lambda level: (level.z, _fullest_first(level), level.name, level.storey or ""))
    return tuple(_with_names(_with_ceilings(_merged(found))))


def surfaces_of(model: Model, bodies: Iterable[Surface] | None = None) -> tuple[FloatArray, FloatArray]:
    """Heights and areas of all that looks up on slabs and floor coverings, or on other bodies."""
    parts = [upward(mesh)[1:] for mesh in (walked_on(model) if bodies is None else bodies)]
    if not parts:
        return np.empty(0), np.empty(0)
    return np.concatenate([z for z, _ in parts]), np.concatenate([area for _, area in parts])


def walked_on(model: Model) -> list[Surface]:
    """Slabs and floor coverings; ceilings are coverings too."""
    found = model.of_role("slabs", "coverings")
    return [mesh for item, mesh in found if item.role == "slabs" or item.predefined == "FLOORING"]


def _level(storey: Storey, surfaces: tuple[FloatArray, FloatArray], model: Model) -> Level:
    z = round(floor_near(storey.elevation, surfaces), 6) + 0.0  # no minus zero
    own = [item.role for item in model.described.products if item.storey == storey.global_id]
    contained = (sum(role in _OF_ROOMS for role in own), len(own))
    moved = z - storey.elevation
    notes = (f"its slab lies {moved:+.2f} m from the storey's level",) if abs(moved) > SAME else ()
    return Level(legible(storey.name), z, np.inf, storey.global_id, contained, notes=notes)


def floor_near(elevation: float, surfaces: tuple[FloatArray, FloatArray]) -> float:
    """The height near an elevation where most area looks up; the elevation itself without a slab."""
    z, area = surfaces
    near = np.abs(z - elevation) <= NEAR
    if area[near].sum() < LEAST_SLAB:
        return elevation
    steps = np.round(z[near] / 0.01).astype(np.int64)
    heights, index = np.unique(steps, return_inverse=True)
    areas = np.bincount(index, weights=area[near])
    best = heights[
        np.flatnonzero(areas >= _AS_LARGE * areas.max())[-1]
    ]  # layers of a slab lie on one another
    own = steps == best
    return round(float(np.average(z[near][own], weights=area[near][own])), 4)


def _merged(levels: Iterable[Level]) -> list[Level]:
    kept: list[Level] = []
    for level in levels:
        if kept and level.z - kept[-1].z < SAME:
            main, other = sorted((kept[-1], level), key=_fullest_first)
            note = f"storey '{other.name}' is the same floor"
            also = (*main.also, *other.also, *filter(None, (other.name,)))
            merged = (*main.merged, *other.merged, *filter(None, (other.storey,)))
            kept[-1] = replace(main, also=also, merged=merged, notes=(*main.notes, note))
        else:
            kept.append(level)
    return kept


def _fullest_first(level: Level) -> tuple[int, int]:
    """Sort key: the storey that most rooms are made of, before those of rafters and of slabs' edges."""
    return -level.contained[0], -level.contained[1]


def _with_names(levels: list[Level]) -> list[Level]:
    """The same floors, each with a name of its own: a repeated or empty one gets its height."""
    counts = Counter(level.name.strip().casefold() for level in levels)
    return [
        level
        if counts[key := level.name.strip().casefold()] == 1 and key
        else replace(level, name=f"{level.name.strip() or 'storey'} ({level.z:+.2f} m)")
        for level in levels
    ]


def _with_ceilings(levels: list[Level]) -> list[Level]:
    return [replace(level, ceiling=_ceiling(level.z, levels)) for level in levels]


def _ceiling(z: float, levels: Iterable[Level]) -> float:
    """The next floor above a height."""
    return next((up.z for up in levels if up.z > z + HEADROOM), z + OPEN_ABOVE)


def chosen_level(
    levels: tuple[Level, ...], *, model: Model, storey: str | None, z: float | None, path: Path
) -> Level:
    """The floor that the user names, or the only one there is.

    Raises
    ------
    InputError
        When none is named and there are several, none has that name, or storey and level differ.
    """
    if storey is not None:
        level = _named(levels, storey, path)
        if z is not None and abs(level.z - z) > LIKE_LEVEL:
            raise InputError(
                f"{path}: --storey {storey} lies at {level.z:g} m, not at --level {z:g}; remove one of them"
            )
        return level
    if z is not None:
        near = [level for level in levels if abs(level.z - z) <= LIKE_LEVEL]
        return min(near, key=lambda level: abs(level.z - z)) if near else _bare(z, levels)
    if len(walked(levels)) == 1:
        return walked(levels)[0]
    if not levels:
        raise InputError(
            f"{path}: the model has no storeys; give the level of the floor with --level Z (walls and "
            f"doors are at {standing_at(model)})"
        )
    raise InputError(f"{path}: has {len(levels)} storeys; choose one with --storey: {listed(levels)}")


def walked(levels: Iterable[Level]) -> list[Level]:
    """Without foundations and roofs."""
    return [level for level in levels if not level.reason]


def _named(levels: tuple[Level, ...], name: str, path: Path) -> Level:
    wanted = name.strip().casefold()
    for found in (
        [level for level in levels if name.strip() in (level.storey, *level.merged)],
        [level for level in levels if wanted in map(str.casefold, (level.name, *level.also))],
        [level for level in levels if any(wanted in text.casefold() for text in (level.name, *level.also))],
    ):
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(f"{path}: --storey {name} is true of several: {listed(found)}; name one in full")
    raise InputError(f"{path}: has no storey '{name}'; it has {listed(levels) or 'none, use --level Z'}")


def _bare(z: float, levels: tuple[Level, ...]) -> Level:
    return Level(f"level {z:g}", z, _ceiling(z, levels))


def listed(levels: Iterable[Level]) -> str:
    """Storeys by name and level, for an error."""
    heights = [f"({level.z:+.2f} m)" for level in levels]
    names = [f"'{level.name}'" for level in levels]
    return ", ".join(n if h in n else f"{n} {h}" for n, h in zip(names, heights, strict=True))


def standing_at(model: Model) -> str:
    """The heights at which most walls, columns and doors stand, for a model without storeys."""
    feet = Counter(round(body.z[0], 1) + 0.0 for _, body in model.of_role("walls", "columns", "doors"))
    return ", ".join(f"{z:g} m ({count})" for z, count in feet.most_common(4)) or "no height"
