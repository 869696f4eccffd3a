"""The route of a mission, and the robot's position on it; no path is ever planned here.

Leg k leads to stop k; one more leg, if the mission has a return, leads back.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from stopgo.mission.document import Mission, Point
from stopgo.mission.run.events import Pose


@dataclass(frozen=True)
class NearestPoint:
    """The point of a polyline nearest to a pose."""

    point: Point
    segment: int
    distance: float


def legs_of(mission: Mission) -> tuple[tuple[Point, ...], ...]:
    """Return all legs in the order of driving, the return last."""
    legs = tuple(stop.approach for stop in mission.stops)
    return legs if mission.return_ is None else (*legs, mission.return_)


def nearest(leg: Sequence[Point], pose: Pose) -> NearestPoint:
    """Return the point of `leg` nearest to the robot; of equally near points the one farthest along."""
    here = (pose.x, pose.y)
    candidates = [NearestPoint(leg[0], 0, math.dist(leg[0], here))]
    for segment, (a, b) in enumerate(pairwise(leg)):
        point = foot(a, b, here)
        candidates.append(NearestPoint(point, segment, math.dist(point, here)))
    return min(reversed(candidates), key=lambda point: point.distance)


def forward(leg: Sequence[Point], pose: Pose, *, within_m: float) -> tuple[Point, ...]:
    """Return the points of `leg` that are still ahead; first its nearest point, if that is farther away."""
    here = nearest(leg, pose)
    return _from(here, tuple(leg[here.segment + 1 :]) or (leg[-1],), within_m)


def backward(leg: Sequence[Point], pose: Pose, *, within_m: float) -> tuple[Point, ...]:
    """Return the points of `leg` back to its beginning; first its nearest point, if that is farther away."""
    here = nearest(leg, pose)
    return _from(here, tuple(reversed(leg[: here.segment + 1])), within_m)


def _from(here: NearestPoint, path: tuple[Point, ...], within_m: float) -> tuple[Point, ...]:
    return path if here.distance <= within_m or here.point == path[0] else (here.point, *path)


def nearest_leg(mission: Mission, pose: Pose) -> tuple[int, NearestPoint]:
    """Return the leg to a stop that passes nearest to the robot, the first of equals.

    Legs within the stop's tolerance of the robot are equals: a robot at a stop is still on the leg to it.
    """
    candidates = [nearest(stop.approach, pose) for stop in mission.stops]
    offsets = zip((point.distance for point in candidates), mission.stops, strict=True)
    beyond = [max(0.0, offset_m - stop.tolerance_m) for offset_m, stop in offsets]
    leg = min(range(len(candidates)), key=lambda index: (beyond[index], index))
    return leg, candidates[leg]


def foot(a: Point, b: Point, p: Point) -> Point:
    """Return the point of the segment from `a` to `b` that is nearest to `p`."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    square = dx * dx + dy * dy
    fraction = 0.0 if square == 0 else ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / square
    fraction = max(0.0, min(1.0, fraction))
    return (a[0] + fraction * dx, a[1] + fraction * dy)
