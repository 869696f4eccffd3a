"""Route of a mission as successive poses: the start, corners, stops, and the return leg."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import msgspec

from stopgo.mission.document import Frame, Mission, Point, Stop
from stopgo.mission.frames.transform import Transform


@dataclass(frozen=True)
class Waypoint:
    """A pose on the route: a stop, or a corner (`stop` is None)."""

    x: float
    y: float
    heading: float
    """At a stop its heading, elsewhere the direction in which the robot drives on; radians within ±π."""
    leg: str
    """Id of the stop that the leg leads to, or `return`."""
    stop: Stop | None = None

    @property
    def xy(self) -> Point:
        return (self.x, self.y)


def way(mission: Mission) -> tuple[Waypoint, ...]:
    """Return the poses of the route in the order of driving; without the start if it is the first stop."""
    poses: list[Waypoint] = []
    for number, stop in enumerate(mission.stops):
        leg = _distinct(stop.approach)
        poses += _passed(leg if number == 0 else leg[1:], leg=stop.id)
        poses.append(Waypoint(stop.x, stop.y, math.remainder(stop.heading, math.tau), leg=stop.id, stop=stop))
    back = _distinct(mission.return_ or ())
    if len(back) > 1:
        end = math.atan2(back[-1][1] - back[-2][1], back[-1][0] - back[-2][0])
        poses += _passed(back[1:], leg="return")
        poses.append(Waypoint(*back[-1], end, leg="return"))
    return tuple(poses)


def _distinct(leg: Sequence[Point]) -> list[Point]:
    """Return a polyline without repeated points."""
    return [point for number, point in enumerate(leg) if number == 0 or point != leg[number - 1]]


def _passed(points: Sequence[Point], *, leg: str) -> Iterator[Waypoint]:
    """All points of a polyline but its last."""
    for (x, y), (x1, y1) in pairwise(points):
        yield Waypoint(x, y, math.atan2(y1 - y, x1 - x), leg=leg)


def frame_name(mission: Mission) -> str:
    """The frame of `mapped`: the robot's map where the mission says how to get there, else the site's."""
    return mission.frame.name if mission.frame.to_map is None else "map"


def mapped(mission: Mission) -> Mission:
    """Return the mission with all its positions on the robot's map (`frame.to_map` applied)."""
    to_map = mission.frame.to_map
    if to_map is None:
        return mission
    x, y = to_map.point((mission.start.x, mission.start.y))
    start = msgspec.structs.replace(
        mission.start, x=x, y=y, heading=_turned_heading(to_map, mission.start.heading)
    )
    return msgspec.structs.replace(
        mission,
        frame=Frame(name="map"),
        start=start,
        stops=tuple(_turned_stop(to_map, stop) for stop in mission.stops),
        return_=None if mission.return_ is None else _turned_leg(to_map, mission.return_),
    )


def _turned_stop(to_map: Transform, stop: Stop) -> Stop:
    x, y = to_map.point((stop.x, stop.y))
    heading = _turned_heading(to_map, stop.heading)
    return msgspec.structs.replace(
        stop, x=x, y=y, heading=heading, approach=_turned_leg(to_map, stop.approach)
    )


def _turned_leg(to_map: Transform, leg: Sequence[Point]) -> tuple[Point, ...]:
    return tuple(to_map.point(point) for point in leg)


def _turned_heading(to_map: Transform, heading: float) -> float:
    return math.remainder(heading + to_map.heading, math.tau)
