"""Triangulation candidates: middles of Delaunay triangles and Voronoi points of each room (paper, 3.2.2).

Seeds are what the drawing gives: without rooms the floor's contour and the columns' centres, with rooms
each room's contour, the corners of its elements and the centres of round ones.
"""

from __future__ import annotations

import numpy as np
import shapely
from scipy.spatial import Delaunay, QhullError, Voronoi, cKDTree
from shapely.geometry.base import BaseGeometry

from mission.floor import Element
from mission.geometry import FloatArray, IntArray, Polygon
from mission.planning import KEPT, SLIVER, TOO_SMALL, NavigableSpace
from mission.settings import Settings
from planner.candidates.grid import main_axes
from planner.candidates.place import Place
from planner.shapes import GRID, one_shape, polygon_parts

LEAST_ANGLE = float(np.arcsin(1 / 6))
"""alpha_min: sin alpha_min = l_min / (6 l_min) (paper, Eq. 2), 9.594 degrees whatever l_min is."""
SAME = 0.01
"""Seeds and candidates closer than this (m) are one."""
ROUNDS = 4
"""How often a room that is not dense enough is triangulated again."""


def triangulation(space: NavigableSpace) -> tuple[FloatArray, IntArray, IntArray]:
    """Candidates of every room, those of small and sliver triangles with that reason."""
    place = Place(space)
    per_room = [room_candidates(place, room) for room in range(len(space.rooms))]
    xy = np.concatenate([np.empty((0, 2)), *(points for points, _ in per_room)]) + place.origin
    reason = np.concatenate([np.empty(0, np.int64), *(early for _, early in per_room)])
    room = np.repeat(np.arange(len(per_room)), [len(points) for points, _ in per_room])
    return xy, room.astype(np.int64), reason.astype(np.int64)


def room_candidates(place: Place, room: int) -> tuple[FloatArray, IntArray]:
    """Candidates (n, 2) of one room in the local frame, and the reason each is dropped for early.

    While fewer than dens_min candidates per m² are left, the candidates so far are seeds too.
    """
    settings, shape = place.space.settings, place.rooms[room]
    seeds = seeds_of(place, room)
    points, early = triangulated(seeds, shape, l_min=settings.l_min)
    left = _left(place, room, points, early)
    for _ in range(ROUNDS):
        if not len(left) or len(left) >= settings.dens_min * shape.area:
            break
        seeds = np.concatenate([seeds, points[early == KEPT]])
        finer = triangulated(seeds, shape, l_min=settings.l_min)
        now = _left(place, room, *finer)
        if len(now) <= len(left):
            break
        (points, early), left = finer, now
    return points, early
