"""Derivation from line work of elements that no layer shows: solid walls, doors, passages, rooms, floor.

Strokes in, strokes out: what is derived is drawn as if on the layers FLOOR, ROOMS, WALLS, DOORS and PASSAGES,
and reported in findings. Derived geometry is within 0.1 mm of the lines it is made of.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray, frozen
from stopgo.planner.floors.drawn import drawn
from stopgo.planner.floors.lines_and_texts import Stroke, Word
from stopgo.planner.floors.linework.groups import outlines_of
from stopgo.planner.floors.linework.labels import parted_by_labels
from stopgo.planner.floors.linework.spaces import (
    LEAST_ROOM,
    Spaces,
    floor_within,
    rooms_within,
    sides_of,
    tiled_floor,
)
from stopgo.planner.floors.linework.wall_gaps import WallGap, gaps_of, passages_of, without_doors
from stopgo.planner.floors.linework.walls import SolidWalls, walls_of
from stopgo.planner.floors.parts import outline_of
from stopgo.planner.floors.rings import GAP, Region, canonical_region, polygons_of
from stopgo.planner.floors.written_measures import is_only_area

_COVERS = 0.6
"""A drawn floor is used if it covers this fraction of the area that the walls enclose."""
_PANE = 0.02
"""Half the width in metres that windows' lines have as barriers."""
_TREADS = 0.4
"""Lines of stairs no farther apart than this, in metres, are one flight."""
_PIECE = 0.02
"""Lines of furniture this close, in metres, are one piece."""
_STRAY = 0.1
"""Lines farther than this from the floor, in metres, lie off it."""
_LABEL_CUT = 0.05
"""Depth in metres of the lines that part rooms by their names."""
_PATTERN = 150
"""This many small cells among the lines of walls are a pattern of tiles or a hatch, …"""
_PATTERN_DENSITY = 0.15
"""… if there are that many on a square metre; large buildings have as many niches and shafts."""


@dataclass(frozen=True, eq=False)
class Shown:
    """Traits of a building in line work, by which it is distinguished from other lines."""

    double: float = 0.0
    """Fraction of the walls' lines that run in pairs and bound a solid."""
    doors: int = 0
    """Door swings in a gap of the walls, with walls on both sides."""
    passages: int = 0
    """Gaps between ends of walls that face each other, from room to room."""
    rooms: tuple[shapely.Polygon, ...] = ()
    """In the drawing's frame, metres."""
    closed_over: float = 0.0
    """The widest gap of the outer walls that was closed, metres."""
    component: float = 0.0
    """Mean outline in metres of walls that are connected: tables and shelves are many short ones."""
    stray: float = 0.0
    """Fraction of the walls' lines that lie off the floor."""


@dataclass(frozen=True, eq=False)
class Derived:
    """Strokes and words as in a layered drawing, and findings on their derivation."""

    strokes: list[Stroke]
    words: list[Word]
    findings: list[Finding]
    cells: int = 0
    """Small spaces among the lines of walls, if they are a pattern."""
    shown: Shown = Shown()
    """Traits of a building in the line work."""


@dataclass(eq=False)
class _Site:
    """The line work in a local frame near the origin, in metres."""

    origin: FloatArray
    strokes: Sequence[Stroke]
    words: Sequence[Word]
    findings: list[Finding] = field(default_factory=list)

    def lines(self, *roles: str) -> list[FloatArray]:
        """Polylines (n, 2) of the roles; closed ones come back to their start."""
        chosen = (item for item in self.strokes if item.role in roles and not item.fill)
        lines = (self._local(item.points, closed=item.closed) for item in chosen)
        return [line for line in lines if len(line) > 1]

    def fills(self, role: str) -> list[shapely.Polygon]:
        """Areas filled by hatches of a role, without their holes."""
        return [shape for item in self._filled(role) for shape in polygons_of(item)]

    def _filled(self, role: str) -> list[Region]:
        rings = [item for item in self.strokes if item.role == role and item.fill and len(item.points) > 2]
        clockwise = [_is_clockwise(item.points) for item in rings]
        shapes = [shapely.make_valid(shapely.Polygon(self._local(item.points))) for item in rings]
        holes = shapely.union_all([shape for shape, hole in zip(shapes, clockwise, strict=True) if hole])
        return [shape.difference(holes) for shape, hole in zip(shapes, clockwise, strict=True) if not hole]

    def _local(self, points: FloatArray, *, closed: bool = False) -> FloatArray:
        line = points - self.origin
        return np.vstack((line, line[:1])) if closed else line

    def names(self) -> list[tuple[str, FloatArray]]:
        """Texts that name rooms, each with a position (2,)."""
        words = [item for item in self.words if item.role in ("names", "rooms") and item.text and item.at]
        return [(item.text, np.array(item.at[0]) - self.origin) for item in words]

    def stroke(self, points: FloatArray, role: str, layer: str, *, closed: bool) -> Stroke:
        """A derived stroke, back in the drawing's frame."""
        return Stroke(frozen(np.round(points, 4) + self.origin), layer, role, closed=closed)

    def rings(self, shape: Region, role: str, layer: str) -> list[Stroke]:
        """The rings of a region: holes have the opposite direction."""
        polygons = canonical_region(shape)
        return [self.stroke(ring, role, layer, closed=True) for part in polygons for ring in part.rings]

    def report(self, code: str, message: str, at: FloatArray | None = None) -> None:
        """Add a finding, at a position in this frame."""
        place = None if at is None else (float(at[0] + self.origin[0]), float(at[1] + self.origin[1]))
        self.findings.append(Finding(code, message, at=place))


def _is_clockwise(ring: FloatArray) -> bool:
    return not shapely.LinearRing(ring).is_ccw


def completed(strokes: Sequence[Stroke], words: Sequence[Word]) -> Derived:
    """All strokes of a floor whose outline is drawn, and the rooms and doors that no layer shows."""
    roles = {item.role for item in strokes}
    named = [as_room_name(word) for word in words]
    if "walls" not in roles or ("rooms" in roles and roles & {"doors", "passages"}):
        return Derived(list(strokes), named, [])
    site = _Site(_origin(strokes), strokes, words)
    walls, gaps = _walls_and_gaps(site, *_whole_walls(site))
    gaps, rooms = _rooms(site, walls, gaps, Spaces(_drawn_floor(site), ()))
    rooms = _entered(rooms, gaps)  # a wall drawn as a ring is solid, unless a door leads into it
    if "rooms" not in roles and len(rooms) < 2:
        return Derived(list(strokes), named, [])
    openings = [] if roles & {"doors", "passages"} else _opening_strokes(site, gaps)
    kept = [item for item in strokes if item.role not in ("openings", "rooms")]
    return Derived([*kept, *openings, *_room_strokes(site, rooms)], named, site.findings)


def derived(strokes: Sequence[Stroke], words: Sequence[Word]) -> Derived:
    """The strokes of a layered floor that the line work shows; none of a pattern."""
    site = _Site(_origin(strokes), strokes, words)
    whole, leaves = _whole_walls(site)
    if _is_pattern(whole):
        return Derived([], [], site.findings, whole.cells)
    walls, gaps = _walls_and_gaps(site, whole, leaves)
    spaces = _spaces(site, walls, gaps)
    gaps, rooms = _rooms(site, walls, gaps, spaces)
    made = [
        *_floor_strokes(site, spaces),
        *_wall_strokes(site, walls),
        *_opening_strokes(site, gaps),
        *_room_strokes(site, rooms),
        *_things(site),
    ]
    named = [as_room_name(word) for word in words]
    return Derived(made, named, site.findings, shown=_shown(site, whole, gaps, rooms, spaces))


def _is_pattern(walls: SolidWalls) -> bool:
    """True if walls enclose as many cells smaller than a room as only tiles and hatches do."""
    if walls.cells < _PATTERN:
        return False
    x0, y0, x1, y1 = shapely.total_bounds([*walls.solids, *walls.lines])
    return bool(walls.cells >= _PATTERN_DENSITY * (x1 - x0) * (y1 - y0))


def _shown(
    site: _Site,
    walls: SolidWalls,
    gaps: Sequence[WallGap],
    rooms: Sequence[shapely.Polygon],
    spaces: Spaces,
) -> Shown:
    """Traits of a building; rooms that a layer shows are those."""
    thick = sum(solid.length for solid in walls.solids)
    single = sum(line.length for line in walls.lines)
    free = spaces.floor.difference(walls.shape) if not spaces.floor.is_empty else spaces.floor
    found = rooms or [part for part in polygons_of(free) if part.area > LEAST_ROOM]
    return Shown(
        double=thick / (thick + single) if thick else 0.0,
        doors=sum(gap.kind == "door" and gap.held for gap in gaps),
        passages=sum(gap.kind == "passage" and gap.depth > _LABEL_CUT for gap in gaps),
        rooms=tuple(shapely.transform(list(found), lambda xy: xy + site.origin)),
        closed_over=spaces.closed_over or 0.0,
        component=_component(walls),
        stray=_stray(walls, spaces.floor),
    )


def _component(walls: SolidWalls) -> float:
    """Mean length of the outlines of connected solid walls."""
    parts = polygons_of(shapely.union_all(list(walls.solids))) if walls.solids else []
    return sum(part.length for part in parts) / len(parts) if parts else 0.0


def _stray(walls: SolidWalls, floor: Region) -> float:
    """Fraction of the walls' outlines that lie off a floor."""
    drawn = shapely.MultiLineString([*(solid.exterior for solid in walls.solids), *walls.lines])
    away = drawn.difference(floor.buffer(_STRAY)).length if not floor.is_empty else drawn.length
    return float(away / drawn.length) if drawn.length else 0.0


def _origin(strokes: Sequence[Stroke]) -> FloatArray:
    """A whole number of metres, so that moving there and back loses nothing."""
    low = np.min([item.points.min(axis=0) for item in strokes], axis=0)
    return np.floor(low)


def _whole_walls(site: _Site) -> tuple[SolidWalls, list[FloatArray]]:
    """Return walls with the openings of doors, and the lines of door leaves among them."""
    beside = site.lines("doors", "openings", "windows")
    built, leaves = without_doors(site.lines("walls"))
    return walls_of(built, site.fills("walls"), beside=[*beside, *leaves]), leaves


def _walls_and_gaps(
    site: _Site, whole: SolidWalls, leaves: list[FloatArray]
) -> tuple[SolidWalls, list[WallGap]]:
    """Return walls without the openings of doors, and the gaps there."""
    gaps = gaps_of(site.lines("doors"), site.lines("openings"), [*site.lines("other"), *leaves], whole)
    walls = whole.without([gap.opening for gap in gaps])
    for area in whole.too_thick:
        site.report(
            "not_a_wall",
            f"a hatch of {area.area:.1f} m² on a layer of walls is no wall",
            area.centroid.coords[0],
        )
    return walls, [*gaps, *passages_of(walls, gaps, _panes(site))]


def _panes(site: _Site) -> Region:
    """Windows as barriers."""
    lines = shapely.linestrings if not site.lines("windows") else None
    drawn = [shapely.LineString(line) for line in site.lines("windows")] if lines is None else []
    return shapely.union_all(shapely.buffer(drawn, _PANE, cap_style="square")) if drawn else shapely.Polygon()


def _barriers(site: _Site, walls: SolidWalls, gaps: Iterable[WallGap]) -> Region:
    return shapely.union_all([walls.shape, _panes(site), *(gap.place for gap in gaps)])


def _drawn_floor(site: _Site) -> Region:
    """Closed shapes on the floor's layers."""
    rings = drawn([item for item in site.strokes if item.role == "floor"], gap=GAP)
    outline, _ = outline_of(rings)
    return shapely.transform(outline, lambda xy: xy - site.origin)


def _spaces(site: _Site, walls: SolidWalls, gaps: Sequence[WallGap]) -> Spaces:
    """Return the floor: as drawn if it covers the area that walls enclose, else derived."""
    barriers = _barriers(site, walls, gaps)
    tiles = tiled_floor(site.lines("floor"), barriers)
    outline = _drawn_floor(site) if tiles.is_empty else tiles
    found = floor_within(barriers)
    if outline.intersection(found.floor).area >= _COVERS * found.floor.area and not outline.is_empty:
        return Spaces(outline, (), tiled=not tiles.is_empty)
    return found


def _rooms(
    site: _Site, walls: SolidWalls, gaps: Sequence[WallGap], spaces: Spaces
) -> tuple[list[WallGap], list[shapely.Polygon]]:
    """Return rooms of the floor, and gaps between them, without passages that separate no rooms."""
    given = drawn([item for item in site.strokes if item.role == "rooms"], gap=GAP).closed
    if given:
        shown = [part for ring in given for part in polygons_of(ring.region)]
        return _parting(gaps, shapely.transform(shown, lambda xy: xy - site.origin)), []
    kept = _parting(gaps, rooms_within(spaces.floor, _barriers(site, walls, gaps)))
    rooms = rooms_within(spaces.floor, _barriers(site, walls, kept))
    parted, cuts = parted_by_labels(rooms, [at for text, at in site.names() if not is_only_area(text)])
    return [*kept, *(WallGap("passage", cut, _LABEL_CUT, held=True) for cut in cuts)], parted


def _entered(rooms: Sequence[shapely.Polygon], gaps: Iterable[WallGap]) -> list[shapely.Polygon]:
    """Rooms that a door or a passage leads into."""
    doors = shapely.union_all([gap.place.buffer(0.05) for gap in gaps if gap.kind in ("door", "passage")])
    return [room for room in rooms if room.intersects(doors)]


def _parting(gaps: Sequence[WallGap], rooms: Iterable[shapely.Polygon]) -> list[WallGap]:
    """Doors, passages between two rooms, and openings, which are doors between rooms and else windows."""
    tree = shapely.STRtree(list(rooms))
    kept = []
    for gap in gaps:
        one, other = sides_of(gap, tree)
        inside = one is not None and other is not None
        if gap.kind == "door" or (inside and one != other):
            kept.append(replace(gap, kind="door") if gap.kind == "opening" else gap)
        elif gap.kind == "opening":
            kept.append(replace(gap, kind="window"))
        elif not inside:
            kept.append(replace(gap, kind="mouth"))
    return kept


def _floor_strokes(site: _Site, spaces: Spaces) -> list[Stroke]:
    if spaces.tiled:
        area = spaces.floor.area
        site.report("inferred_floor", f"the floor is what its pattern of tiles covers: {area:.4g} m²")
        return site.rings(spaces.floor, "floor", "FLOOR")
    if spaces.closed_over is None:
        return [item for item in site.strokes if item.role == "floor"]
    area = spaces.floor.area
    site.report(
        "inferred_floor",
        f"no layer shows the floor: {area:.4g} m² within the walls were taken, "
        f"gaps up to {spaces.closed_over:g} m in them closed (draw it on a layer FLOOR to be sure)",
    )
    return site.rings(spaces.floor, "floor", "FLOOR")


def _wall_strokes(site: _Site, walls: SolidWalls) -> list[Stroke]:
    layer = next((item.layer for item in site.strokes if item.role == "walls"), "WALLS")
    if walls.joined:
        site.report(
            "inferred_walls",
            f"{walls.joined} ends of wall lines were joined over gaps or across a wall's end",
        )
    solids = [ring for solid in walls.solids for ring in site.rings(solid, "walls", layer)]
    lines = [site.stroke(shapely.get_coordinates(line), "walls", layer, closed=False) for line in walls.lines]
    return [*solids, *lines]


def _opening_strokes(site: _Site, gaps: Sequence[WallGap]) -> list[Stroke]:
    """Doors and passages as lines across them; windows where a symbol turned out to be one."""
    roles = {"door": "doors", "passage": "passages", "window": "windows"}
    for kind, role in roles.items():
        own = [gap for gap in gaps if gap.kind == kind]
        if own and kind != "window":
            loose = sum(not gap.held for gap in own)
            doubt = f"; {loose} of them do not reach walls on both sides" if loose else ""
            site.report(f"inferred_{role}", f"{len(own)} {role} were found in the line work{doubt}")
    return [
        site.stroke(gap.line, roles[gap.kind], gap.kind.upper(), closed=False)
        for gap in gaps
        if gap.kind in roles
    ]


def _room_strokes(site: _Site, rooms: Sequence[shapely.Polygon]) -> list[Stroke]:
    given = [item for item in site.strokes if item.role == "rooms"]
    if given or len(rooms) < 2:
        return given
    area = sum(room.area for room in rooms)
    site.report(
        "inferred_rooms",
        f"no layer shows rooms: {len(rooms)} were derived from the walls, {area:.4g} m² in all",
    )
    return [ring for room in rooms for ring in site.rings(room, "rooms", "ROOMS")]


def _things(site: _Site) -> list[Stroke]:
    """Objects on the floor and unknown shapes, as drawn; furniture and stairs as outlines."""
    plain = ("columns", "beams", "railings", "windows", "other")
    things = [item for item in site.strokes if item.role in plain]
    for role, to, within in (("stairs", "stairs", _TREADS), ("furniture", "other", _PIECE)):
        own = [item for item in site.strokes if item.role == role]
        outlines = [part for part in outlines_of(site.lines(role), within=within)] + site.fills(role)
        if outlines:
            whole = polygons_of(shapely.union_all(outlines))
            things += [ring for part in whole for ring in site.rings(part, to, own[0].layer)]
    return things


def as_room_name(word: Word) -> Word:
    """The word, on the layer of rooms if it names one."""
    return replace(word, role="rooms") if word.role == "names" else word
