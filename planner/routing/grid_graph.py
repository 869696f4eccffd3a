"""The paper's navigable graph: a grid per room, joined at the doors (paper, 3.5).

Each room's grid is 8-connected in the room's own axes; edges that leave the drive area are removed. From
1 m on its resolution is halved until it has den_grid_min nodes per navigable m², and every stop in the
room a node within max_err_dist. Rooms in rooms are subtracted from the outer one, so that their doors
join the two; a floor without rooms is one grid.

Our additions: a grid is also refined until it connects the room's stops and doors. All grids are refined if
stops are still not connected. Rooms that adjoin without a wall are joined along their border. The paper
moves scan positions to the nearest node; here the path continues from that node to the stop itself, and
every piece of it lies in the drive area.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from shapely.geometry.base import BaseGeometry

from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.room_grid import main_axes, room_grid
from stopgo.planner.geometry.shapes import GRID, local_origin
from stopgo.planner.routing.paths import Paths, shortest_paths
from stopgo.planner.routing.roadmap import anchors_of, on_crossings, outward_corners
from stopgo.planner.space.local_shapes import drive_area_of, room_shapes
from stopgo.planner.space.opening_joins import middle_and_normal

RESOLUTIONS = (1.0, 0.5, 0.25, 0.125, 0.0625)
"""Grid spacings in metres, from coarse to fine: the paper's first one, then ours."""
EXITS = (0.2, 0.4, 0.6, 0.8, 1.0)
"""Distances in metres from the middle of a door, straight ahead, from which its rooms' grids are searched."""
THIN = 0.35
"""Largest distance in metres between rooms that may adjoin without a wall."""
ACROSS = 1.5
"""Longest edge in metres from one room's grid to the next one's, a diagonal of the coarsest grid."""
NEIGHBOURS = 32
"""Nearest nodes among which the nearest reachable by a straight line is taken."""


def grid_paths(space: NavigableSpace, points: FloatArray) -> Paths:
    """Paths between all pairs of points (n, 2) over the coarsest grids that connect them.

    Raises
    ------
    NegativeResult
        If the finest grids do not connect the points.
    """
    for k in range(len(RESOLUTIONS)):
        paths = paths_on_grids(space, points, resolutions=RESOLUTIONS[k:])
        apart = ~np.isfinite(paths.lengths)
        if not apart.any():
            return paths
    x, y = points[int(np.argmax(apart.sum(axis=1)))]
    raise NegativeResult(
        f"{space.floor.name}: the grid of {RESOLUTIONS[-1]:g} m does not connect the stop at "
        f"({x:.3f}, {y:.3f}) with the others; use --graph exact"
    )


def paths_on_grids(space: NavigableSpace, points: FloatArray, *, resolutions: Sequence[float]) -> Paths:
    """Paths over grids of the first of `resolutions` that is fine enough for each room, else of the last."""
    origin = local_origin(space.floor)
    free, doors, net = _free(space), _doors(space), Net()
    ends, crossing = np.unique(space.gaps.reshape(-1, 2) - origin, axis=0, return_inverse=True)
    stop, gap = net.add(points - origin), net.add(ends)
    links = gap[crossing.reshape(-1, 2)]
    entry = _entries(space, net, stop, links)
    middle, exits = net.add(doors.middle), net.add(doors.exits)
    net.join(*links.T)
    net.join(middle[doors.door], exits)
    areas = room_shapes(space)
    grids = [_fine_grid(area, free, net.xy[entry], doors, space.settings, resolutions) for area in areas]
    node = [net.add(grid.xy) for grid in grids]
    for grid, number in zip(grids, node, strict=True):
        net.join(*number[grid.edges.T])
        net.join(exits[grid.exits[:, 0]], number[grid.exits[:, 1]])
    for k, m in _adjoining(areas):
        pairs = _across(grids[k].xy, grids[m].xy, areas[m], free)
        net.join(node[k][pairs[:, 0]], node[m][pairs[:, 1]])
    # paths that the finest grid misses pass gaps too narrow for any node: add the corners as nodes
    corner = net.add(outward_corners(space).xy if len(resolutions) == 1 else np.empty((0, 2)))
    joints = np.concatenate([gap, exits, corner, entry])
    net.join(*joints[_visible_pairs(net.xy[joints], free)].T)
    every = np.concatenate(node)
    for joint in (entry, gap, corner):
        pairs, _ = nearest_seen(net.xy[joint], net.xy[every], free)
        net.join(joint[pairs[:, 0]], every[pairs[:, 1]])
    return shortest_paths(net.xy + origin, net.edges, len(points))


class Net:
    """A growing graph: nodes in local coordinates, and the edges between them."""

    def __init__(self) -> None:
        self.xy: FloatArray = np.empty((0, 2))
        self.edges: IntArray = np.empty((0, 2), dtype=np.int64)

    def add(self, xy: FloatArray) -> IntArray:
        """Add nodes (n, 2) and return their numbers."""
        first = len(self.xy)
        self.xy = np.concatenate([self.xy, xy])
        return np.arange(first, len(self.xy))

    def join(self, start: IntArray, end: IntArray) -> None:
        """Add an edge from each node of `start` to that of `end`."""
        self.edges = np.concatenate([self.edges, np.stack([start, end], axis=1)])


def _entries(space: NavigableSpace, net: Net, stop: IntArray, links: IntArray) -> IntArray:
    """The node by which each stop enters the drive area: itself, or its anchor next to it.

    Stops in openings just as wide as the robot are joined with the ends of the crossing.
    """
    anchors, moved = anchors_of(space, net.xy[stop])
    entry = stop.copy()
    entry[moved] = net.add(anchors)
    net.join(stop, entry)
    crossing = on_crossings(net.xy[stop], net.xy, links)
    net.join(stop[crossing[:, 0]], crossing[:, 1])
    return entry


def _free(space: NavigableSpace) -> BaseGeometry:
    """The drive area in local coordinates with its edge, widened by the margin with which it was drawn."""
    free = drive_area_of(space).buffer(GRID, quad_segs=2)
    shapely.prepare(free)
    return free


@dataclass(frozen=True, eq=False)
class Doors:
    """Openings to drive through, local: lines straight across, from the middle of the free width."""

    middle: FloatArray
    """(d, 2)."""
    exits: FloatArray
    """Positions on both sides that a straight line reaches (e, 2)."""
    door: IntArray
    """Door of each exit (e,)."""


def _doors(space: NavigableSpace) -> Doors:
    """The doors of a floor, without openings just as wide as the robot, which have gap crossings."""
    free, origin = _free(space), local_origin(space.floor)
    lines = [shapely.LineString(item.opening.line - origin) for item in space.openings if item.passable]
    found = [middle_and_normal(piece) for line in lines if (piece := _widest(line, free)).length > GRID]
    middle = np.array([m for m, _ in found]).reshape(-1, 1, 2)
    across = np.array([n for _, n in found]).reshape(-1, 1, 2)
    ends = middle + np.array([*EXITS, *(-step for step in EXITS)])[:, None] * across
    open_ = shapely.covers(
        free, shapely.linestrings(np.stack([np.broadcast_to(middle, ends.shape), ends], 2))
    )
    return Doors(middle[:, 0], ends[open_], np.nonzero(open_)[0])


def _widest(line: BaseGeometry, free: BaseGeometry) -> BaseGeometry:
    """The longest piece of an opening's line that the robot's centre may cross."""
    pieces = shapely.get_parts(line.intersection(free))
    return max(pieces, key=shapely.length, default=shapely.LineString())


@dataclass(frozen=True, eq=False)
class RoomGrid:
    """The grid of one room, local."""

    xy: FloatArray
    """Nodes (n, 2)."""
    edges: IntArray
    """Pairs of nodes (m, 2)."""
    exits: IntArray
    """Pairs of a door's exit and its node (k, 2)."""


def _fine_grid(
    room: BaseGeometry,
    free: BaseGeometry,
    stops: FloatArray,
    doors: Doors,
    settings: Settings,
    resolutions: Sequence[float],
) -> RoomGrid:
    """The coarsest grid of a room that is dense enough, and near enough to its stops and doors."""
    inside = room.intersection(free)
    shapely.prepare(inside)
    mine = stops[shapely.intersects_xy(inside, *stops.T)]
    exits = np.flatnonzero(shapely.intersects_xy(inside, *doors.exits.T))
    for spacing in resolutions:
        xy, edges = _lattice(room, inside, free, spacing=spacing)
        exits_to, _ = nearest_seen(doors.exits[exits], xy, free)
        stops_to, away = nearest_seen(mine, xy, free)
        near = len(stops_to) == len(mine) and bool(np.all(away <= settings.max_err_dist))
        joined = set(doors.door[exits[exits_to[:, 0]]]) == set(doors.door[exits])
        used = np.concatenate([stops_to[:, 1], exits_to[:, 1]])
        dense = len(xy) >= settings.den_grid_min * inside.area
        if near and joined and dense and _connects(xy, edges, used, inside):
            break
    return RoomGrid(xy, edges, np.column_stack([exits[exits_to[:, 0]], exits_to[:, 1]]))


def _connects(xy: FloatArray, edges: IntArray, used: IntArray, inside: BaseGeometry) -> bool:
    """True if the grid connects all used nodes that lie in the same piece of the room."""
    links = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(xy), len(xy)))
    label = connected_components(links, directed=False)[1][used]
    held = shapely.intersects(shapely.points(xy[used])[:, None], shapely.get_parts(inside)[None, :])
    piece = np.argmax(held, axis=1)
    return len(set(zip(piece, label, strict=True))) == len(set(piece))


def _lattice(
    room: BaseGeometry, inside: BaseGeometry, free: BaseGeometry, *, spacing: float
) -> tuple[FloatArray, IntArray]:
    """Reachable nodes (n, 2) of a room's grid, and pairs of neighbours (m, 2), diagonals included."""
    if inside.is_empty:
        return np.empty((0, 2)), np.empty((0, 2), dtype=np.int64)
    xy = room_grid(room, spacing=spacing)
    along = (xy - xy[0]) @ main_axes(room)[0]
    number = np.arange(len(xy)).reshape(-1, int((np.abs(along) < GRID).sum()))
    steps = (
        (number[:-1], number[1:]),
        (number[:, :-1], number[:, 1:]),
        (number[:-1, :-1], number[1:, 1:]),
        (number[1:, :-1], number[:-1, 1:]),
    )
    pairs = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in steps])
    kept = shapely.intersects_xy(inside, *xy.T)
    pairs = pairs[kept[pairs].all(axis=1)]
    pairs = pairs[shapely.covers(free, shapely.linestrings(xy[pairs]))]
    return xy[kept], (np.cumsum(kept) - 1)[pairs]


def _adjoining(rooms: list[BaseGeometry]) -> list[tuple[int, int]]:
    """Pairs of rooms with no thick wall between them, the lower first."""
    pairs = shapely.STRtree(rooms).query(rooms, predicate="dwithin", distance=THIN)
    return sorted((int(k), int(m)) for k, m in pairs.T if k < m)


def _across(here: FloatArray, there: FloatArray, room: BaseGeometry, free: BaseGeometry) -> IntArray:
    """Pairs of nodes (k, 2) of a grid and the next room's grid, without a wall between them."""
    near = np.flatnonzero(shapely.dwithin(shapely.points(here), room, ACROSS))
    pairs, away = nearest_seen(here[near], there, free)
    pairs = pairs[away <= ACROSS]
    return np.column_stack([near[pairs[:, 0]], pairs[:, 1]])


def _visible_pairs(xy: FloatArray, free: BaseGeometry) -> IntArray:
    """Pairs (m, 2) of points that a short straight line joins: pockets between gaps may contain no node."""
    from scipy.spatial import KDTree

    pairs = KDTree(xy).query_pairs(ACROSS, output_type="ndarray") if len(xy) else np.empty((0, 2), np.int64)
    lines = shapely.linestrings(xy[pairs]) if len(pairs) else np.empty(0, dtype=object)
    return pairs[shapely.covers(free, lines)].astype(np.int64)


def nearest_seen(xy: FloatArray, nodes: FloatArray, free: BaseGeometry) -> tuple[IntArray, FloatArray]:
    """The nearest node that a straight line reaches: pairs (k, 2) of point and node, and the distance."""
    from scipy.spatial import KDTree

    if not len(xy) or not len(nodes):
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    away, node = KDTree(nodes).query(xy, k=np.arange(1, min(NEIGHBOURS, len(nodes)) + 1))
    lines = shapely.linestrings(
        np.stack([np.broadcast_to(xy[:, None], nodes[node].shape), nodes[node]], axis=2)
    )
    seen = shapely.covers(free, lines) | (away < GRID)
    first = np.argmax(seen, axis=1)
    point = np.flatnonzero(seen.any(axis=1))
    return np.stack([point, node[point, first[point]]], axis=1), away[point, first[point]]
