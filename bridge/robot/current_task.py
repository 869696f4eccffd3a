"""The piece of work that a robot is at: whether there is one, and whether what was begun still counts."""

from __future__ import annotations

import math

from stopgo.bridge.robot.base import Rest
from stopgo.mission.document import Stop
from stopgo.mission.files.file_name import file_name
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Pose
from stopgo.mission.run.states import Run

FACING_RAD = math.radians(2)
"""A robot that is turned by more goes on turning; every base stands truer than this."""


def has_work(run: Run) -> bool:
    """A paused robot still ends the scan it was in."""
    if run.state == "PAUSED":
        return run.stop_state in ("SCANNING", "VERIFYING")
    return run.state in ("RUNNING", "HOMING")


def same_work(then: Run, now: Run) -> bool:
    """Whether what was begun in `then` still counts: nothing has changed, or the same scan goes on."""
    if now is then:
        return True
    if now.next_revision != then.next_revision:  # a revision that waits changes nothing of the present work
        return runs.changed(now, next_revision=then.next_revision) == then
    scanning = then.stop_state == now.stop_state == "SCANNING"
    return scanning and (then.run_id, then.at, then.attempt) == (now.run_id, now.at, now.attempt)


def moved(before: Pose, after: Pose, rest: Rest) -> bool:
    """Whether the robot moved by more than one that stands still seems to."""
    if math.hypot(after.x - before.x, after.y - before.y) > rest.metres:
        return True
    return abs(math.remainder(after.heading - before.heading, math.tau)) > rest.radians


def faces(pose: Pose, stop: Stop) -> bool:
    """Whether the robot has turned to the stop's heading; a pause may have ended its turn."""
    return abs(math.remainder(pose.heading - stop.heading, math.tau)) <= FACING_RAD


def label(run: Run, stop: Stop) -> str:
    """Names one scan, and no other, however often the stop is scanned."""
    return f"{run.run_id}-{file_name(stop.id)}-{run.scans}"
