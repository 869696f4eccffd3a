"""The commands that bring a mission to a robot or vehicle, fetch what a vehicle holds, or clear it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.bridge.commands.connection import (
    Connection,
    Insecure,
    SigningKey,
    StateFolder,
    Timeout,
    VehicleId,
    alone,
    reached,
    with_connection,
)
from stopgo.bridge.commands.order_commands import Json, TakeOver
from stopgo.bridge.console import Bar, carried_out, print_json, refusals_in, say, tell

if TYPE_CHECKING:
    from stopgo.bridge.link.protocol import Accepted
    from stopgo.mission.document import Mission
    from stopgo.mission.frames.transform import Transform

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
    from stopgo.mission.files.mission_json import read

    if connection.mavlink is None:
        alone(
            connection.given, "--robot", "--autopilot", "--trigger", "--scan-wait", "--settle",
            "--set-origin", "--any-origin", "--while-running",
        )  # fmt: skip
        return push_over_zenoh(read(mission), pushing(connection, patience), take_over=take_over, json_=json_)
    from stopgo.bridge.commands.vehicle_missions import Leave, Line, Writing, push_mission

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
    with carried_out(f"{robot}: the mission is stored"):
        _report_accepted(robot, document, accepted, json_)


def _report_accepted(robot: str, document: Mission, accepted: Accepted, json_: bool) -> None:
    if json_:
        print_json({"robot": robot, "mission_id": accepted.mission_id, "revision": accepted.revision,
                    "digest": accepted.digest, "already": accepted.already,
                    "waits": accepted.waits})  # fmt: skip
    else:
        how = "already held" if accepted.already else "accepted"
        when = "; followed from the next stop on" if accepted.waits else ""
        tell(f"{robot} {how} {document.name} ({document.id[:12]} revision {document.revision}){when}")


def pushing(connection: Connection, timeout_s: float | None) -> Connection:
    """The connection for a push, which takes as long as it takes: its timeout is that without an answer."""
    return connection if timeout_s is None else replace(connection, timeout_s=timeout_s, patience_s=timeout_s)


def turning(own: Transform | None, mission: Mission) -> str:
    """How the robot turns the mission onto its map, in words; empty if it does not."""
    to_map, whose = (own, "robot --map") if own else (mission.frame.to_map, "the mission's frame")
    if to_map is None:
        return ""
    turned = f"{math.degrees(to_map.heading):.2f}°, then shifted by ({to_map.x:.3f}, {to_map.y:.3f}) m"
    return f"on the robot's map, places are turned by {turned} ({whose})"


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
    from stopgo.bridge.commands.vehicle_missions import Line, fetch_mission

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
    from stopgo.bridge.commands.vehicle_missions import Line, clear_mission

    line = Line(mavlink, vehicle, signing_key, insecure, autopilot, timeout)
    with refusals_in(json_):
        clear_mission(line, state=state, while_running=while_running, as_json=json_)
