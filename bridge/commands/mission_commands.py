"""The commands `push`, `fetch-mission` and `clear`: missions to and from a robot or a vehicle."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from stopgo.bridge.commands.bridge_options import (
    AnyOrigin,
    AutopilotKind,
    FetchedFile,
    Insecure,
    ItemTrigger,
    Json,
    MissionToPush,
    PushTimeout,
    RequiredMavlinkUrl,
    ScanWaiting,
    SetOrigin,
    Settling,
    SigningKey,
    StateFolder,
    TakeOver,
    Timeout,
    VehicleId,
    WhileRunning,
)
from stopgo.bridge.commands.connection import (
    Connection,
    connection_of,
    reached,
    refuse_options,
    with_connection,
)
from stopgo.bridge.console import Bar, print_json, print_line, refusals_printed, reporting_done, say

if TYPE_CHECKING:
    from stopgo.bridge.link.protocol import Accepted
    from stopgo.mission.document import Mission
    from stopgo.mission.frames.transform import Transform

ONLY_VEHICLES = (
    "--autopilot", "--trigger", "--scan-wait", "--settle-item", "--set-origin", "--skip-origin-check",
    "--while-running",
)  # fmt: skip
"""Options of `push` that only concern a vehicle."""


@with_connection(without=("timeout",))
def push(
    connection: Connection,
    *,
    mission: MissionToPush,
    take_over: TakeOver = False,
    patience: PushTimeout = None,
    autopilot: AutopilotKind = None,
    trigger: ItemTrigger = None,
    scan_wait: ScanWaiting = None,
    settle: Settling = None,
    set_origin: SetOrigin = False,
    any_origin: AnyOrigin = False,
    while_running: WhileRunning = False,
    json_: Json = False,
) -> None:
    """Send a mission to a robot and verify that it is stored completely, or print why it was rejected.

    Example: stopgo push out/mission.json --robot r1 --connect tcp/127.0.0.1:7447

    Example: stopgo push out/mission.json --mavlink udpout:127.0.0.1:14550 --set-origin
    """
    from stopgo.bridge.commands.vehicle_missions import push_mission
    from stopgo.bridge.mavlink.auto.mission_push import PushConsent
    from stopgo.mission.files.exports.format import written_as
    from stopgo.mission.files.mission_json import read

    connection = pushing(connection, patience)
    if connection.mavlink is None:
        refuse_options(connection.given, "--robot", *ONLY_VEHICLES)
        return push_over_zenoh(read(mission), connection, take_over=take_over, json_=json_)
    refuse_options(connection.given, "--mavlink", "--take-over", "--as")
    words = {"autopilot": autopilot, "trigger": trigger, "scan-wait": scan_wait, "settle": settle}
    with refusals_printed(as_json=json_):
        push_mission(
            read(mission), connection, autopilot, state=connection.mavlink.state, as_json=json_,
            items=written_as(words),
            consent=PushConsent(set_origin, any_origin, while_running),
        )  # fmt: skip


def push_over_zenoh(document: Mission, connection: Connection, *, take_over: bool, json_: bool) -> None:
    """Push to a robot that runs stopgo, and print its answer."""
    robot = connection.robot
    with refusals_printed(as_json=json_), reached(connection) as station, Bar("pushing") as bar:
        transform_note = described_transform(station.info().to_map, document)
        accepted = station.push(document, progress=bar.show, take_over=take_over)
    if transform_note:
        say(transform_note)
    with reporting_done(f"{robot}: the mission is stored"):
        _report_accepted(robot, document, accepted, json_)


def _report_accepted(robot: str, document: Mission, accepted: Accepted, json_: bool) -> None:
    if json_:
        print_json({"robot": robot, "mission_id": accepted.mission_id, "revision": accepted.revision,
                    "digest": accepted.digest, "already": accepted.already,
                    "waits": accepted.waits})  # fmt: skip
    else:
        how = "already held" if accepted.already else "accepted"
        when = "; it takes effect from the next stop on" if accepted.waits else ""
        print_line(f"{robot} {how} {document.name} ({document.id[:12]} revision {document.revision}){when}")


def pushing(connection: Connection, timeout_s: float | None) -> Connection:
    """Return the connection for a push; its timeout limits each wait for an answer, not the whole push."""
    return connection if timeout_s is None else replace(connection, timeout_s=timeout_s, patience_s=timeout_s)


def described_transform(own: Transform | None, mission: Mission) -> str:
    """Describe the robot's transform of the mission onto its map; empty if there is none."""
    to_map, whose = (own, "robot --map") if own else (mission.frame.to_map, "the mission's frame")
    if to_map is None:
        return ""
    values = f"{math.degrees(to_map.heading):.2f}°, then shifted by ({to_map.x:.3f}, {to_map.y:.3f}) m"
    return f"on the robot's map, positions are rotated by {values} ({whose})"


def fetch_mission(
    *,
    mavlink: RequiredMavlinkUrl,
    out: FetchedFile = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    autopilot: AutopilotKind = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Read the mission of a MAVLink vehicle, and show it or write it to a file.

    Example: stopgo fetch-mission --mavlink udpout:127.0.0.1:14550 -o held.plan
    """
    from stopgo.bridge.commands.vehicle_missions import fetch_mission

    connection = connection_of(
        frozenset(), mavlink=mavlink, vehicle=vehicle, signing_key=signing_key, timeout=timeout,
        insecure=insecure,
    )  # fmt: skip
    with refusals_printed(as_json=json_):
        fetch_mission(connection, autopilot, out=out, as_json=json_)


def clear(
    *,
    mavlink: RequiredMavlinkUrl,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    state: StateFolder = None,
    autopilot: AutopilotKind = None,
    while_running: WhileRunning = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Clear the mission of a MAVLink vehicle, and verify that it holds none.

    Example: stopgo clear --mavlink udpout:127.0.0.1:14550
    """
    from stopgo.bridge.commands.vehicle_missions import clear_mission

    connection = connection_of(
        frozenset(), mavlink=mavlink, vehicle=vehicle, signing_key=signing_key, state=state,
        timeout=timeout, insecure=insecure,
    )  # fmt: skip
    with refusals_printed(as_json=json_):
        clear_mission(connection, autopilot, state=state, while_running=while_running, as_json=json_)
