"""Ceilings of a storey, and the beams above them or within walls: no ray from below reaches these."""

from __future__ import annotations

import shapely

from stopgo.mission.floor import Finding
from stopgo.planner.floors.ifc.levels import Level
from stopgo.planner.floors.ifc.model import Model
from stopgo.planner.floors.ifc.section import NOTHING, cut, footprint, tidy
from stopgo.planner.floors.ifc.solids import OFF_LEVEL, Heights, Solid
from stopgo.planner.floors.rings import Region

CEILINGS = ("coverings", "slabs", "roofs")
AROUND = ("walls", "columns", "slabs", "coverings")
"""Roles of what a beam may lie in."""
THICK = 0.5
"""A ceiling is thinner than this, metres."""
LEAST_PART = 0.02
"""Square metres from which a part of a beam counts."""
BARE = 0.1
"""A beam of which less than this fraction is outside of walls lies in them; the bearings of others count."""
REVEAL = 0.02
"""A beam that hangs lower than a ceiling by more than this is seen below it, metres."""


def without_hidden_beams(
    solids: list[Solid], model: Model, level: Level, heights: Heights
) -> tuple[list[Solid], list[Finding]]:
    """Return the solids without what ceilings and walls hide of beams, and a finding that reports it."""
    kept: list[Solid] = []
    hidden, whole = 0.0, 0.0
    ceilings = _ceilings(model, level, heights) if any(item.kind == "beams" for item in solids) else []
    for item in solids:
        if item.kind != "beams":
            kept.append(item)
            continue
        underside, top = model.meshes[item.product.global_id].z
        below = [region for z, region in ceilings if z < underside + REVEAL]
        left = _left(item.region, below)
        if _left(left, _around(item, model, (underside + top) / 2 + OFF_LEVEL)).area <= BARE * left.area:
            left = NOTHING
        whole += item.region.length
        hidden += item.region.length - left.length if left.area < item.region.area else 0.0
        if not left.is_empty:
            kept.append(Solid(item.product, item.kind, left))
    if hidden < LEAST_PART:
        return kept, []
    text = f"ceilings and walls hide {hidden:.0f} m of the {whole:.0f} m of beams: they are no targets"
    return kept, [Finding("hidden_beams", text)]


def _around(beam: Solid, model: Model, z: float) -> list[Region]:
    """Sections, at a beam's middle height, of what it lies in."""
    if beam.region.is_empty:
        return []
    x0, y0, x1, y1 = beam.region.bounds
    found = []
    for _, mesh in model.of_role(*AROUND):
        if mesh.z[0] < z < mesh.z[1]:
            (left, low), (right, high) = mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)
            if left < x1 and right > x0 and low < y1 and high > y0:
                found.append(cut(mesh, z))
    return found


def _left(region: Region, ceilings: list[Region]) -> Region:
    """The parts of a region that no ceiling covers."""
    over = [ceiling for ceiling in ceilings if ceiling.intersects(region)]
    if not over:
        return region
    rest = region.difference(shapely.union_all(over).buffer(LEAST_PART / 2, join_style="mitre"))
    parts = [part for part in shapely.get_parts(tidy(rest)) if part.area > LEAST_PART]
    return shapely.MultiPolygon(parts) if parts else NOTHING


def _ceilings(model: Model, level: Level, heights: Heights) -> list[tuple[float, Region]]:
    """Undersides and outlines of what hangs over the scanner, up to the next floor."""
    found = []
    for product, mesh in model.of_role(*CEILINGS):
        low, high = mesh.z
        if level.z + heights.scan < low < level.ceiling and high - low <= THICK and not product.transparent:
            found.append((low, footprint(mesh, low, high)))
    return found
