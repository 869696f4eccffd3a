"""Properties of every plan, by any variant: checked with plain shapely from the floor as read."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from stopgo.mission.document import Mission, digest_of
from stopgo.mission.document.problems import problems_of
from stopgo.mission.files.mission_json import encode, parse
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, NavigableSpace, Route, Selection, Visibility
from stopgo.planner.geometry.shapes import GRID, face_segments, local_origin, to_grid, whole_steps_of
from stopgo.planner.routing.roadmap import paths_between
from stopgo.planner.selection.cover import Cover
from stopgo.planner.visibility.exact_sight import viewpoints_of
from tests.faults.sizes import FULL
from tests.planner.oracle import visible_pairs

TOLERANCE = 1e-5
THRESHOLD = 0.3
"""The floor assumed on each side of an opening's line."""


def check_plan(mission: Mission, nouns: dict[type, Any], settings: Settings, *, brute: bool = True) -> None:
    """Every property a plan has; `nouns` are what the planner handed to `observe`."""
    floor: FloorPlan = nouns[FloorPlan]
    check_document(mission)
    check_chain(mission, settings)
    check_legs(mission, floor, nouns[NavigableSpace], settings)
    check_stops(mission, nouns[NavigableSpace], settings)
    check_bounds(mission, nouns, settings)
    if brute:
        check_coverage(mission, nouns[Selection], settings)


def check_document(mission: Mission) -> None:
    data = encode(mission)
    assert parse(data, "mission.json") == mission
    assert encode(parse(data, "mission.json")) == data
    assert mission.digest == digest_of(mission)
    assert problems_of(mission) == ()


def legs_of(mission: Mission) -> list[np.ndarray]:
    legs = [np.array(stop.approach) for stop in mission.stops]
    return legs if mission.return_ is None else [*legs, np.array(mission.return_)]


def check_chain(mission: Mission, settings: Settings) -> None:
    here = (mission.start.x, mission.start.y)
    for stop in mission.stops:
        assert stop.approach[0] == here, f"{stop.id} is approached from elsewhere"
        here = (stop.x, stop.y)
        assert stop.approach[-1] == here
        if len(stop.approach) > 1 and settings.fov == 360:
            step = np.subtract(stop.approach[-1], stop.approach[-2])
            off = math.remainder(math.atan2(step[1], step[0]) - stop.heading, math.tau)
            assert abs(off) <= 1e-4, f"{stop.id} does not look along its approach"
    closed = settings.tour == "closed" or (settings.tour is None and settings.start and settings.end is None)
    if mission.return_ is not None:
        assert mission.return_[0] == here
        end = settings.end if settings.end is not None else (mission.start.x, mission.start.y)
        assert np.allclose(mission.return_[-1], end, atol=1e-6)
    else:
        assert settings.end is None
        assert not closed or len(mission.stops) == 1
    for leg in legs_of(mission):
        assert np.isfinite(leg).all()
        assert all(tuple(a) != tuple(b) for a, b in pairwise(leg.tolist())), "a point twice in a leg"


def shape_of(polygon: Polygon) -> shapely.Geometry:
    """A polygon as drawn; what of it has no area (spikes, slivers of no width) is left out."""
    if len(polygon.exterior) < 3:
        return shapely.Polygon()
    made = shapely.make_valid(shapely.Polygon(polygon.exterior, polygon.holes))
    return shapely.union_all([part for part in shapely.get_parts(made) if part.area > 0])


def obstacles_of(floor: FloorPlan) -> list[shapely.Geometry]:
    """Every obstacle as drawn, filled shapes and lines."""
    solids = [shape_of(solid) for item in floor.elements if item.obstacle for solid in item.solids]
    lines = [
        shapely.LineString(line)
        for item in floor.elements
        if item.obstacle
        for line in item.lines
        if len(line) > 1
    ]
    return [shape for shape in solids + lines if not shape.is_empty]


def floor_edges(floor: FloorPlan) -> shapely.Geometry:
    return shapely.boundary(shapely.union_all([shape_of(polygon) for polygon in floor.outline]))


def check_legs(mission: Mission, floor: FloorPlan, space: NavigableSpace, settings: Settings) -> None:
    """Legs keep the robot's radius from obstacles, the edge from floor edges, and out of closed openings."""
    obstacles = np.array([*obstacles_of(floor), shapely.Point(1e9, 1e9)])
    closed = [shapely.LineString(o.opening.line) for o in space.openings if not o.passable]
    doors = [shapely.LineString(o.opening.line) for o in space.openings if o.passable]
    near_doors = shapely.union_all([line.buffer(THRESHOLD + settings.edge + 0.1) for line in doors])
    ground = shapely.union_all([shape_of(p) for p in floor.outline] + [d.buffer(THRESHOLD) for d in doors])
    edges = floor_edges(floor)
    for number, leg in enumerate(legs_of(mission)):
        line = shapely.LineString(leg) if len(leg) > 1 else shapely.Point(leg[0])
        away = float(shapely.distance(obstacles, line).min())
        assert away >= settings.radius - TOLERANCE, f"leg {number} passes an obstacle at {away:.6f} m"
        free = line.difference(near_doors)
        if not free.is_empty and settings.edge > 0:
            away = float(edges.distance(free))
            assert away >= settings.edge - 3 * TOLERANCE, f"leg {number} passes an edge at {away:.6f} m"
        assert line.difference(ground.buffer(TOLERANCE)).is_empty, f"leg {number} leaves the floor"
        for opening in closed:
            assert not line.intersects(opening), f"leg {number} crosses a closed opening"


def check_stops(mission: Mission, space: NavigableSpace, settings: Settings) -> None:
    floor = space.floor
    unnamed = any(part.room is None for part in space.rooms)
    obstacles = np.array([*obstacles_of(floor), shapely.Point(1e9, 1e9)])
    edges = floor_edges(floor)
    ground = shapely.union_all([shape_of(polygon) for polygon in floor.outline])
    rooms = shapely.union_all([shape_of(polygon) for room in floor.rooms for polygon in room.polygons])
    ids = [stop.id for stop in mission.stops]
    assert len(set(ids)) == len(ids)
    for stop in mission.stops:
        point = shapely.Point(stop.x, stop.y)
        away = float(shapely.distance(obstacles, point).min())
        need = settings.radius if stop.doorway else max(settings.d_sec, settings.radius)
        assert away >= need - TOLERANCE, f"{stop.id} is {away:.6f} m from an element"
        if not stop.doorway:
            assert ground.distance(point) <= TOLERANCE, f"{stop.id} is not on the floor"
            assert edges.distance(point) >= settings.edge - TOLERANCE, f"{stop.id} is too near an edge"
            if floor.rooms and not unnamed:
                assert rooms.distance(point) <= TOLERANCE, f"{stop.id} is outside every room"


def check_bounds(mission: Mission, nouns: dict[type, Any], settings: Settings) -> None:
    selection: Selection = nouns[Selection]
    route: Route = nouns[Route]
    assert len(set(selection.chosen.tolist())) == len(selection.chosen)
    assert sorted(route.order.tolist()) == list(range(len(selection.chosen)))
    assert 1 <= selection.bound <= len(selection.chosen) == len(mission.stops)
    assert selection.coverage >= settings.coverage - 1e-12
    assert np.all(np.diff(selection.coverage_steps) >= 0)
    assert 0 <= route.bound <= route.length + 1e-6
    lengths = [np.hypot(*np.diff(leg, axis=0).T).sum() for leg in legs_of(mission)]
    assert np.isclose(sum(lengths), route.length, atol=1e-4)


def check_coverage(mission: Mission, selection: Selection, settings: Settings) -> None:
    """Recompute by brute force what candidates see, the chosen ones among them."""
    seen = matrix_by_force(selection.visibility, selection.chosen)
    pattern = np.setdiff1d(np.arange(len(seen)), selection.candidates.extra_rows)
    visible = seen[pattern].any(axis=0)
    assert np.array_equal(visible, selection.visibility.visible), "another set of units is visible"
    covered = seen[selection.chosen].any(axis=0)
    check_shares(selection, visible, covered & visible, settings)
    assert sum(stop.sees.new_units for stop in mission.stops) == covered.sum()
    for stop in mission.stops:
        nearest = int(np.argmin(np.hypot(*(selection.xy - (stop.x, stop.y)).T)))
        assert stop.sees.units == seen[selection.chosen[nearest]].sum()


def check_shares(selection: Selection, visible: np.ndarray, covered: np.ndarray, settings: Settings) -> None:
    """The shares of the whole, and of every room and kind unless the paper's rule is asked."""
    space = selection.space
    targets = space.targets
    length = np.hypot(*(targets.b - targets.a).T) / targets.units
    weight = np.repeat(length if settings.coverage_rule == "length" else np.ones(len(length)), targets.units)
    assert np.isclose(weight[covered].sum() / weight[visible].sum(), selection.coverage, atol=1e-4)
    if settings.coverage_rule == "paper":
        return
    kind = np.array([space.floor.elements[k].kind for k in targets.element])[targets.unit_segment]
    members = [(space.unit_room == k, settings.least_of_room) for k in range(len(space.rooms))]
    members += [(kind == name, settings.least_of_kind) for name in sorted(set(kind.tolist()))]
    for member, share in members:
        assert weight[covered & member].sum() >= share * weight[visible & member].sum() - 1e-4


ALL_UP_TO = 100
"""Candidates of which all are looked at again; of more, every so many."""


def matrix_by_force(visibility: Visibility, always: np.ndarray) -> np.ndarray:
    """Units that each candidate sees (rows, units), computed again for some rows and all of `always`."""
    every = 1 if FULL else 1 + visibility.rows // ALL_UP_TO
    again = np.union1d(np.arange(0, visibility.rows, every), always)
    seen = np.zeros((visibility.rows, visibility.targets.total), dtype=bool)
    for row in range(visibility.rows):
        seen[row, visibility.seen_by(row)] = True
    told = by_force(visibility.candidates, again)
    assert np.array_equal(seen[again], told), "candidates see other units"
    return seen


def by_force(found: Candidates, rows: np.ndarray) -> np.ndarray:
    """Units that candidates see; those in closed doorways look from both sides of the door's line."""
    eyes, row = viewpoints_of(found)
    seen = seen_by_eyes(found, eyes[np.isin(row, rows)])
    of = np.searchsorted(rows, row[np.isin(row, rows)])
    steep = steep_enough(found, found.xy[found.kept][rows])
    return np.array([seen[of == k].any(axis=0) for k in range(len(rows))]) & steep


def steep_enough(found: Candidates, positions: np.ndarray) -> np.ndarray:
    """True for units whose normal is within the largest angle of the ray from a position (p, units)."""
    most = found.settings.most_incidence
    if most is None:
        return np.ones((len(positions), found.space.targets.total), dtype=bool)
    targets, origin = found.space.targets, local_origin(found.floor)
    a, b = (to_grid(end - origin)[targets.unit_segment].astype(float) for end in (targets.a, targets.b))
    number = np.arange(targets.total) - targets.first_unit[targets.unit_segment]
    ray = (
        a
        + ((number + 0.5) / targets.units[targets.unit_segment])[:, None] * (b - a)
        - to_grid(positions - origin)[:, None]
    )
    along = (b - a) / np.maximum(np.hypot(*(b - a).T), 1e-9)[:, None]
    across = np.abs(ray[..., 0] * along[:, 1] - ray[..., 1] * along[:, 0])
    away = np.hypot(ray[..., 0], ray[..., 1])
    return (across >= np.cos(np.radians(most)) * away) | (a == b).all(axis=1)


def seen_by_eyes(found: Candidates, eyes: np.ndarray) -> np.ndarray:
    space, targets = found.space, found.space.targets
    origin = local_origin(space.floor)
    return visible_pairs(
        to_grid(eyes - origin),
        face_segments(whole_steps_of(space.occluders, origin)).astype(np.int64),
        to_grid(targets.a - origin),
        to_grid(targets.b - origin),
        targets.units,
        targets.occluding,
        reach=round(space.settings.range / GRID),
    )


def meets(cover: Cover, rows: np.ndarray) -> bool:
    """True if these rows meet every demand."""
    return not cover.missing(cover.covered_by(rows)).any()


def check_rooms_are_joined(space: NavigableSpace) -> int:
    """Both rooms of every passable opening have a way between them; the number of openings checked."""
    drive = [shape_of(polygon) for polygon in space.drive_area]
    places = {k: _places(shape_of_room(space, k), drive) for k in range(len(space.floor.rooms))}
    points = [point for found in places.values() for point in found]
    keys = [(k, n) for k, found in places.items() for n in range(len(found))]
    index = {key: position for position, key in enumerate(keys)}
    lengths = paths_between(space, np.array(points).reshape(-1, 2)).lengths
    joined = 0
    for item in space.openings:
        one, other = item.rooms
        if not item.passable or one is None or other is None or one == other:
            continue
        pairs = [
            lengths[index[one, n], index[other, m]]
            for n in range(len(places[one]))
            for m in range(len(places[other]))
        ]
        assert np.isfinite(pairs).any(), f"{item.opening.id} is passable, but its rooms are not joined"
        joined += 1
    return joined


def shape_of_room(space: NavigableSpace, index: int) -> shapely.Geometry:
    return shapely.union_all([shape_of(polygon) for polygon in space.floor.rooms[index].polygons])


def _places(room: shapely.Geometry, drive: list[shapely.Geometry]) -> list[np.ndarray]:
    """A point in every piece of drive area that makes up at least a fifth of the room's."""
    pieces = [piece.intersection(room) for piece in drive]
    pieces = [piece for piece in pieces if piece.area > 1e-6]
    total = sum(piece.area for piece in pieces)
    return [np.array(piece.representative_point().coords[0]) for piece in pieces if piece.area >= 0.2 * total]
