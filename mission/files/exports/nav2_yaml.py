"""Waypoints file of Nav2's RViz panel ("save WPs"): each stop with the leg to it.

The panel reads `pose` and `orientation` of every waypoint and ignores other keys: `approach` and `return`
are for programs that let Nav2 follow the mission's legs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from stopgo.mission.console.table import printable
from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.waypoints import frame_name, mapped
from stopgo.mission.frames.transform import SAME

_NUMBER = r"(-?\d+\.\d+)"
_POSE = re.compile(rf"^    pose: \[{_NUMBER}, {_NUMBER}, {_NUMBER}\]$", re.MULTILINE)


def write(mission: Mission, supplements: Supplements) -> bytes:
    """Return one waypoint per stop, on the robot's map, and the return leg."""
    there = mapped(mission)
    lines = [*_head(mission), "waypoints:"]
    for number, stop in enumerate(there.stops):
        lines += _waypoint(number, stop)
    if there.return_ is not None:
        lines.append(f"return: {_polyline(there.return_)}")
    return ("\n".join(lines) + "\n").encode()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """Return the positions of the poses, back in the site's frame."""
    to_map = mission.frame.to_map or SAME
    places = [(float(x), float(y)) for x, y, _ in _POSE.findall(data.decode())]
    return [to_map.back(place) for place in places]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the notes on differences between Nav2's behaviour and the mission."""
    way = (
        "Nav2's panel plans its own path between the waypoints; the mission's legs are their 'approach', "
        "for a program that sends them to Nav2's FollowPath"
    )
    return (way, *unmapped(mission))


def unmapped(mission: Mission) -> tuple[str, ...]:
    """Return a note that the poses are the drawing's, if the mission has no transform to the map."""
    if mission.frame.to_map is not None:
        return ()
    return (
        f"poses are in the frame '{frame_name(mission)}', the drawing's metres; "
        "say where it lies on the robot's map with --map X,Y,HEADING",
    )


def _head(mission: Mission) -> list[str]:
    name = printable(mission.name)
    frame = frame_name(mission)
    which = (
        "the robot's map" if frame == "map" else f"the site '{printable(frame)}', not transformed to a map"
    )
    return [
        f"# Scan stops of mission {name}, id {mission.id} revision {mission.revision}",
        f"# Frame: {which}; metres; orientation is w, x, y, z",
        "# approach: corners of the leg from the stop before, or the start, to the waypoint, both included",
    ]


def _waypoint(number: int, stop: Stop) -> list[str]:
    w, z = math.cos(stop.heading / 2), math.sin(stop.heading / 2)
    return [
        f"  waypoint{number}:  # {printable(stop.id)}",
        f"    pose: [{stop.x + 0.0:.6f}, {stop.y + 0.0:.6f}, 0.0]",
        f"    orientation: [{w + 0.0:.9f}, 0.0, 0.0, {z + 0.0:.9f}]",
        f"    approach: {_polyline(stop.approach)}",
    ]


def _polyline(points: Sequence[Point]) -> str:
    return f"[{', '.join(f'[{x + 0.0:.6f}, {y + 0.0:.6f}]' for x, y in points)}]"
