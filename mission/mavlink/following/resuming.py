"""Item with which a vehicle must go on, so that it drives the planned route and no other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stopgo.mission.document import Point
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.steps import Observation, after_skipped
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot
from stopgo.mission.run.states import Run

WAYPOINTS = frozenset({"corner", "stop", "return"})
"""Roles of waypoints."""
ON_LINE_M = 0.5
"""Largest distance of a vehicle on a line between two waypoints: autopilots cut corners and sway."""


@dataclass(frozen=True)
class RouteLine:
    """The straight line to a waypoint of the list."""

    start: Point
    end: Point
    place: int
    """Index of the waypoint at its end."""

    def nearest(self, pose: Pose) -> Point:
        """Return the point of the line nearest to the pose."""
        return foot(self.start, self.end, (pose.x, pose.y))

    def away(self, pose: Pose) -> float:
        """Return the distance in metres from the pose to that point."""
        return math.dist((pose.x, pose.y), self.nearest(pose))


def resume_place(run: Run, listed: ListedMission, observed: Observation, pose: Pose) -> int:
    """Return the item with which the run goes on, as an index in the list.

    It is the vehicle's current item, if item and vehicle are on the route from the last reached stop. Else it
    is the end of the nearest line of that route, the first of equals: nothing is cut short. At a stop with an
    interrupted scan it is the stop's waypoint.
    """
    lines = route_lines(run, listed)
    beyond = after_skipped(run, listed, observed)
    if beyond is not None or is_waiting(run, listed, observed.place):
        return observed.place if beyond is None else beyond
    for line in lines:
        if line.place == observed.place and line.away(pose) <= ON_LINE_M:
            return observed.place
    if not lines:
        return observed.place
    return min(lines, key=lambda line: (round(line.away(pose), 2), line.place)).place


def is_waiting(run: Run, listed: ListedMission, place: int) -> bool:
    """Return True if the vehicle is rightly in the middle of a stop's waits."""
    for index, items in enumerate(listed.stops):
        if items.at < place < items.after:
            behind = index < run.at and items.stop in run.done
            return behind or (index == run.at and run.stop_state in ("SCANNING", "VERIFYING"))
    return False


def route_lines(run: Run, listed: ListedMission) -> tuple[RouteLine, ...]:
    """Return the lines from the last reached stop to the current one, or of the return leg."""
    mission = listed.mission
    stops = len(listed.stops)
    first = min(run.leg, run.at, stops - 1)
    begin = listed.stops[first].first
    end = listed.stops[run.at].at + 1 if run.at < stops else listed.end
    at = mission.stops[first].approach[0]
    lines: list[RouteLine] = []
    for place in range(begin, end):
        if listed.sent.placed[place].role in WAYPOINTS:
            to = point_of(listed, place)
            lines.append(RouteLine(at, to, place))
            at = to
    return tuple(lines)


def point_of(listed: ListedMission, place: int) -> Point:
    """Return the position of a waypoint of the list, metres in the site's frame."""
    item = listed.sent.placed[place].item
    return point_at(listed.sent, item.x, item.y)
