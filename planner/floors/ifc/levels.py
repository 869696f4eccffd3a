"""Levels of a model: the height of each storey's slab, and the storeys that are one floor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray
from stopgo.planner.floors.drawing import legible
from stopgo.planner.floors.ifc.model import Model, Storey, Surface
from stopgo.planner.floors.ifc.section import upward

NEAR = 0.6
"""A storey's slab lies at most so far above or below the level that the model gives it, in metres."""
SAME = 0.02
"""Storeys whose floors lie closer than this are one floor."""
LEAST_SLAB = 1.0
"""Square metres of slab that make a level."""
HEADROOM = 1.8
"""A floor that lies less than this above another is no storey over it."""
LIKE_LEVEL = 0.3
"""A level means the storey whose floor is as near as this, metres."""
OPEN_ABOVE = 3.0
"""Height that is taken above the topmost floor."""


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
    contained: int = 0
    """Products that the model places in it."""
    notes: tuple[str, ...] = ()
    aside: bool = False
    """True if nobody walks there: a foundation, a crawl space, a roof."""


def levels_of(model: Model) -> tuple[Level, ...]:
    """Every storey with its floor's level, from below; storeys of one floor are merged."""
    surfaces = _surfaces(model)
    found = [_level(storey, surfaces, model) for storey in model.described.storeys]
    found.sort(key=lambda level: (level.z, -level.contained, level.name, level.storey or ""))
    return tuple(_with_ceilings(_merged(found)))


def _surfaces(model: Model) -> tuple[FloatArray, FloatArray]:
    """Heights and areas of all that looks up on slabs and floor coverings."""
    parts = [upward(mesh)[1:] for mesh in walked_on(model)]
    if not parts:
        return np.empty(0), np.empty(0)
    return np.concatenate([z for z, _ in parts]), np.concatenate([area for _, area in parts])


def walked_on(model: Model) -> list[Surface]:
    """Slabs and floor coverings; ceilings are coverings too."""
    found = model.of_role("slabs", "coverings")
    return [mesh for item, mesh in found if item.role == "slabs" or item.predefined == "FLOORING"]


def _level(storey: Storey, surfaces: tuple[FloatArray, FloatArray], model: Model) -> Level:
    z = floor_near(storey.elevation, surfaces)
    contained = sum(product.storey == storey.global_id for product in model.described.products)
    moved = z - storey.elevation
    notes = (f"its slab lies {moved:+.2f} m from the storey's level",) if abs(moved) > SAME else ()
    return Level(legible(storey.name), z, np.inf, storey.global_id, contained, notes)


def floor_near(elevation: float, surfaces: tuple[FloatArray, FloatArray]) -> float:
    """The height near an elevation where most area looks up; the elevation itself without a slab."""
    z, area = surfaces
    near = np.abs(z - elevation) <= NEAR
    if area[near].sum() < LEAST_SLAB:
        return elevation
    steps = np.round(z[near] / 0.01).astype(np.int64)
    heights, index = np.unique(steps, return_inverse=True)
    areas = np.bincount(index, weights=area[near])
    best = heights[int(np.argmax(np.round(areas, 3)))]
    own = steps == best
    return round(float(np.average(z[near][own], weights=area[near][own])), 4)


def _merged(levels: Iterable[Level]) -> list[Level]:
    kept: list[Level] = []
    for level in levels:
        if kept and level.z - kept[-1].z < SAME:
            main, other = sorted((kept[-1], level), key=lambda item: -item.contained)
            note = f"storey '{other.name}' is the same floor"
            kept[-1] = replace(main, notes=(*main.notes, note))
        else:
            kept.append(level)
    return kept


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


FOUNDATION = "below the lowest storey with doors or rooms: a foundation"
ROOF = "nothing above it: a roof"


def walked(levels: Iterable[Level]) -> list[Level]:
    """Without foundations and roofs."""
    return [level for level in levels if not level.aside]


def _named(levels: tuple[Level, ...], name: str, path: Path) -> Level:
    wanted = name.strip().casefold()
    for fits in (lambda text: text == wanted, lambda text: wanted in text):
        found = [level for level in levels if fits(level.name.casefold())]
        if len(found) == 1:
            return found[0]
        if found:
            raise InputError(f"{path}: --storey {name} is true of several: {listed(found)}; use --level Z")
    raise InputError(f"{path}: has no storey '{name}'; it has {listed(levels) or 'none, use --level Z'}")


def _bare(z: float, levels: tuple[Level, ...]) -> Level:
    return Level(f"level {z:g}", z, _ceiling(z, levels))


def listed(levels: Iterable[Level]) -> str:
    """Storeys by name and level, for an error."""
    return ", ".join(f"'{level.name}' ({level.z:+.2f} m)" for level in levels)


def standing_at(model: Model) -> str:
    """The heights at which most walls, columns and doors stand, for a model without storeys."""
    feet = Counter(round(body.z[0], 1) + 0.0 for _, body in model.of_role("walls", "columns", "doors"))
    return ", ".join(f"{z:g} m ({count})" for z, count in feet.most_common(4)) or "no height"


def with_uses(levels: tuple[Level, ...], model: Model) -> tuple[Level, ...]:
    """The same floors; those not for walking are marked: crawl spaces, foundations and open roofs."""
    if not levels:
        return ()
    lively = [_lively(level, model) for level in levels]
    first = lively.index(True) if any(lively) else 0
    notes = [
        _crawled(level, above)
        or (FOUNDATION if number < first else "")
        or (ROOF if not lively[number] and _under_the_sky(level, model) else "")
        for number, (level, above) in enumerate(zip(levels, (*levels[1:], None), strict=True))
    ]
    return tuple(
        replace(level, aside=bool(note), notes=(*level.notes, *([note] if note else [])))
        for level, note in zip(levels, notes, strict=True)
    )


def _crawled(level: Level, above: Level | None) -> str:
    if above is None or above.z - level.z >= HEADROOM:
        return ""
    return f"only {above.z - level.z:.2f} m below '{above.name}': nobody walks there"


def _lively(level: Level, model: Model) -> bool:
    """True if a floor has a door, or several rooms."""
    doors = any(abs(mesh.z[0] - level.z) < 0.3 for _, mesh in model.of_role("doors"))
    return doors or sum(abs(mesh.z[0] - level.z) < 0.6 for _, mesh in model.of_role("spaces")) > 1


def _under_the_sky(level: Level, model: Model) -> bool:
    """True if less than half of the floor lies under a slab or a roof, in a model that has any."""
    if not model.of_role("slabs", "roofs"):
        return False
    floor = _surfaces(model)
    below = float(floor[1][np.abs(floor[0] - level.z) <= 0.05].sum())
    above = sum(_shade(mesh) for _, mesh in model.of_role("slabs", "roofs") if mesh.z[1] > level.z + HEADROOM)
    return above < below / 2 if below else not above


def _shade(mesh: Surface) -> float:
    """Area in plan of a closed body, m²: half of what all its faces throw down."""
    a, b, c = (mesh.triangles[:, index, :2] for index in range(3))
    u, v = b - a, c - a
    return float(np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum()) / 4
