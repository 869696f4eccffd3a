"""Watching a robot in a ROS 2 network over zenoh: its run as its topics report it, until the run is over."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from stopgo.bridge.commands.ros_checks import listened, state_of
from stopgo.mission.errors import RobotUnreachable

if TYPE_CHECKING:
    from stopgo.bridge.ros2.ros_zenoh import RosListener

OVER = ("FINISHED", "ABORTED")
POLL_S, LOOKS_EVERY = 0.2, 10
"""Interval at which changes are looked for, and number of these after which the graph is read again."""
STEPS_A_METRE = 2
"""A robot without a state is shown again after half a metre."""

Show = Callable[[dict[str, Any]], None]


def watch_ros(text: str, endpoint: str, show: Show) -> str:
    """Show a robot's state at each change until its run is over; return the last state.

    Raises
    ------
    RobotUnreachable
        If there is no router, or nothing of the robot is published.
    """
    with listened(text, endpoint) as listener:
        return followed(listener, text, show)


def followed(listener: RosListener, text: str, show: Show, wait: Callable[[float], None] = time.sleep) -> str:
    """Show what a listener hears at each change until the run is over; return the last state."""
    if not listener.topics:
        raise RobotUnreachable(
            f"--ros2 {text}: nothing of this robot is published; stopgo doctor --ros2 {text} lists what is"
        )
    shown: tuple[object, ...] = ()
    polls = 0
    while True:
        found = state_of(listener, text)
        if (noted := _noted(found)) != shown:
            shown = noted
            show(found)
        if found["state"] in OVER:
            return str(found["state"])
        wait(POLL_S)
        polls += 1
        if polls % LOOKS_EVERY == 0:
            listener.look()


def _noted(found: dict[str, Any]) -> tuple[object, ...]:
    """Return what is worth another line when it changes."""
    pose, cell = found["pose"], None
    if found["state"] is None and pose is not None:
        cell = round(pose["x"] * STEPS_A_METRE), round(pose["y"] * STEPS_A_METRE)
    run = (found[key] for key in ("state", "run_id", "stop", "stop_state", "done_count"))
    return (*run, found["linked"], not found["silent"], *found["refused"], cell)
