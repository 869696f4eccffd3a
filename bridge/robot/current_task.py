"""The robot's current work: if there is any, and if what was begun still belongs to the run."""

from __future__ import annotations

import math

from stopgo.bridge.robot.base import Rest
from stopgo.mission.document import Stop
from stopgo.mission.files.file_name import file_name
from stopgo.mission.run import states as runs
from stopgo.mission.run.events import Pose
from stopgo.mission.run.states import Run

FACING_RAD = math.radians(2)
"""Greatest heading error at which a robot does not turn further; every base is more exact than this."""


def has_work(run: Run) -> bool:
    """True if there is work; a paused robot still ends its scan."""
    if run.state == "PAUSED":
        return run.stop_state in ("SCANNING", "VERIFYING")
    return run.state in ("RUNNING", "HOMING")


def same_work(then: Run, now: Run) -> bool:
    """True if work of `then` still belongs to the run: nothing has changed, or the same scan continues."""
    if now is then:
        return True
    if now.next_revision != then.next_revision:  # a revision that waits does not change the current work
        return runs.changed(now, next_revision=then.next_revision) == then
    scanning = then.stop_state == now.stop_state == "SCANNING"
    return scanning and (then.run_id, then.at, then.attempt) == (now.run_id, now.at, now.attempt)


def moved(before: Pose, after: Pose, rest: Rest) -> bool:
    """True if two poses differ by more than those of a robot that stands still."""
    if math.hypot(after.x - before.x, after.y - before.y) > rest.metres:
        return True
    return abs(math.remainder(after.heading - before.heading, math.tau)) > rest.radians


def faces(pose: Pose, stop: Stop) -> bool:
    """True if the robot has the stop's heading; a pause may have ended its turn."""
    return abs(math.remainder(pose.heading - stop.heading, math.tau)) <= FACING_RAD


def label(run: Run, stop: Stop) -> str:
    """Return a name that only this scan has, however often the stop is scanned."""
    return f"{run.run_id}-{file_name(stop.id)}-{run.scans}"
