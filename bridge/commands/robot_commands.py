"""`stopgo robot`: the robot agent, with a simulated base and scanner, an autopilot's, or your own."""

from __future__ import annotations

import math
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    ArmInRun,
    AutopilotId,
    BatteryLife,
    ControllerKind,
    FaultsOfRobot,
    GuardedNode,
    GuardedRouter,
    Insecure,
    JournalFolder,
    KeyFolder,
    Listen,
    LogSize,
    OnRevision,
    OwnName,
    RequiredRosDomain,
    RosArguments,
    RouterEndpoint,
    ScannerTrigger,
    SetOriginOfAutopilot,
    SetTimeout,
    SigningKey,
    SimulatedPose,
    SiteName,
    SiteToMap,
    SpeedUp,
)
from stopgo.bridge.commands.connection import GivenOptions, given_options, refuse_options
from stopgo.bridge.console import say
from stopgo.bridge.robot.simulated_faults import RobotFaults, read_faults
from stopgo.mission.errors import InputError
from stopgo.mission.settings.parameter import seconds

if TYPE_CHECKING:
    from stopgo.bridge.mavlink.driving.mavlink_scanner import ScanTrigger
    from stopgo.bridge.robot.program import RobotOptions
    from stopgo.bridge.robot.robot_hardware import OpenBody
    from stopgo.mission.frames.transform import Transform
    from stopgo.mission.run.events import Pose
    from stopgo.mission.run.revision import RevisionPolicy

MAVLINK = "mavlink:"
"""Before the URL of an autopilot that is the controller."""
ROS2, ROS2_ZENOH = "ros2", "ros2-zenoh"
"""Controllers that speak ROS 2, by rclpy and over zenoh; after a colon the file of names."""
LONGEST_BATTERY_LIFE_S = 1e6
ONLY_SIMULATED = ("--at", "--map", "--fault", "--speed-up", "--battery-life")
ONLY_ROS = ("--ros-args",)
ONLY_DRIVEN = ("--arm", "--set-origin", "--set-timeout", "--trigger", "--vehicle", "--signing-key")
"""Options of `--controller sim`, and of `--controller mavlink:URL`; with the other one they are refused."""


def robot(
    context: typer.Context,
    *,
    name: OwnName,
    state: JournalFolder,
    listen: Listen = DEFAULT_ENDPOINT,
    connect: RouterEndpoint = None,
    site: SiteName = None,
    keys: KeyFolder = None,
    insecure: Insecure = False,
    revision: OnRevision = "next-stop",
    record: LogSize = 512,
    controller: ControllerKind = "sim",
    at: SimulatedPose = None,
    map_: SiteToMap = None,
    fault: FaultsOfRobot = None,
    speed_up: SpeedUp = 1.0,
    battery_life: BatteryLife = "6h",
    vehicle: AutopilotId = None,
    arm: ArmInRun = False,
    set_origin: SetOriginOfAutopilot = False,
    set_timeout: SetTimeout = False,
    trigger: ScannerTrigger = "camera",
    signing_key: SigningKey = None,
    ros_args: RosArguments = "",
) -> None:
    """Run the robot agent with a simulated base and scanner, an autopilot's, or ROS 2's, until SIGTERM.

    Example: stopgo robot --name r1 --listen tcp/127.0.0.1:7447 --state r1.state --controller ros2
    """
    from stopgo.bridge.robot.program import RobotOptions

    simulated = SimulatedOptions(at, read_map(map_), read_battery_life(battery_life), read_faults(fault))
    driven = AutopilotOptions(arm, set_origin, set_timeout, trigger, signing_key, vehicle, insecure)
    body = body_of(controller, state, given_options(context), simulated, driven, ros_args)
    run(RobotOptions(
        name, listen, state, body, connect=connect, site=site, speed_up=speed_up, to_map=simulated.to_map,
        insecure=insecure, keys=keys, revisions=read_revisions(revision), faults=simulated.faults, say=say,
        record_bytes=round(record * 1e6)), given_options(context))  # fmt: skip


def run(options: RobotOptions, given: GivenOptions) -> None:
    """Run the robot agent until SIGTERM."""
    from stopgo.bridge.robot.program import run_robot

    if options.connect is not None:
        refuse_options(given, "--connect", "--listen")
    where = f"listens on {options.listen}" if options.connect is None else f"connects to {options.connect}"
    run_robot(options, ready=lambda: say(f"ready {options.name} {where}"))


@dataclass(frozen=True)
class SimulatedOptions:
    """Options of a simulated base and scanner; a controller of one's own takes `to_map` too."""

    at: str | None
    to_map: Transform | None
    runtime_s: float
    """Runtime per battery charge."""
    faults: RobotFaults


@dataclass(frozen=True)
class AutopilotOptions:
    """Options of an autopilot as the controller."""

    arm: bool
    set_origin: bool
    set_timeout: bool
    trigger: str
    signing_key: Path | None
    vehicle: int | None
    insecure: bool


def body_of(
    controller: str,
    state: Path,
    given: GivenOptions,
    simulated: SimulatedOptions,
    driven: AutopilotOptions,
    ros_args: str,
) -> OpenBody:
    """Return the base and scanner of a kind of controller; raise `InputError` for options of another kind."""
    if controller.partition(":")[0] in (ROS2, ROS2_ZENOH):
        return ros_body_of(controller, given, simulated, ros_args)
    refuse_options(given, "a controller that is not ros2", *ONLY_ROS)
    if controller == "sim":
        from stopgo.bridge.robot.robot_hardware import SimulatedBody

        refuse_options(given, "a simulated robot", *ONLY_DRIVEN)
        at = None if simulated.at is None else read_pose("--at", simulated.at)
        return SimulatedBody(state, at, simulated.to_map, simulated.runtime_s, simulated.faults)
    if controller.startswith(MAVLINK):
        from stopgo.bridge.mavlink.driving.autopilot_body import AutopilotBody

        refuse_options(given, "an autopilot", *ONLY_SIMULATED)
        return AutopilotBody(
            controller.removeprefix(MAVLINK), driven.arm, read_trigger(driven.trigger), driven.signing_key,
            driven.vehicle, driven.insecure, set_origin=driven.set_origin, set_timeout=driven.set_timeout,
            guards=True,
        )  # fmt: skip
    from stopgo.bridge.robot.plugin_body import plugin_body

    others = tuple(option for option in ONLY_SIMULATED if option != "--map")
    refuse_options(given, "a controller of your own", *others, *ONLY_DRIVEN)
    return plugin_body(controller, state, simulated.to_map)


def ros_body_of(controller: str, given: GivenOptions, simulated: SimulatedOptions, ros_args: str) -> OpenBody:
    """Return the base and scanner of a robot that speaks ROS 2."""
    from stopgo.bridge.ros2.ros_body import RosBody
    from stopgo.bridge.ros2.ros_settings import read_ros_settings
    from stopgo.bridge.ros2.run_topics import RunTopics

    others = tuple(option for option in ONLY_SIMULATED if option != "--map")
    refuse_options(given, "ROS 2", *others, *ONLY_DRIVEN)
    kind, _, file = controller.partition(":")
    settings = read_ros_settings(Path(file) if file else None)
    if kind == ROS2_ZENOH:
        from stopgo.bridge.ros2.zenoh_robot import open_zenoh

        refuse_options(given, "ROS 2 over zenoh, whose names are in ros2.toml", *ONLY_ROS)
        return RosBody(settings, open_zenoh, RunTopics, simulated.to_map)
    from stopgo.bridge.ros2.rclpy_node import open_rclpy

    arguments = ("--ros-args", *shlex.split(ros_args)) if ros_args else ()
    return RosBody(settings, partial(open_rclpy, ros_args=arguments), RunTopics, simulated.to_map)


def guard(
    *, ros2: RequiredRosDomain, connect: GuardedRouter = DEFAULT_ENDPOINT, node: GuardedNode = "stopgo"
) -> None:
    """Guard a robot with ROS 2 over zenoh, on its computer, until SIGTERM: stop it if its link is cut.

    Example: stopgo guard --ros2 0/r1 --connect tcp/127.0.0.1:7447
    """
    from stopgo.bridge.robot.program import end_at_sigterm
    from stopgo.bridge.ros2.ros_zenoh import read_domain
    from stopgo.bridge.ros2.zenoh_robot import guard_at_robot

    domain, namespace = read_domain(ros2)
    if domain is None:
        raise InputError(f"--ros2 {ros2}: a guard needs rmw_zenoh; write DOMAIN or DOMAIN/NAMESPACE, as 0/r1")
    end_at_sigterm()
    guard_at_robot(connect, domain, namespace, node, say)


def read_revisions(text: str) -> RevisionPolicy:
    """Read the handling of a revision that is pushed during a run."""
    from stopgo.mission.run.revision import POLICIES

    if text not in POLICIES:
        raise InputError(f"--revision {text}: one of {', '.join(POLICIES)}")
    return POLICIES[text]


def read_trigger(text: str) -> ScanTrigger:
    """Read the trigger of an autopilot's scanner."""
    from stopgo.bridge.mavlink.driving.mavlink_scanner import TRIGGERS

    known = next((trigger for trigger in TRIGGERS if trigger == text), None)
    if known is None:
        raise InputError(f"--trigger {text}: one of {', '.join(TRIGGERS)}")
    return known


def read_battery_life(text: str) -> float:
    """Seconds of a battery's runtime, from `90min`, `6h` or a number of seconds."""
    try:
        found = seconds(text)
    except ValueError:
        found = math.nan
    if not 0 <= found <= LONGEST_BATTERY_LIFE_S:
        raise InputError(f"--battery-life {text}: write a duration, such as 90min or 6h")
    return found


def read_map(text: str | None) -> Transform | None:
    """Read the transform from the site frame to the map, if one was given."""
    from stopgo.mission.frames.transform import Transform

    if text is None:
        return None
    pose = read_pose("--map", text)
    return Transform(x=pose.x, y=pose.y, heading=pose.heading)


def read_pose(option: str, text: str) -> Pose:
    """Read a pose from X,Y,HEADING in metres and degrees."""
    from stopgo.mission.run.events import Pose

    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: write X,Y,HEADING in metres and degrees, as 1.5,2,90") from None
    if not all(map(math.isfinite, (x, y, heading))):
        raise InputError(f"{option} {text}: must be finite numbers")
    return Pose(x=x, y=y, heading=math.radians(heading))
