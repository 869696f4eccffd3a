"""Where in its list a vehicle must go on so that it follows the way that was planned, and no other."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bridge.mavlink.desk.progress import Sight, passed_by
from bridge.mavlink.desk.visits import Course
from mission.document import Point
from mission.events import Pose
from mission.mavlink.read_back import point_at
from mission.run.states import Run

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

    def away(self, pose: Pose) -> float:
        """Metres from the pose to the nearest point of the piece."""
        return math.dist((pose.x, pose.y), self.foot(pose))

    def foot(self, pose: Pose) -> Point:
        """That point."""
        dx, dy = self.end[0] - self.start[0], self.end[1] - self.start[1]
        square = dx * dx + dy * dy
        along = 0.0
        if square > 0:
            along = ((pose.x - self.start[0]) * dx + (pose.y - self.start[1]) * dy) / square
        along = min(1.0, max(0.0, along))
        return (self.start[0] + along * dx, self.start[1] + along * dy)


def onward(run: Run, course: Course, sight: Sight, pose: Pose) -> int:
    """The item with which the run goes on, as a place in the list.

    The vehicle's own, if that is on the way from the last stop that was reached, and the vehicle too; else
    the end of the piece of that way on which the robot stands, the first of equals: nothing is cut short.
    At a stop whose scan was broken off that is the stop's waypoint.
    """
    pieces = way(run, course)
    beyond = passed_by(run, course, sight)
    if beyond is not None or keeps(run, course, sight.place):
        return sight.place if beyond is None else beyond
    for piece in pieces:
        if piece.place == sight.place and piece.away(pose) <= ON_WAY_M:
            return sight.place
    if not pieces:
        return sight.place
    return min(pieces, key=lambda piece: (round(piece.away(pose), 2), piece.place)).place


def keeps(run: Run, course: Course, place: int) -> bool:
    """Whether the vehicle is in the middle of a stop's waits, and rightly so."""
    for index, visit in enumerate(course.visits):
        if visit.at < place < visit.after:
            behind = index < run.at and visit.stop in run.done
            return behind or (index == run.at and run.stop_state in ("SCANNING", "VERIFYING"))
    return False


def way(run: Run, course: Course) -> tuple[Piece, ...]:
    """The pieces from the last stop that was reached to the one that is worked on, or of the way back."""
    mission = course.mission
    stops = len(course.visits)
    first = min(run.leg, run.at, stops - 1)
    begin = course.visits[first].first
    end = course.visits[run.at].at + 1 if run.at < stops else course.end
    at = mission.stops[first].approach[0]
    pieces: list[Piece] = []
    for place in range(begin, end):
        if course.sent.placed[place].role in PASSED:
            to = point_of(course, place)
            pieces.append(Piece(at, to, place))
            at = to
    return tuple(pieces)


def point_of(course: Course, place: int) -> Point:
    """Where a waypoint of the list is, metres in the site's frame."""
    item = course.sent.placed[place].item
    return point_at(course.sent, item.x, item.y)
