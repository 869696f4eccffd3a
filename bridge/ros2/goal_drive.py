"""Driving one straight of a leg by one goal of Nav2's FollowPath, judged by the robot's own pose.

Where the mission's policy allows it, Nav2 finds its own way to a stop (NavigateToPose).

A result says little: a server that was preempted may report success, and one that restarts reports nothing.
So a drive has arrived only if the robot stands at its end. While it drives, the robot must stay near the
line, its pose must arrive, and nobody else may drive it; else it is stopped first.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Event
from typing import Literal

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Outcome
from stopgo.bridge.ros2.ros_port import RosGoal, RosPort
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot

LOOK_S = 0.05
ANSWER_S = 5.0
"""Longest wait for the server to accept a goal, and for the robot to stand after its end."""
GONE_S = 1.0
"""Time without a server after which its goals are lost."""
HALT_S = 5.0
STAND_AGAIN_S = 0.5
"""Interval at which a robot that does not stand yet is stopped again."""
TAKEN_S = 0.3
"""Time by which another client's goal may be known later than the end of ours that it caused."""
PROGRESS_M = 0.05
PROGRESS_RAD = math.radians(3.0)
TRIES = 4
"""Number of goals for one straight: each further one begins where the robot stands."""

Line = tuple[Point, Point] | None
"""The straight that the robot must stay near; `None` where it finds its own way."""


class RosDriveEnded(Exception):
    """A drive that cannot go on; the robot has been stopped."""

    def __init__(self, outcome: Outcome, why: str = "") -> None:
        super().__init__(why)
        self.outcome: Outcome = outcome
        self.why = why


def poses_along(a: Point, b: Point, spacing_m: float, end_heading: float | None) -> tuple[Pose, ...]:
    """Return poses on the straight from `a` to `b`, headed along it; the last one with `end_heading`."""
    length = math.dist(a, b)
    count = max(1, math.ceil(length / spacing_m))
    heading = math.atan2(b[1] - a[1], b[0] - a[0])
    shares = (index / count for index in range(count + 1))
    points = [(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])) for share in shares]
    headings = [heading] * count + [heading if end_heading is None else end_heading]
    return tuple(Pose(x=x, y=y, heading=turn) for (x, y), turn in zip(points, headings, strict=True))


class GoalDrive:
    """Drives by goals, one at a time."""

    def __init__(self, port: RosPort, telemetry: RosTelemetry, clock: Clock, settings: RosSettings) -> None:
        self._port = port
        self._telemetry = telemetry
        self._clock = clock
        self._settings = settings

    def straight(self, end: Point, end_heading: float | None, near_m: float, interrupt: Event) -> None:
        """Drive straight to `end`; raises `RosDriveEnded` if that cannot be done."""
        spacing_m = self._settings.drive.spacing_m

        def send(here: Point) -> RosGoal:
            return self._port.follow(poses_along(here, end, spacing_m, end_heading))

        self._until_near(send, (self._here(), end), end, (spacing_m / 2, near_m), interrupt)

    def navigate(self, end: Pose, near_m: float, interrupt: Event) -> None:
        """Let Nav2 find its own way to `end`; raises `RosDriveEnded` if the robot does not come near."""
        there = (end.x, end.y)
        self._until_near(lambda here: self._port.navigate(end), None, there, (near_m, near_m), interrupt)

    def _until_near(
        self,
        send: Callable[[Point], RosGoal],
        line: Line,
        end: Point,
        limits_m: tuple[float, float],
        interrupt: Event,
    ) -> None:
        """Send goals, each if `end` is farther than the first limit, until it is nearer than the second."""
        why, (at_m, near_m) = "", limits_m
        for _ in range(TRIES):
            here = self._here()
            if math.dist(here, end) > at_m:
                why = self._outcome(send(here), line, interrupt)
            away = math.dist(self._here(), end)
            if away <= near_m:
                return
            why = why or f"Nav2 reports success {away:.2f} m from the goal"
        raise RosDriveEnded("blocked", why)

    def turn(self, heading: float, within_rad: float, interrupt: Event) -> None:
        """Turn on the spot, as often as it takes."""
        for _ in range(TRIES):
            here = self._here()
            off = math.remainder(heading - self._telemetry.pose().heading, math.tau)
            if abs(off) <= within_rad:
                return
            self._outcome(self._port.spin(off), (here, here), interrupt)

    def _here(self) -> Point:
        pose = self._telemetry.pose()
        return (pose.x, pose.y)

    def _outcome(self, goal: RosGoal, line: Line, interrupt: Event) -> str:
        """Wait for the goal's end; return why it must be tried again, empty if it succeeded."""
        watch = _Watch(self._clock.now_ns(), self._telemetry.pose(), "drive" if line else "navigate")
        while True:
            if self._clock.wait(LOOK_S, interrupt):
                self.halt(goal)
                raise RosDriveEnded("interrupted")
            silent = self._telemetry.silence()
            if silent:
                return self._bridge_gap(goal, silent, line, interrupt)
            self._end_if(goal, self._wrong(line) or self._end_of_patience(goal, watch))
            if goal.status == "succeeded":
                self._stand_after(goal, interrupt)
                return ""
            if goal.status in ("aborted", "canceled", "rejected"):
                return self._ended_early(goal)

    def _wrong(self, line: Line) -> str:
        """Return why the robot must stop; empty if it may go on."""
        jump = self._telemetry.jump
        if jump is not None and jump.metres >= self._settings.limits.jump_m:
            self._telemetry.jump = None
            return f"{jump.words}; see where the robot is, then let it go on"
        here = self._here()
        off_m = math.dist(foot(*line, here), here) if line else 0.0
        if off_m > self._settings.limits.off_path_m:
            return f"the robot is {off_m:.2f} m off the path"
        return self._telemetry.unusable() or self._taken()

    def _taken(self) -> str:
        foreign = self._port.foreign_goals()
        return f"another client drives the robot ({foreign[0]})" if foreign else ""

    def _end_of_patience(self, goal: RosGoal, watch: _Watch) -> str:
        now_ns, limits = self._clock.now_ns(), self._settings.limits
        watch.look(now_ns, self._telemetry.pose(), server=not self._port.missing(watch.server))
        if goal.status == "sent" and watch.since_begin_s(now_ns) > ANSWER_S:
            return (
                f"Nav2 does not answer a goal within {ANSWER_S:g} s; it may drive,"
                " so every goal is cancelled and zero velocity commanded"
            )
        if watch.without_server_s(now_ns) > GONE_S:
            return "Nav2's action server is not available"
        if watch.without_progress_s(now_ns) > limits.stalled_s:
            return f"no progress for {limits.stalled_s:g} s"
        return ""

    def _ended_early(self, goal: RosGoal) -> str:
        """Return why an aborted goal is to be tried again; one that somebody has ended is not."""
        detail = f": {goal.detail}" if goal.detail else ""
        end_ns = self._clock.now_ns() + round(TAKEN_S * 1e9)
        while not (taken := self._taken()) and self._clock.now_ns() < end_ns:
            self._clock.wait(LOOK_S)
        self._end_if(goal, taken)
        if goal.status == "canceled":
            self._end_if(goal, "another client, or the guard of this program, has cancelled the goal")
        self.halt(goal)
        return f"Nav2 has {goal.status} the goal{detail}"

    def _stand_after(self, goal: RosGoal, interrupt: Event) -> None:
        """Wait until a robot whose goal has succeeded stands still."""
        end_ns = self._clock.now_ns() + round(ANSWER_S * 1e9)
        while not self._telemetry.still():
            if self._clock.wait(LOOK_S, interrupt):
                self.halt(goal)
                raise RosDriveEnded("interrupted")
            self._end_if(goal, self._taken())
            if self._clock.now_ns() > end_ns:
                self._end_if(goal, "the robot moves on after the end of its goal")

    def _bridge_gap(self, goal: RosGoal, silent: str, line: Line, interrupt: Event) -> str:
        """Stop, and wait until tf and odometry arrive again; return why the drive is to be tried again."""
        self.halt(goal)
        end_ns = self._clock.now_ns() + round(self._settings.limits.gap_s * 1e9)
        while self._telemetry.silence():
            if self._clock.wait(LOOK_S, interrupt):
                raise RosDriveEnded("interrupted")
            if self._clock.now_ns() > end_ns:
                raise RosDriveEnded("blocked", self._telemetry.silence())
        self._end_if(goal, self._wrong(line))
        return silent

    def _end_if(self, goal: RosGoal, why: str) -> None:
        if why:
            self.halt(goal)
            raise RosDriveEnded("blocked", why)

    def halt(self, goal: RosGoal) -> None:
        """Stop the robot, and wait until it stands and the goal is over, but not for long."""
        goal.drop()
        end_ns, again_ns = self._clock.now_ns() + round(HALT_S * 1e9), 0
        while self._clock.now_ns() < end_ns:
            if self._clock.now_ns() >= again_ns:
                self._port.stand()
                again_ns = self._clock.now_ns() + round(STAND_AGAIN_S * 1e9)
            self._clock.wait(LOOK_S)
            if self._telemetry.still() and goal.status not in ("sent", "active"):
                return


class _Watch:
    """Watches one goal: its begin, its server, and the robot's progress."""

    def __init__(self, now_ns: int, pose: Pose, server: Literal["drive", "navigate"]) -> None:
        self.server: Literal["drive", "navigate"] = server
        self._began_ns = self._server_ns = self._progress_ns = now_ns
        self._pose = pose

    def look(self, now_ns: int, pose: Pose, *, server: bool) -> None:
        if server:
            self._server_ns = now_ns
        turned = abs(math.remainder(pose.heading - self._pose.heading, math.tau))
        if math.dist((pose.x, pose.y), (self._pose.x, self._pose.y)) > PROGRESS_M or turned > PROGRESS_RAD:
            self._pose, self._progress_ns = pose, now_ns

    def since_begin_s(self, now_ns: int) -> float:
        return (now_ns - self._began_ns) / 1e9

    def without_server_s(self, now_ns: int) -> float:
        return (now_ns - self._server_ns) / 1e9

    def without_progress_s(self, now_ns: int) -> float:
        return (now_ns - self._progress_ns) / 1e9
