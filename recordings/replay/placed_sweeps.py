"""A log's laser scans in the mission's frame: those that were made while the robot stood."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from stopgo.mission.geometry import FloatArray
from stopgo.recordings.logs.field_log import Sweep
from stopgo.recordings.replay.fitting import turning
from stopgo.recordings.replay.replayed import Replay

BAND_M = 1.0
"""Points of a cloud that lie farther above or below the scanner than this are of floors and ceilings."""


def placed_sweeps(replay: Replay) -> Iterator[FloatArray]:
    """Points (n, 2) of each scan that was made during a halt; of all where the robot never halted."""
    offset = replay.placed.alignment.time_offset_ns
    mounts = {name: (x, y, heading) for name, x, y, heading in replay.log.mounts}
    for sweep in replay.log.sweeps():
        pose = _pose(replay, sweep.ns + offset)
        if pose is not None:
            yield _placed(sweep, mounts.get(sweep.frame, (0.0, 0.0, 0.0)), pose)


def _pose(replay: Replay, ns: int) -> tuple[float, float, float] | None:
    """Where the robot stood then: the middle pose of its halt, or of no halts at all the newest pose."""
    for match in replay.matches:
        halt = match.standing
        if halt.begin_ns <= ns <= halt.end_ns:
            return (halt.x, halt.y, halt.heading)
    if replay.matches:
        return None
    track = replay.run.poses
    index = track.last_until(ns)
    if index is None:
        return None
    x, y = track.xy[index].tolist()
    return (x, y, float(track.heading[index]))


def _placed(sweep: Sweep, mount: tuple[float, float, float], pose: tuple[float, float, float]) -> FloatArray:
    band = np.abs(sweep.xyz[:, 2]) <= BAND_M
    on_robot = sweep.xyz[band, :2] @ turning(mount[2]).T + mount[:2]
    placed: FloatArray = on_robot @ turning(pose[2]).T + pose[:2]
    return placed
