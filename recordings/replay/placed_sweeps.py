"""Laser scans of a log in the mission's frame, made while the robot was stationary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stopgo.mission.frames.transform import SAME, Transform
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.logs.field_log import Sweep
from stopgo.recordings.replay.replayed import Replay

BAND_M = 1.0
"""Height in metres from the scanner beyond which points are of floors and ceilings."""


def placed_sweeps(replay: Replay) -> Iterator[FloatArray]:
    """Yield points (n, 2) of each scan made during a standstill; of all scans if there is no standstill.

    Nobody knows which way the scanner of a log without headings was turned: it yields none.
    """
    if not replay.placed.turns:
        return
    offset = replay.placed.alignment.time_offset_ns
    mounts = {name: Transform(x=x, y=y, heading=heading) for name, x, y, heading in replay.log.mounts}
    for sweep in replay.log.sweeps():
        pose = _pose(replay, sweep.ns + offset)
        if pose is not None:
            yield _placed(sweep, mounts.get(sweep.frame, SAME), pose)


def _pose(replay: Replay, ns: int) -> Transform | None:
    """Return the robot's pose: the median of the standstill, or without standstills the newest pose."""
    for match in replay.matches:
        standstill = match.standstill
        if standstill.begin_ns <= ns <= standstill.end_ns:
            return Transform(x=standstill.x, y=standstill.y, heading=standstill.heading)
    if replay.matches:
        return None
    track = replay.run.poses
    index = track.last_until(ns)
    if index is None:
        return None
    x, y = track.xy[index].tolist()
    return Transform(x=x, y=y, heading=float(track.heading[index]))


def _placed(sweep: Sweep, mount: Transform, pose: Transform) -> FloatArray:
    band = np.abs(sweep.xyz[:, 2]) <= BAND_M
    return pose.after(mount).points(sweep.xyz[band, :2])
