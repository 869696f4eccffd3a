"""Where in its list a vehicle must go on so that it follows the way that was planned, and no other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stopgo.mission.document import Point
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.steps import Observation, passed_by
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot
from stopgo.mission.run.states import Run

PASSED = frozenset({"corner", "stop", "return"})
"""Roles of waypoints."""
ON_WAY_M = 0.5
"""A vehicle this near to the line between two waypoints is on its way: autopilots cut corners and sway."""


@dataclass(frozen=True)
class Piece:
    """The straight way to a waypoint of the list."""

    start: Point
    end: Point
    place: int
    """Of the waypoint at its end."""

    def nearest(self, pose: Pose) -> Point:
        """The point of the piece that is nearest to the pose."""
        return foot(self.start, self.end, (pose.x, pose.y))

    def away(self, pose: Pose) -> float:
        """Metres from the pose to that point."""
        return math.dist((pose.x, pose.y), self.nearest(pose))


def resume_place(run: Run, listed: ListedMission, observed: Observation, pose: Pose) -> int:
    """The item with which the run goes on, as a place in the list.

    The vehicle's own, if that is on the way from the last stop that was reached, and the vehicle too; else
    the end of the piece of that way on which the robot stands, the first of equals: nothing is cut short.
    At a stop whose scan was broken off that is the stop's waypoint.
    """
    pieces = way(run, listed)
    beyond = passed_by(run, listed, observed)
    if beyond is not None or keeps(run, listed, observed.place):
        return observed.place if beyond is None else beyond
    for piece in pieces:
        if piece.place == observed.place and piece.away(pose) <= ON_WAY_M:
            return observed.place
    if not pieces:
        return observed.place
    return min(pieces, key=lambda piece: (round(piece.away(pose), 2), piece.place)).place


def keeps(run: Run, listed: ListedMission, place: int) -> bool:
    """Whether the vehicle is in the middle of a stop's waits, and rightly so."""
    for index, items in enumerate(listed.stops):
        if items.at < place < items.after:
            behind = index < run.at and items.stop in run.done
            return behind or (index == run.at and run.stop_state in ("SCANNING", "VERIFYING"))
    return False


def way(run: Run, listed: ListedMission) -> tuple[Piece, ...]:
    """The pieces from the last stop that was reached to the one that is worked on, or of the way back."""
    mission = listed.mission
    stops = len(listed.stops)
    first = min(run.leg, run.at, stops - 1)
    begin = listed.stops[first].first
    end = listed.stops[run.at].at + 1 if run.at < stops else listed.end
    at = mission.stops[first].approach[0]
    pieces: list[Piece] = []
    for place in range(begin, end):
        if listed.sent.placed[place].role in PASSED:
            to = point_of(listed, place)
            pieces.append(Piece(at, to, place))
            at = to
    return tuple(pieces)


def point_of(listed: ListedMission, place: int) -> Point:
    """Where a waypoint of the list is, metres in the site's frame."""
    item = listed.sent.placed[place].item
    return point_at(listed.sent, item.x, item.y)
