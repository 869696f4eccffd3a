"""`stopgo robot`: the robot's end, with a base and scanner that are simulated or an autopilot's."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    Insecure,
    KeyFolder,
    SigningKey,
    SiteName,
    alone,
    given_in,
)
from bridge.console import say
from mission.errors import InputError

if TYPE_CHECKING:
    from bridge.mavlink.driving.mavlink_scanner import ScanTrigger
    from mission.document import Transform
    from mission.events import Pose
    from mission.run.revision import RevisionPolicy


def robot(
    context: typer.Context,
    *,
    name: Annotated[str | None, typer.Option("--name", help="Name of this robot.")] = None,
    state: Annotated[
        Path | None,
        typer.Option("--state", metavar="DIR", help="Its journal, or a vehicle's items; one per robot."),
    ] = None,
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = DEFAULT_ENDPOINT,
    connect: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="A router to connect to, instead of listening.")
    ] = None,
    site: SiteName = None,
    speed_up: Annotated[
        float, typer.Option("--speed-up", min=0.01, max=1000, help="How much faster simulated time runs.")
    ] = 1.0,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y,HEADING", help="Where it stands (m, degrees); else at the start."),
    ] = None,
    map_: Annotated[
        str | None,
        typer.Option("--map", metavar="X,Y,HEADING", help="Site to map: turn by HEADING, then shift."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@N[=AMOUNT]", help="Let something go wrong, as slip@2=0.2."),
    ] = None,
    endurance: Annotated[
        float,
        typer.Option(metavar="HOURS", min=0, help="How long a full battery lasts; 0: it does not run down."),
    ] = 6.0,
    revision: Annotated[
        str, typer.Option(metavar="next-stop|refuse", help="What becomes of a revision pushed during a run.")
    ] = "next-stop",
    insecure: Insecure = False,
    keys: KeyFolder = None,
    mavlink_vehicle: Annotated[
        str | None,
        typer.Option(
            "--mavlink-vehicle", metavar="URL", help="Be a MAVLink vehicle there, and nothing else."
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option(
            metavar="strict|ardupilot|px4",
            help="The autopilot whose habits the vehicle has; strict if not given.",
        ),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON,ALT[,HEADING]", help="The vehicle's global origin from the start."),
    ] = None,
    signing_key: SigningKey = None,
    controller: Annotated[
        str, typer.Option(metavar="sim|mavlink:URL", help="What carries the scanner: an autopilot at URL.")
    ] = "sim",
    arm: Annotated[bool, typer.Option("--arm", help="Arm the autopilot when a run needs it.")] = False,
    trigger: Annotated[
        str, typer.Option(metavar="camera|script", help="What makes the autopilot's scanner scan.")
    ] = "camera",
    vehicle: Annotated[
        int | None, typer.Option(metavar="ID", help="The autopilot's system id, if several are heard.")
    ] = None,
) -> None:
    """Be a robot, with a simulated base and scanner or those of an autopilot, until SIGTERM.

    Example: stopgo robot --name r1 --listen tcp/127.0.0.1:7447 --state r1.state --speed-up 20

    Example: stopgo robot --name r1 --state r1.state --controller mavlink:serial:/dev/ttyAMA0:921600

    Example: stopgo robot --mavlink-vehicle udpin:127.0.0.1:14550 --profile ardupilot --origin 47.4,8.5,400
    """
    from bridge.mavlink.driving.autopilot_body import AutopilotBody, autopilot_url
    from bridge.robot.bodies import OpenBody, SimulatedBody
    from bridge.robot.program import RobotOptions, run_robot
    from bridge.robot.simulator import Faults, read_fault

    given, driven = given_in(context), ("--arm", "--trigger", "--vehicle")
    if mavlink_vehicle is not None:
        alone(
            given, "--mavlink-vehicle", "--listen", "--connect", "--site", "--map", "--keys", "--revision",
            "--endurance", "--controller", *driven,
        )  # fmt: skip
        return be_vehicle(
            name, url=mavlink_vehicle, profile=profile or "strict", state=state, speed_up=speed_up,
            signing_key=signing_key, insecure=insecure, origin=origin,
            at=None if at is None else read_pose("--at", at), faults=tuple(fault or ()),
        )  # fmt: skip
    alone(given, "a robot on zenoh", "--profile", "--origin")
    if connect is not None:
        alone(given, "--connect", "--listen")
    if name is None or state is None:
        raise InputError("robot: give it a --name and a folder for its --state")
    faults, to_map = Faults(tuple(read_fault(text) for text in fault or ())), read_map(map_)
    url = autopilot_url(controller)
    if url is None:
        alone(given, "a simulated robot", "--signing-key", *driven)
        body: OpenBody = SimulatedBody(
            state, None if at is None else read_pose("--at", at), to_map, 3600 * endurance, faults
        )
    else:
        alone(given, "an autopilot", "--at", "--map", "--fault", "--speed-up", "--endurance")
        body = AutopilotBody(url, arm, read_trigger(trigger), signing_key, vehicle, insecure)
    options = RobotOptions(
        name=name, listen=listen, connect=connect, state=state, body=body, site=site, speed_up=speed_up,
        to_map=to_map, insecure=insecure, revisions=read_revisions(revision), keys=keys, faults=faults,
    )  # fmt: skip
    where = f"listens on {listen}" if connect is None else f"connects to {connect}"
    run_robot(options, ready=lambda: say(f"ready {name} {where}"))


def be_vehicle(name: str | None, **options: Any) -> None:
    """Be a MAVLink vehicle until SIGTERM."""
    from bridge.mavlink.simulated.vehicle_process import VehicleOptions, run_vehicle

    called = f"{name or 'vehicle'} ({options['profile']})"
    run_vehicle(VehicleOptions(**options), ready=lambda url: say(f"ready {called} at {url}"))


def read_revisions(text: str) -> RevisionPolicy:
    """What a robot does with a revision that is pushed during a run."""
    from mission.run.revision import POLICIES

    if text not in POLICIES:
        raise InputError(f"--revision {text}: one of {', '.join(POLICIES)}")
    return POLICIES[text]


def read_trigger(text: str) -> ScanTrigger:
    """What makes an autopilot's scanner scan."""
    from bridge.mavlink.driving.mavlink_scanner import TRIGGERS

    known = next((trigger for trigger in TRIGGERS if trigger == text), None)
    if known is None:
        raise InputError(f"--trigger {text}: one of {', '.join(TRIGGERS)}")
    return known


def read_map(text: str | None) -> Transform | None:
    """Site to map, if it was told."""
    return None if text is None else read_transform("--map", text)


def read_transform(option: str, text: str) -> Transform:
    """A transform from X,Y,HEADING in metres and degrees."""
    from mission.document import Transform

    pose = read_pose(option, text)
    return Transform(x=pose.x, y=pose.y, heading=pose.heading)


def read_pose(option: str, text: str) -> Pose:
    """A pose from X,Y,HEADING in metres and degrees."""
    import math

    from mission.events import Pose

    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: write X,Y,HEADING in metres and degrees, as 1.5,2,90") from None
    if not all(map(math.isfinite, (x, y, heading))):
        raise InputError(f"{option} {text}: must be finite numbers")
    return Pose(x=x, y=y, heading=math.radians(heading))
