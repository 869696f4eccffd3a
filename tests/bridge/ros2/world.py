"""A robot with Nav2 and a scanner in simulated time, without ROS: what the servers do, and what goes wrong.

The world knows the robot's true motion. tf and odometry are reported from it, with the faults of the trial.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import msgspec

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.motion import Brake, Motion, along
from stopgo.bridge.ros2.ros_base import RosBase
from stopgo.bridge.ros2.ros_port import GoalStatus
from stopgo.bridge.ros2.ros_scanner import RosScanner
from stopgo.bridge.ros2.ros_settings import RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.frames.transform import SAME, Transform
from stopgo.mission.run.events import Pose
from tests.bridge.world import Field

TICK_S = 0.05
SPEED, TURN_RATE, ACCELERATION = 0.5, 1.0, 0.5
SCAN_S = 3.0


class Killed(BaseException):
    """The program is gone, this instant."""


@dataclass
class FakeGoal:
    world: World
    motion: Callable[[Pose], Motion]
    status: GoalStatus = "sent"
    detail: str = ""
    name: str = ""
    dropped: bool = False
    answered: bool = True

    def drop(self) -> None:
        self.dropped = True
        if self.status == "active":
            self.world.cancel(self)


@dataclass
class FakeCall:
    fields: Mapping[str, Any] | None = None
    error: str = ""

    def drop(self) -> None:
        """A service cannot be cancelled."""


@dataclass
class Scanning:
    """A scan, with what the robot really did meanwhile."""

    label: str
    began: Pose
    begin_s: float
    moved_m: float = 0.0
    driven_by_us: bool = False
    over: bool = False


@dataclass
class World:
    """The robot, its servers and its scanner; `RosPort` for the program under test."""

    clock: SimulatedClock = field(default_factory=SimulatedClock)
    at: Pose = field(default_factory=lambda: Pose(x=0.0, y=0.0, heading=0.0))
    correction: Transform = SAME
    """map -> odom, as the localisation has it."""
    scan_kinds: list[Literal["late", "twice", "never", "fails", ""]] = field(default_factory=list)
    scan_s: float = SCAN_S
    near: float = 0.0
    """Distance before its end at which the server reports success."""

    def __post_init__(self) -> None:
        self.telemetry: RosTelemetry | None = None
        self.goals: list[FakeGoal] = []
        self.ways: list[tuple[float, float]] = []
        """Ends of the goals that let Nav2 find its own way."""
        self.scans: list[Scanning] = []
        self.files = 0
        self.servers = True
        self.silent: set[str] = set()
        self.killed = False
        self.odometry_offset_s = 0.0
        self.odometry_jump = 0.0
        self.second_publisher = 0.0
        self._later: list[tuple[float, Callable[[], None]]] = []
        self._driven: tuple[Motion, float, FakeGoal | None] = (Motion(self.at), 0.0, None)
        self._began_ns = self.clock.now_ns()
        self._ticks = 0
        self.clock.at(TICK_S, self._tick)

    # Time

    @property
    def now_s(self) -> float:
        return (self.clock.now_ns() - self._began_ns) / 1e9

    def later(self, seconds: float, happens: Callable[[], None]) -> None:
        self._later.append((self.now_s + seconds, happens))

    def _tick(self) -> None:
        self.clock.at(TICK_S, self._tick)
        self._ticks += 1
        self._move()
        due = [happens for when, happens in self._later if when <= self.now_s]
        self._later = [(when, happens) for when, happens in self._later if when > self.now_s]
        for happens in due:
            happens()
        self._tell()
        if self.killed:
            self.killed = False
            raise Killed

    def _move(self) -> None:
        motion, began_s, goal = self._driven
        before, (self.at, self.speed) = self.at, motion.at(self.now_s - began_s)
        step = math.dist((before.x, before.y), (self.at.x, self.at.y))
        turned = abs(math.remainder(self.at.heading - before.heading, math.tau))
        self.turn_rate = turned / TICK_S
        for scan in self.scans:
            if not scan.over:
                scan.moved_m += step
                scan.driven_by_us |= step > 1e-9 and goal is not None and not goal.name
        ends = motion.duration - (self.near / SPEED if goal is not None and not goal.name else 0.0)
        if goal is not None and goal.status == "active" and self.now_s - began_s >= ends:
            self._driven = (Motion(self.at), self.now_s, goal)
            if goal.answered:
                goal.status = "succeeded"

    speed = 0.0
    turn_rate = 0.0

    def _tell(self) -> None:
        told, now_ns = self.telemetry, self.clock.now_ns()
        if told is None:
            return
        if "tf" not in self.silent:
            second = self.second_publisher * (self._ticks % 2)
            correction = msgspec.structs.replace(self.correction, y=self.correction.y + second)
            base = Transform(x=self.at.x + self.odometry_jump, y=self.at.y, heading=self.at.heading)
            told.take_transform("map", "odom", correction, stamp_ns=now_ns)
            told.take_transform("odom", "base_link", base, stamp_ns=now_ns)
        if "odometry" not in self.silent:
            stamp_ns = now_ns - round(self.odometry_offset_s * 1e9)
            told.take_odometry(self.speed, self.turn_rate, stamp_ns=stamp_ns, behind_s=self.odometry_offset_s)

    # Nav2

    def missing(self, what: Literal["drive", "navigate", "spin", "scan"]) -> str:
        if what == "navigate" and not self.navigates:
            return "no action server navigate_to_pose"
        return "" if self.servers or what == "scan" else "no action server follow_path"

    def follow(self, path: Sequence[Pose]) -> FakeGoal:
        ends = [(path[0].x, path[0].y), (path[-1].x, path[-1].y)]
        heading = path[-1].heading
        return self._send(lambda at: _motion(self._true(at), [self._odom(end) for end in ends[1:]], heading))

    navigates = True
    detour_m = 1.0

    def navigate(self, end: Pose) -> FakeGoal:
        """Nav2's own way leads past a place beside the straight one."""
        middle = (0.5 * (self.at.x + end.x), 0.5 * (self.at.y + end.y) + self.detour_m)
        path = [self._odom(middle), self._odom((end.x, end.y))]
        self.ways.append((end.x, end.y))
        return self._send(lambda at: _motion(at, path, end.heading))

    def spin(self, angle: float) -> FakeGoal:
        return self._send(lambda at: _motion(at, [], at.heading + angle))

    def _true(self, at: Pose) -> Pose:
        return at

    def _odom(self, point: tuple[float, float]) -> tuple[float, float]:
        """The place where the robot believes a point of the map to be."""
        return self.correction.back(point)

    def _send(self, motion: Callable[[Pose], Motion], name: str = "") -> FakeGoal:
        goal = FakeGoal(self, motion, name=name)
        self.goals.append(goal)
        self.later(TICK_S, lambda: self._accept(goal))
        return goal

    def _accept(self, goal: FakeGoal) -> None:
        if not self.servers:
            return
        for other in self.goals:
            if other.status == "active":
                other.status = self.preempted
        goal.status = "active"
        self._driven = (goal.motion(self.at), self.now_s, goal)
        if goal.dropped:
            self.cancel(goal)

    preempted: GoalStatus = "aborted"
    """What the server reports of a goal that another one has replaced."""

    def end(self, status: GoalStatus, detail: str = "") -> None:
        """End the goal that drives the robot."""
        for goal in self.goals:
            if goal.status == "active":
                goal.status, goal.detail = status, detail
        self.brake()

    def brake(self) -> None:
        goal = self._driven[2]
        self._driven = (Motion(self.at, (Brake(self.at, self.speed, 1.0),)), self.now_s, goal)

    def cancel(self, goal: FakeGoal) -> None:
        goal.status = "canceled"
        self.brake()

    def foreign_goals(self) -> tuple[str, ...]:
        return tuple(goal.name for goal in self.goals if goal.name and goal.status == "active")

    def foreign(self, x: float, y: float) -> FakeGoal:
        """Another client drives the robot to a place."""
        return self._send(lambda at: _motion(at, [(x, y)], None), name="goal f00d of navigate_to_pose")

    def stand(self) -> None:
        if self.servers:
            for goal in self.goals:
                if goal.status in ("sent", "active"):
                    goal.drop()
        self.brake()

    def restart_servers(self, gone_s: float) -> None:
        """The servers go, and come back without the goals that they had."""
        self.servers = False
        for goal in self.goals:
            if goal.status == "active":
                goal.answered = False
                goal.status = "aborted" if goal.name else "active"  # nobody tells us of ours
        self.brake()
        self.later(gone_s, lambda: setattr(self, "servers", True))

    def found_instead(self) -> str:
        return "topics of type nav_msgs/msg/Odometry: none"

    # The scanner

    def trigger(self, request: Mapping[str, Any]) -> FakeCall:
        call, kind = FakeCall(), self.scan_kinds.pop(0) if self.scan_kinds else ""
        if any(not scan.over for scan in self.scans):
            call.fields = {"success": False, "message": "busy"}
            return call
        scan = Scanning(str(request.get("label", "")), self.at, self.now_s)
        assert self.speed < 0.001, f"triggered at {self.speed} m/s"
        self.scans.append(scan)
        took_s = {"late": 14.0}.get(kind, self.scan_s)
        self.later(took_s, lambda: self._end_scan(scan, call, kind))
        return call

    def _end_scan(self, scan: Scanning, call: FakeCall, kind: str) -> None:
        scan.over = True
        if kind == "never":
            return
        self.files += kind != "twice" or self.files == 0
        body = {
            "file": f"{self.files}.e57", "size": 1000, "points": 10,
            "sha256": hashlib.sha256(str(self.files).encode()).hexdigest(),
        }  # fmt: skip
        message = msgspec.json.encode(body).decode()
        call.fields = {"success": kind != "fails", "message": message if kind != "fails" else "no laser"}


def _motion(at: Pose, path: list[tuple[float, float]], heading: float | None) -> Motion:
    return along(at, path, heading, speed=SPEED, turn_rate=TURN_RATE, acceleration=ACCELERATION)


@dataclass
class RosField(Field):
    """A robot's program on a `World`; a boot leaves the world as it is."""

    world: World = field(default_factory=World)
    settings: RosSettings = field(default_factory=RosSettings)

    def __post_init__(self) -> None:
        self.clock = self.world.clock
        super().__post_init__()

    def boot(self) -> None:
        told = RosTelemetry(self.clock, self.settings.frames, self.settings.limits)
        self.world.telemetry = told
        scanner = RosScanner(self.world, told, clock=self.clock, settings=self.settings.scan)
        base = RosBase(self.world, told, clock=self.clock, settings=self.settings, scanner=scanner)
        self.clock.wait(4 * TICK_S)
        self.controller = Controller(
            robot="r1", journal=self.journal, base=base, scanner=scanner, clock=self.clock,
            mission_taken=lambda mission: base.take(mission, SAME),
        )  # fmt: skip
        self.inbox = Inbox(self.journal, self.controller, scanner.profiles)
