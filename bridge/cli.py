"""The bridge's commands: each reads its options, calls one verb, and prints what it gave."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    Connection,
    Insecure,
    KeyFolder,
    SigningKey,
    SiteName,
    StateFolder,
    Timeout,
    VehicleId,
    alone,
    given_in,
    reached,
    with_connection,
)
from bridge.commands.key_commands import key_commands
from bridge.commands.order_commands import Json, TakeOver, add_orders, status_json
from bridge.commands.tunnel_commands import tunnel_commands
from bridge.console import Bar, print_json, refusals_in, say, tell
from mission.errors import InputError

if TYPE_CHECKING:
    from bridge.mavlink.driving.mavlink_scanner import ScanTrigger
    from bridge.station.watch import Recording
    from mission.document import Mission, Transform
    from mission.events import Pose
    from mission.run.revision import RevisionPolicy

PushTimeout = Annotated[
    float | None,
    typer.Option("--timeout", min=0.1, metavar="S", help="How long to go on without an answer, in seconds; "
                 "if not given, 5 to find the robot and 20 for each piece."),
]  # fmt: skip
NeededMavlink = Annotated[
    str,
    typer.Option(
        "--mavlink", metavar="URL", help="A vehicle, such as tcp:127.0.0.1:5760 or serial:/dev/ttyUSB0:57600."
    ),
]
AutopilotKind = Annotated[
    str | None,
    typer.Option(
        "--autopilot", metavar="ardupilot|px4|generic", help="Its kind, if not as its heartbeat says."
    ),
]
WhileRunning = Annotated[
    bool,
    typer.Option("--while-running", help="Though the vehicle follows its mission, or its run is not over."),
]


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command()(robot)
    app.command()(push)
    app.command("fetch-mission")(fetch_mission)
    app.command()(clear)
    add_orders(app)
    app.command()(watch)
    app.add_typer(key_commands(), name="keys")
    app.add_typer(tunnel_commands(), name="tunnel")


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


@with_connection(without=("timeout",))
def push(
    connection: Connection,
    *,
    mission: Annotated[Path, typer.Argument(metavar="MISSION.json", help="The mission to send.")],
    take_over: TakeOver = False,
    patience: PushTimeout = None,
    autopilot: AutopilotKind = None,
    trigger: Annotated[
        str | None, typer.Option(metavar="auto|script|camera|none", help="What makes the vehicle scan.")
    ] = None,
    scan_wait: Annotated[
        str | None,
        typer.Option(metavar="delay|script_time", help="Wait as long as planned, or for a script's word."),
    ] = None,
    settle: Annotated[
        str | None, typer.Option(metavar="delay|hold", help="Settle in an item of its own, or as a hold.")
    ] = None,
    set_origin: Annotated[
        bool, typer.Option("--set-origin", help="Give a vehicle without an origin the mission's.")
    ] = False,
    any_origin: Annotated[
        bool, typer.Option("--any-origin", help="Do not compare origins: it has satellite positions.")
    ] = False,
    while_running: WhileRunning = False,
    json_: Json = False,
) -> None:
    """Send a mission to a robot, and see it stored there whole, or rejected with the reasons.

    Example: stopgo push out/mission.json --robot r1 --connect tcp/127.0.0.1:7447

    Example: stopgo push out/mission.json --mavlink udpout:127.0.0.1:14550 --set-origin
    """
    from mission.files.mission_json import read

    if connection.mavlink is None:
        alone(
            connection.given, "--robot", "--autopilot", "--trigger", "--scan-wait", "--settle",
            "--set-origin", "--any-origin", "--while-running",
        )  # fmt: skip
        return push_over_zenoh(read(mission), pushing(connection, patience), take_over=take_over, json_=json_)
    from bridge.commands.vehicle_missions import Leave, Line, Writing, push_mission

    alone(connection.given, "--mavlink", "--take-over", "--as")
    vehicle = connection.mavlink
    line = Line(
        vehicle.url,
        vehicle.vehicle,
        vehicle.signing_key,
        connection.insecure,
        autopilot,
        patience or connection.timeout_s,
    )
    with refusals_in(json_):
        push_mission(
            read(mission), line, state=vehicle.state, as_json=json_,
            writing=Writing(trigger or "auto", scan_wait or "delay", settle or "delay"),
            leave=Leave(set_origin, any_origin, while_running),
        )  # fmt: skip


def push_over_zenoh(document: Mission, connection: Connection, *, take_over: bool, json_: bool) -> None:
    """Push to a robot of ours, and say what it did with the mission."""
    robot = connection.robot
    with refusals_in(json_), reached(connection) as station, Bar("pushing") as bar:
        told = turning(station.info().to_map, document)
        accepted = station.push(document, progress=bar.show, take_over=take_over)
    if told:
        say(told)
    if json_:
        print_json({"robot": robot, "mission_id": accepted.mission_id, "revision": accepted.revision,
                    "digest": accepted.digest, "already": accepted.already,
                    "waits": accepted.waits})  # fmt: skip
    else:
        how = "already held" if accepted.already else "accepted"
        when = "; followed from the next stop on" if accepted.waits else ""
        tell(f"{robot} {how} {document.name} ({document.id[:12]} revision {document.revision}){when}")


def fetch_mission(
    *,
    mavlink: NeededMavlink,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="FILE", help="Where to write it: *.json, *.plan, *.waypoints."),
    ] = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    autopilot: AutopilotKind = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Read the mission that a MAVLink vehicle holds, and show it or write it to a file.

    Example: stopgo fetch-mission --mavlink udpout:127.0.0.1:14550 -o held.plan
    """
    from bridge.commands.vehicle_missions import Line, fetch_mission

    line = Line(mavlink, vehicle, signing_key, insecure, autopilot, timeout)
    with refusals_in(json_):
        fetch_mission(line, out=out, as_json=json_)


def clear(
    *,
    mavlink: NeededMavlink,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    state: StateFolder = None,
    autopilot: AutopilotKind = None,
    while_running: WhileRunning = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Take the mission off a MAVLink vehicle, and see that it is gone.

    Example: stopgo clear --mavlink udpout:127.0.0.1:14550
    """
    from bridge.commands.vehicle_missions import Line, clear_mission

    line = Line(mavlink, vehicle, signing_key, insecure, autopilot, timeout)
    with refusals_in(json_):
        clear_mission(line, state=state, while_running=while_running, as_json=json_)


def turning(own: Transform | None, mission: Mission) -> str:
    """How the robot turns the mission onto its map, in words; empty if it does not."""
    import math

    to_map, whose = (own, "robot --map") if own else (mission.frame.to_map, "the mission's frame")
    if to_map is None:
        return ""
    turned = f"{math.degrees(to_map.heading):.2f}°, then shifted by ({to_map.x:.3f}, {to_map.y:.3f}) m"
    return f"on the robot's map, places are turned by {turned} ({whose})"


@with_connection(without=("who",))
def watch(
    connection: Connection,
    *,
    rrd: Annotated[
        Path | None, typer.Option("--rrd", metavar="FIELD.rrd", help="Record the run for Rerun.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open the viewer on what is recorded.")] = False,
    json_: Json = False,
) -> None:
    """Follow the robot's run until it ends, gaps filled from its journal; its end never touches the robot.

    Ends with 0 when the run finished, 1 when it was aborted, and 2 when it finished and its recording is
    incomplete, as on a full disk. While a vehicle is watched over MAVLink, what
    its mission says of a stop that failed is done by this command.

    Example: stopgo watch --robot r1 --rrd field.rrd

    Example: stopgo watch --mavlink udpout:127.0.0.1:14550 --rrd field.rrd
    """
    from bridge.station.watch import Lines, Table, watch_showing

    with (
        recording(rrd, view=view) as record,
        reached(connection.to_look(compares=True)) as station,
    ):
        state = watch_showing(station, record, Table() if sys.stderr.isatty() else Lines(say))
        if json_:
            print_json(status_json(state))
        if state.state != "FINISHED":  # which weighs more than what became of the recording
            raise typer.Exit(1)


def recording(path: Path | None, *, view: bool) -> AbstractContextManager[Recording | None]:
    """The field recording at `path`, looked at if wanted; nothing of Rerun is loaded without one."""
    if path is None and view:
        raise InputError("--view shows what is recorded: say where, with --rrd FIELD.rrd")
    if path is None:
        return nullcontext()
    from recordings.field import FieldRecording

    record = FieldRecording(path, say=say)
    if not view:
        return record
    from recordings.viewer import Viewed

    return Viewed(record)


def pushing(connection: Connection, timeout_s: float | None) -> Connection:
    """The connection for a push, which takes as long as it takes: its timeout is that without an answer."""
    return connection if timeout_s is None else replace(connection, timeout_s=timeout_s, patience_s=timeout_s)


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
