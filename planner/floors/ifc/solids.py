"""Solids on a floor of a model: the cut at the scanner's height, and obstacles for the robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import shapely

from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model, Product, Surface
from stopgo.planner.floors.ifc.section import NOTHING, cut, footprint, same_throughout, tidy
from stopgo.planner.floors.rings import Region

OFF_LEVEL = 1.37e-3
"""A cut lies this much above a round height: planes on which things were modelled are not cut along."""
KERB = 0.1
"""A solid lower than this above the floor is driven over, or is the floor's own edge, metres."""
LAID = 0.01
"""A beam less than this below the next floor lies in it, metres."""
TREADS = (0.15, 2.0)
"""Heights above the floor between which a stair is an obstacle."""
FRAME = 0.1
"""Gaps up to this width between the parts of a window are closed, metres."""
LEAST = 4e-4
"""Square metres below which a piece of a cut is a splinter."""
AT_SCANNER = {
    "walls": "walls",
    "plates": "walls",
    "coverings": "walls",
    "footings": "walls",
    "roofs": "walls",
    "slabs": "walls",
    "columns": "columns",
    "beams": "columns",
    "members": "columns",
    "windows": "windows",
    "other": "objects",
    "furniture": "objects",
}
"""The kind of what the scanner's plane cuts, by role."""
OBJECTS = ("furniture", "other")
"""Roles of what stands on a floor and is no part of the building's structure."""
ON_FLOOR = 0.02
"""An object lower than this above the floor is driven over, metres."""
GLASS = ("walls", "plates", "coverings")
"""Roles that let the laser through where they are drawn transparent."""


@dataclass(frozen=True)
class Heights:
    """The two maps of a floor: at the scanner, and up to the robot's height."""

    scan: float = 1.3
    robot: float | None = None
    """As high as the scanner if it is not given."""

    @property
    def top(self) -> float:
        return self.scan if self.robot is None else self.robot


@dataclass(frozen=True, eq=False)
class Solid:
    """A product's plan on a floor."""

    product: Product
    kind: str
    region: Region


def solids_on(level: Level, model: Model, heights: Heights) -> list[Solid]:
    """Every element of a floor, in the order of the GlobalIds."""
    plane = level.z + heights.scan + OFF_LEVEL
    found: list[Solid] = []
    for product, mesh in model.of_role(*AT_SCANNER, "stairs", "railings"):
        if product.role in OBJECTS:
            found += _object(product, mesh, level, heights)
        elif product.role == "stairs":
            found += _stairs(product, mesh, level)
        elif product.role == "railings":
            found += _low(product, mesh, level, heights)
        elif mesh.z[0] < plane < mesh.z[1]:
            found += _cut(product, mesh, plane)
        elif product.role in ("beams", "members") and plane <= mesh.z[0] < level.ceiling - LAID:
            found += _solid(product, "beams", footprint(mesh, *mesh.z))
        else:
            found += _low(product, mesh, level, heights)
    return [*found, *_below_the_cut(found, model, level, heights)]


def _solid(product: Product, kind: str, region: Region) -> list[Solid]:
    parts = [_without_pores(part) for part in shapely.get_parts(region) if part.area > LEAST]
    return [Solid(product, kind, shapely.MultiPolygon(parts))] if parts else []


def _without_pores(part: shapely.Polygon) -> shapely.Polygon:
    """Without holes that are splinters."""
    holes = [hole for hole in part.interiors if shapely.Polygon(hole).area > LEAST]
    return shapely.Polygon(part.exterior, holes)


def _cut(product: Product, mesh: Surface, plane: float) -> list[Solid]:
    kind = AT_SCANNER[product.role]
    if product.transparent and product.role in GLASS:
        kind = "windows"
    region = cut(mesh, plane)
    return _solid(product, kind, _filled(region) if kind == "windows" else region)


def _filled(region: Region) -> Region:
    """A window with the gaps between its frames and panes closed."""
    closed = region.buffer(FRAME / 2, join_style="mitre").buffer(-FRAME / 2, join_style="mitre")
    return _on_grid(shapely.union_all([region, closed]))


def _stairs(product: Product, mesh: Surface, level: Level) -> list[Solid]:
    low, high = level.z + TREADS[0], level.z + TREADS[1]
    if mesh.z[1] <= low or mesh.z[0] >= high:
        return []
    return _solid(product, "stairs", footprint(mesh, low, high))


def _object(product: Product, mesh: Surface, level: Level, heights: Heights) -> list[Solid]:
    """Outline of an object below the robot's height, and its cut where it reaches the scanner's plane."""
    plane = level.z + heights.scan + OFF_LEVEL
    low, high = level.z + ON_FLOOR, max(level.z + heights.top, plane)
    if mesh.z[1] <= low or mesh.z[0] >= high:
        return []
    outline = footprint(mesh, low, high, is_closed=False)
    hides = cut(mesh, plane) if mesh.z[0] < plane < mesh.z[1] and not product.transparent else NOTHING
    if not hides.is_empty and outline.difference(hides).area <= LEAST:
        return [Solid(product, "objects", shapely.union_all([outline, hides]))]
    found = [Solid(product, kind, area) for kind, area in (("objects", hides), ("other", outline))]
    return [item for item in found if not item.region.is_empty]


def _low(product: Product, mesh: Surface, level: Level, heights: Heights) -> list[Solid]:
    """Obstacles for the robot that are below the scanner's plane."""
    top = max(heights.top, TREADS[1]) if product.role == "railings" else heights.top
    low, high = level.z + KERB, level.z + top
    if product.role == "roofs" or mesh.z[1] <= low or mesh.z[0] >= high:
        return []
    kind = "windows" if product.role == "windows" else "railings"
    return _solid(product, kind, footprint(mesh, low, high))


def _below_the_cut(found: list[Solid], model: Model, level: Level, heights: Heights) -> Iterator[Solid]:
    """Parts of walls below the scanner's plane that the plane does not cut: the parapet under a window."""
    standing = [item for item in found if item.kind != "beams"]
    regions = [item.region for item in standing]
    tree = shapely.STRtree(regions)
    steps = [level.z + KERB + OFF_LEVEL, level.z + heights.top / 2, level.z + heights.top - OFF_LEVEL]
    plane = level.z + heights.scan + OFF_LEVEL
    upright = [item for item in found if item.kind in ("walls", "columns")]
    for item in (item for item in upright if item.product.role != "slabs"):
        mesh = model.meshes[item.product.global_id]
        if same_throughout(mesh, steps[0], max(plane, steps[-1])):
            continue
        below = shapely.union_all([cut(mesh, height) for height in steps if mesh.z[0] < height < mesh.z[1]])
        if below.is_empty:
            continue
        near = shapely.union_all([regions[k] for k in tree.query(below)])
        rest = below.difference(near).buffer(-0.01, join_style="mitre").buffer(0.01, join_style="mitre")
        yield from _solid(item.product, "railings", _on_grid(rest))


def _on_grid(region: Region) -> Region:
    return tidy(shapely.set_precision(region, 1e-4)) if not region.is_empty else NOTHING
