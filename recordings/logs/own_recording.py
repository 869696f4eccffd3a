"""Reader of a run's recording (field.rrd) as a log: the newest run in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.recordings.embedded.reading import read_recording
from stopgo.recordings.logs.field_log import FieldLog, Reading, poses_of
from stopgo.recordings.logs.own import SITE, own_log, poses_of_events


def read_run_recording(path: Path, reading: Reading) -> FieldLog:
    """Read a recording to its end.

    Raises
    ------
    InputError
        When it cannot be read, or contains no run.
    """
    recording = read_recording(path)
    if not recording.logs:
        raise InputError(f"{path}: contains no run; give the recording of a run")
    run = recording.logs[-1]
    track = run.poses
    about: dict[str, Any] = {"robot": run.robot, "restarts_ns": track.restarts_ns}
    poses = (
        poses_of("robot", SITE, track.ns, track.xy, track.heading, own_clock=True, **about)
        if len(track)
        else None
    )
    stationary = poses_of_events(run.events)
    return own_log(path, "stopgo recording", run.events, recording.missions, poses, stationary)
