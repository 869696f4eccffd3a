"""Mission + navigable space -> pairs of its network that do not register, counted line by line.

Every sight line to the boundary is held against every wall, as in `stopgo.planner.checking.claims`.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec
import numpy as np
import shapely

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.problems import Problem
from stopgo.mission.geometry import IntArray
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.geometry.shapes import GRID, local_origin, to_grid
from stopgo.planner.overlap import LEAST_COMMON_M, LEAST_HOLD_M
from stopgo.planner.overlap.boundary import Boundary, boundary_of, shown_by
from stopgo.planner.overlap.pairs import Overlaps
from stopgo.planner.visibility.exact_sight import sides_of_door
from stopgo.planner.visibility.sight.sightlines import Midpoints, sees

ROUNDED = 1e-5
"""Figures of a pair are sums of rounded lengths."""
LEAST = {"common_m": LEAST_COMMON_M, "hold_m": LEAST_HOLD_M}


def network_overclaims(mission: Mission, space: NavigableSpace) -> Iterator[Problem]:
    """Every pair of the mission's network that holds less firmly than it says, or not firmly enough."""
    if isinstance(mission.network, msgspec.UnsetType) or not mission.network:
        return
    overlaps = _overlaps(mission, space)
    row = {stop.id: k for k, stop in enumerate(mission.stops)}
    least = {**LEAST, "share": space.settings.least_overlap}
    for index, pair in enumerate(mission.network):
        pairs = overlaps.of(row[pair.a])
        at = np.flatnonzero(pairs.other == row[pair.b])
        for key, needed in least.items():
            counted = float(getattr(pairs, key)[at[0]]) if len(at) else 0.0
            path, claimed = f"$.network[{index}].{key}", getattr(pair, key)
            told = f"{pair.a} and {pair.b} have {counted:g}, counted line by line"
            if counted < claimed - ROUNDED:
                yield Problem(path, f"is {claimed:g}, but {told}")
            elif counted < needed - ROUNDED:
                yield Problem(path, f"is {claimed:g}: {told}; a pair that registers has {needed:g}")


def _overlaps(mission: Mission, space: NavigableSpace) -> Overlaps:
    """What each two stops see in common, rows in the order of the stops."""
    boundary, origin = boundary_of(space), local_origin(space.floor)
    xy = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2) - origin
    heading = np.array([stop.heading for stop in mission.stops])
    looking = _Looking(boundary, space)
    pieces = (looking.seen_by(stop) for stop in mission.stops)
    return Overlaps(shown_by(boundary, xy, pieces, heading, space.settings))


class _Looking:
    """A boundary, prepared for telling line by line what of it stops see."""

    def __init__(self, boundary: Boundary, space: NavigableSpace) -> None:
        a, b = to_grid(boundary.a), to_grid(boundary.b)
        self._space, self._edges = space, np.stack([a, b], axis=1)
        faces = np.ones(len(a), dtype=bool)
        self._midpoints = Midpoints.of(a, b, boundary.pieces, faces)
        self._reach = space.settings.farthest_overlap
        whole = self._midpoints.pieces[:, None]
        odd = self._midpoints.odd[:, None]
        middles = ((whole - odd) * self._midpoints.a + odd * self._midpoints.b) / whole * GRID
        self._points = shapely.STRtree(shapely.points(middles))
        self._lines = shapely.STRtree(shapely.linestrings(self._edges * GRID))

    def seen_by(self, stop: Stop) -> IntArray:
        """Pieces that a stop sees, looking all round; from both sides of a closed door that it stands in."""
        space, xy = self._space, np.array([stop.x, stop.y])
        closed_door = stop.doorway and space.settings.doors == "closed" and bool(space.openings)
        places = sides_of_door(space, xy) if closed_door else xy[None]
        views = [self._seen_from(to_grid(place - local_origin(space.floor))) for place in places]
        return np.unique(np.concatenate(views))

    def _seen_from(self, place: IntArray) -> IntArray:
        points, lines = (self._near(tree, place) for tree in (self._points, self._lines))
        reach = round(self._reach / GRID)
        return points[sees(place, self._midpoints.among(points), self._edges[lines], reach=reach)]

    def _near(self, tree: shapely.STRtree, place: IntArray) -> IntArray:
        near = tree.query(shapely.Point(place * GRID), predicate="dwithin", distance=self._reach + 4 * GRID)
        return np.sort(near)
