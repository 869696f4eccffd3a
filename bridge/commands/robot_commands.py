"""`stopgo robot`: the robot's end, with a base and scanner that are simulated or an autopilot's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    Insecure,
    KeyFolder,
    SigningKey,
    SiteName,
    alone,
    given_in,
)
from stopgo.bridge.console import say
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.bridge.mavlink.driving.mavlink_scanner import ScanTrigger
    from stopgo.mission.frames.transform import Transform
    from stopgo.mission.run.events import Pose
    from stopgo.mission.run.revision import RevisionPolicy

MAVLINK = "mavlink:"
"""Before the URL of an autopilot that is the controller."""
ONLY_SIMULATED = ("--at", "--map", "--fault", "--speed-up", "--endurance")
ONLY_DRIVEN = ("--arm", "--trigger", "--vehicle", "--signing-key")
"""Options of `--controller sim`, and of `--controller mavlink:URL`; with the other one they are refused."""


def robot(
    context: typer.Context,
    *,
    name: Annotated[str, typer.Option("--name", help="Name of this robot.")],
    state: Annotated[Path, typer.Option("--state", metavar="DIR", help="Its journal; one per robot.")],
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = DEFAULT_ENDPOINT,
    connect: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="A router to connect to, instead of listening.")
    ] = None,
    site: SiteName = None,
    keys: KeyFolder = None,
    insecure: Insecure = False,
    revision: Annotated[
        str, typer.Option(metavar="next-stop|refuse", help="What becomes of a revision pushed during a run.")
    ] = "next-stop",
    record: Annotated[
        float, typer.Option(metavar="MB", min=1, help="How much of its disk the record of its runs may take.")
    ] = 512,
    controller: Annotated[
        str,
        typer.Option(
            metavar="sim|mavlink:URL|MODULE:FUNCTION",
            help="What carries the scanner: numbers, an autopilot, or a base and scanner of your own.",
        ),
    ] = "sim",
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y,HEADING", help="sim: where it stands; else at the start."),
    ] = None,
    map_: Annotated[
        str | None,
        typer.Option("--map", metavar="X,Y,HEADING", help="sim: site to map; turn by HEADING, then shift."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@N[=AMOUNT]", help="sim: what is to go wrong, as slip@2=0.2."),
    ] = None,
    speed_up: Annotated[
        float, typer.Option("--speed-up", min=0.01, max=1000, help="sim: how much faster its time runs.")
    ] = 1.0,
    endurance: Annotated[
        float,
        typer.Option(
            metavar="HOURS", min=0, help="sim: how long a full battery lasts; 0: it does not run down."
        ),
    ] = 6.0,
    vehicle: Annotated[
        int | None, typer.Option(metavar="ID", help="mavlink: the system id, if several are heard.")
    ] = None,
    arm: Annotated[bool, typer.Option("--arm", help="mavlink: arm it when a run needs that.")] = False,
    trigger: Annotated[
        str, typer.Option(metavar="camera|script", help="mavlink: what makes the scanner scan.")
    ] = "camera",
    signing_key: SigningKey = None,
) -> None:
    """Be a robot, with a simulated base and scanner or those of an autopilot, until SIGTERM.

    Example: stopgo robot --name r1 --listen tcp/127.0.0.1:7447 --state r1.state --speed-up 20

    Example: stopgo robot --name r1 --state r1.state --controller mavlink:serial:/dev/ttyAMA0:921600
    """
    from stopgo.bridge.robot.program import RobotOptions, run_robot
    from stopgo.bridge.robot.robot_hardware import OpenBody, SimulatedBody
    from stopgo.bridge.robot.simulator import Faults, read_fault

    given = given_in(context)
    if connect is not None:
        alone(given, "--connect", "--listen")
    faults, to_map = Faults(tuple(read_fault(text) for text in fault or ())), read_map(map_)
    if controller == "sim":
        alone(given, "a simulated robot", *ONLY_DRIVEN)
        body: OpenBody = SimulatedBody(
            state, None if at is None else read_pose("--at", at), to_map, 3600 * endurance, faults
        )
    elif controller.startswith(MAVLINK):
        from stopgo.bridge.mavlink.driving.autopilot_body import AutopilotBody

        alone(given, "an autopilot", *ONLY_SIMULATED)
        url = controller.removeprefix(MAVLINK)
        body = AutopilotBody(url, arm, read_trigger(trigger), signing_key, vehicle, insecure)
    else:
        from stopgo.bridge.robot.plugin_body import plugin_body

        others = tuple(option for option in ONLY_SIMULATED if option != "--map")
        alone(given, "a controller of your own", *others, *ONLY_DRIVEN)
        body = plugin_body(controller, state, to_map)
    options = RobotOptions(
        name=name, listen=listen, connect=connect, state=state, body=body, site=site, speed_up=speed_up,
        to_map=to_map, insecure=insecure, revisions=read_revisions(revision), keys=keys, faults=faults,
        say=say, record_bytes=round(record * 1e6),
    )  # fmt: skip
    where = f"listens on {listen}" if connect is None else f"connects to {connect}"
    run_robot(options, ready=lambda: say(f"ready {name} {where}"))


def read_revisions(text: str) -> RevisionPolicy:
    """What a robot does with a revision that is pushed during a run."""
    from stopgo.mission.run.revision import POLICIES

    if text not in POLICIES:
        raise InputError(f"--revision {text}: one of {', '.join(POLICIES)}")
    return POLICIES[text]


def read_trigger(text: str) -> ScanTrigger:
    """What makes an autopilot's scanner scan."""
    from stopgo.bridge.mavlink.driving.mavlink_scanner import TRIGGERS

    known = next((trigger for trigger in TRIGGERS if trigger == text), None)
    if known is None:
        raise InputError(f"--trigger {text}: one of {', '.join(TRIGGERS)}")
    return known


def read_map(text: str | None) -> Transform | None:
    """Site to map, if it was told."""
    return None if text is None else read_transform("--map", text)


def read_transform(option: str, text: str) -> Transform:
    """A transform from X,Y,HEADING in metres and degrees."""
    from stopgo.mission.frames.transform import Transform

    pose = read_pose(option, text)
    return Transform(x=pose.x, y=pose.y, heading=pose.heading)


def read_pose(option: str, text: str) -> Pose:
    """A pose from X,Y,HEADING in metres and degrees."""
    import math

    from stopgo.mission.run.events import Pose

    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: write X,Y,HEADING in metres and degrees, as 1.5,2,90") from None
    if not all(map(math.isfinite, (x, y, heading))):
        raise InputError(f"{option} {text}: must be finite numbers")
    return Pose(x=x, y=y, heading=math.radians(heading))
