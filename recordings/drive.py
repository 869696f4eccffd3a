"""When the robot is planned to be where: a mission and its schedule as poses over mission time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mission.document import Mission
from mission.geometry import FloatArray, polyline_length

STEP_M = 0.5
"""Greatest distance between two poses of the planned drive."""


@dataclass(frozen=True, eq=False)
class Drive:
    """Poses (n, 3) of x, y, heading at seconds since the mission's start (n,)."""

    seconds: FloatArray
    poses: FloatArray


def planned_drive(mission: Mission, arrival_s: FloatArray) -> Drive:
    """The planned drive through all stops; `arrival_s` as `arrivals` or the schedule gives it."""
    rows = [(0.0, mission.start.x, mission.start.y, mission.start.heading)]
    leaving = 0.0
    for stop, arrival in zip(mission.stops, arrival_s, strict=True):
        rows += _along(np.array(stop.approach), leaving, float(arrival))
        rows.append((float(arrival), stop.x, stop.y, stop.heading))
        leaving = float(arrival) + stop.settle_s + stop.scan.duration_s
        rows.append((leaving, stop.x, stop.y, stop.heading))
    if mission.return_:
        way = np.array(mission.return_)
        rows += _along(way, leaving, leaving + polyline_length(way) / mission.robot.speed)
    table = np.array(rows)
    return Drive(table[:, 0], table[:, 1:])


def arrivals(mission: Mission, scheduled: FloatArray | None) -> FloatArray:
    """Arrival at each stop in seconds: as scheduled, else at full speed without turns."""
    if scheduled is not None and len(scheduled) == len(mission.stops):
        return scheduled
    drive = np.array(
        [polyline_length(np.array(stop.approach)) / mission.robot.speed for stop in mission.stops]
    )
    stay = np.array([stop.settle_s + stop.scan.duration_s for stop in mission.stops])
    return np.cumsum(drive + stay) - stay


def _along(way: FloatArray, start: float, end: float) -> list[tuple[float, float, float, float]]:
    """Poses along a polyline (n, 2), evenly from `start` to `end`, facing along it."""
    vectors = np.diff(way, axis=0)
    lengths = np.hypot(vectors[:, 0], vectors[:, 1])
    total = lengths.sum()
    if total == 0:
        return []
    rows, done = [], 0.0
    for a, vector, length in zip(way[:-1], vectors, lengths, strict=True):
        heading = float(np.arctan2(vector[1], vector[0]))
        for t in np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(length / STEP_M)))):
            seconds = start + (end - start) * (done + t * length) / total
            rows.append((float(seconds), *(a + t * vector).tolist(), heading))
        done += length
    return rows
