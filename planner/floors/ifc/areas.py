"""Floor area and rooms of a storey: as modelled, else inferred."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import shapely

from stopgo.mission.floor import Finding
from stopgo.planner.floors.ifc.doors import Door
from stopgo.planner.floors.ifc.levels import Level, walked_on
from stopgo.planner.floors.ifc.model import Model, Product, Surface
from stopgo.planner.floors.ifc.section import NOTHING, cut, tidy, union_of, upward
from stopgo.planner.floors.ifc.solids import OFF_LEVEL, Solid
from stopgo.planner.floors.rings import Region

NEAR_LEVEL = 0.05
"""A slab's face belongs to the floor if it lies within this of it, metres."""
JOINT = 0.03
"""Gaps between slabs up to this width are closed, metres."""
WALL_GAP = 0.05
"""Between rooms, walls and door openings, gaps up to this width are floor, metres."""
ENOUGH = 0.5
"""Slabs that cover less than this share of the rooms are not the whole floor."""
CLOSINGS = (0.6, 1.2, 2.4, 4.0, 6.0)
"""Gaps that are closed, one after the other, until walls enclose a floor, metres."""
LIKE_MOST = 0.8
"""A closing is wide enough once it encloses this share of what the widest does."""
LEAST_ROOM = 1.0
"""Least area of a room inferred from walls, m²."""
STRIP = 0.3
"""The rest of a space next to smaller ones is not a room if it is narrower than this, metres."""
OWN = 0.2
"""A space with less than this fraction of its area outside smaller ones is a sum of them."""
NOISE = 1e-3
"""Spaces overlap by this share of their area without anybody meaning it."""
BARRIERS = ("walls", "columns", "windows", "railings")


@dataclass(frozen=True, eq=False)
class Space:
    """A room's area, before it is a room of a floor plan."""

    region: Region
    name: str = ""
    global_id: str | None = None


def modelled_rooms(level: Level, model: Model, scan_height: float) -> tuple[list[Space], list[Finding]]:
    """The model's spaces that stand on a floor, cut at the scanner's height, apart from one another."""
    spaces = [
        Space(region, product.name, product.global_id)
        for product, mesh in model.of_role("spaces")
        if abs(mesh.z[0] - level.z) <= 0.6
        and not (region := _cut_of(product, mesh, level, scan_height)).is_empty
    ]
    rooms = _apart(spaces)
    dropped = len(spaces) - len(rooms)
    text = f"{dropped} of {len(spaces)} spaces repeat or hold others and are no rooms of their own"
    return rooms, [Finding("spaces_overlap", text)] if dropped else []


def _apart(spaces: Sequence[Space]) -> list[Space]:
    """Areas without overlaps: the smaller space keeps an overlap; the rest of a gross area is no room."""
    kept: list[Space] = []
    for space in sorted(spaces, key=lambda item: (item.region.area, item.global_id or "")):
        others = [other.region for other in kept if other.region.intersects(space.region)]
        left = space.region.difference(shapely.union_all(others)) if others else space.region
        core = left.buffer(-STRIP / 2, join_style="mitre").buffer(STRIP / 2, join_style="mitre")
        rest = tidy(shapely.set_precision(left.intersection(core), 1e-4))
        if left.area > (1 - NOISE) * space.region.area:
            kept.append(space)
        elif rest.area > OWN * space.region.area:
            kept.append(Space(rest, space.name, space.global_id))
    return sorted(kept, key=lambda item: item.global_id or "")


def _cut_of(product: Product, mesh: Surface, level: Level, scan_height: float) -> Region:
    plane = level.z + scan_height + OFF_LEVEL
    if mesh.z[1] <= plane:  # a low space, as under a stair
        plane = (mesh.z[0] + mesh.z[1]) / 2
    return cut(mesh, plane)


def floor_area(
    level: Level, model: Model, rooms: Sequence[Space], solids: Sequence[Solid], doors: Sequence[Door]
) -> tuple[Region, list[Finding]]:
    """The floor: the slabs at its level, else the rooms and what stands between, else the walls' hull."""
    slabs, odd = slabs_at(level, walked_on(model)), []
    if slabs.is_empty:
        slabs = slabs_at(level, [body for _, body in model.of_role("other")])
        odd = [
            Finding("floor_from_proxies", f"no slab at {level.z:.2f} m: the floor is IfcBuildingElementProxy")
        ]
    spaces = shapely.union_all([room.region for room in rooms]) if rooms else NOTHING
    standing = [item.region for item in solids if item.kind in BARRIERS]
    if slabs.area and slabs.area >= ENOUGH * spaces.area:
        return slabs, odd
    if rooms:
        doorways = [door.threshold for door in doors]
        between = shapely.union_all([spaces, slabs, *standing, *doorways])
        said = (
            "no slab" if slabs.is_empty else f"slabs cover {slabs.area:.0f} m² of {spaces.area:.0f} m² rooms"
        )
        text = f"{said} at {level.z:.2f} m: the floor is taken from {len(rooms)} rooms and the walls between"
        return closed(between, WALL_GAP), [Finding("floor_from_rooms", text)]
    walls = [item.region for item in solids if item.kind in ("walls", "columns", "windows")]
    hull, gap = _enclosed([*walls, *(door.threshold for door in doors)])
    if hull.difference(shapely.union_all(standing)).area < LEAST_ROOM:
        return slabs, []
    text = (
        f"no slab, no rooms at {level.z:.2f} m: the floor is what walls enclose, gaps up to {gap:g} m closed"
    )
    sills = [item.region for item in solids if item.kind == "railings" and item.region.intersects(hull)]
    return tidy(shapely.union_all([hull, slabs, *sills])), [Finding("floor_from_walls", text)]


def slabs_at(level: Level, bodies: Iterable[Surface]) -> Region:
    """Upward faces of bodies near a level, with small gaps closed."""
    faces: list[Region] = []
    for mesh in bodies:
        if mesh.z[0] > level.z + NEAR_LEVEL or mesh.z[1] < level.z - NEAR_LEVEL:
            continue
        triangles, heights, _ = upward(mesh)
        faces.append(union_of(triangles[abs(heights - level.z) <= NEAR_LEVEL]))
    return closed(shapely.union_all(faces), JOINT) if faces else NOTHING


def closed(region: Region, gap: float) -> Region:
    """A region whose gaps up to a width are filled; corners stay as they are."""
    wide = region.buffer(gap / 2, join_style="mitre").buffer(-gap / 2, join_style="mitre")
    return tidy(shapely.set_precision(shapely.union_all([wide, region]), 1e-4))


def _enclosed(standing: Sequence[Region]) -> tuple[Region, float]:
    """The area that walls enclose, by the smallest closing of gaps about as good as the widest."""
    walls = shapely.union_all(standing) if standing else NOTHING
    hulls = [(_filled(walls, gap), gap) for gap in CLOSINGS]
    most = max(hull.area for hull, _ in hulls)
    return next((pair for pair in hulls if pair[0].area >= LIKE_MOST * most), (NOTHING, 0.0))


def _filled(walls: Region, gap: float) -> Region:
    """Walls with what they enclose, where openings narrower than `gap` count as closed."""
    thick = walls.buffer(gap / 2, join_style="mitre")
    whole = [shapely.Polygon(part.exterior) for part in shapely.get_parts(thick)]
    return tidy(shapely.set_precision(shapely.union_all(whole).buffer(-gap / 2, join_style="mitre"), 1e-4))


def derived_rooms(floor: Region, solids: Sequence[Solid], doors: Sequence[Door]) -> list[Space]:
    """Rooms of a floor without spaces: what is left between its barriers with all doors shut.

    An area with walls on less than half of its outline, such as a terrace, is floor and not a room.
    """
    barriers = [item.region for item in solids if item.kind in BARRIERS]
    shut = shapely.union_all(
        [*barriers, *(door.threshold.buffer(0.01, join_style="mitre") for door in doors)]
    )
    left = shapely.set_precision(floor.difference(shut), 1e-4)
    around = shut.buffer(0.05)
    return [
        Space(part)
        for part in shapely.get_parts(tidy(left))
        if part.area >= LEAST_ROOM and part.exterior.intersection(around).length > part.exterior.length / 2
    ]
