"""Abilities of a vehicle that decide what stopgo can promise with it, each asked or read of the vehicle."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

from stopgo.bridge.commands.checks import Check
from stopgo.bridge.mavlink.vehicle_link.messages import every_component, request
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import sender
from stopgo.mission.mavlink.autopilots.kind import ALONE_S, Autopilot
from stopgo.mission.mavlink.enums import Component, MessageId
from stopgo.mission.mavlink.following.vehicle_health import HealthReports
from stopgo.mission.mavlink.items import Command, ItemList

CAMERA_S = 1.5
"""Wait for a camera's answer."""
AGAIN_S = 0.3
SCRIPTS = "SCR_ENABLE"
HEALTH = (
    MessageId.SYS_STATUS, MessageId.BATTERY_STATUS, MessageId.EKF_STATUS_REPORT, MessageId.ESTIMATOR_STATUS,
    MessageId.FENCE_STATUS,
)  # fmt: skip


def abilities(peer: Peer, parameters: Mapping[str, float]) -> Iterator[Check]:
    """Return a line for each: noticing another list, triggers, driving on alone, reported health."""
    yield Check("can", True, list_guard_text(peer))
    yield _camera(peer)
    yield script_check(peer.autopilot, parameters)
    yield Check("can", True, alone_text(peer.autopilot, parameters))
    yield Check("can", True, hands_text(peer))
    yield Check("can", True, health_reports_text(peer))


def list_guard_text(peer: Peer) -> str:
    """Return how another station's list is noticed while a run is followed."""
    if peer.autopilot.behaviour.mission_ids:
        return "list: another list shows at once, by its id"
    return "list: it has no id, so it is read back every 2 s on a fast link, every 30 s on a slow one"


def _camera(peer: Peer) -> Check:
    component = camera_of(peer)
    if component is not None:
        return Check("can", True, f"trigger camera: {_of(component)} has a camera")
    return Check(
        "can", True, "trigger camera: no component reports a camera (CAMERA_INFORMATION)",
        "the autopilot may take IMAGE_START_CAPTURE all the same, and no scan would be confirmed",
    )  # fmt: skip


def camera_note(peer: Peer, sent: ItemList) -> str:
    """Return a note on a list that triggers a camera where none is; empty if there is one, or no need."""
    triggered = any(placed.item.command == Command.IMAGE_START_CAPTURE for placed in sent.placed)
    if not triggered or camera_of(peer) is not None:
        return ""
    return "no component of the vehicle reports a camera (CAMERA_INFORMATION): it may scan nothing"


def camera_of(peer: Peer) -> int | None:
    """Ask every component for a camera's description; the one that has it."""
    until = time.monotonic() + CAMERA_S
    with peer.wire.waiting("CAMERA_INFORMATION") as waiting:
        while time.monotonic() < until:
            peer.send(request(every_component(peer.who), MessageId.CAMERA_INFORMATION))
            message = waiting.get(AGAIN_S)
            if message is not None and sender(message).system == peer.who.system:
                return sender(message).component
    return None


def _of(component: int) -> str:
    return "the autopilot" if component == Component.AUTOPILOT1 else f"component {component}"


def script_check(kind: Autopilot, parameters: Mapping[str, float]) -> Check:
    """Check whether a script on the vehicle can start the scanner in AUTO."""
    if Command.DO_SEND_SCRIPT_MESSAGE not in kind.commands:
        return Check("can", True, f"trigger script: {kind.name} has none")
    value = parameters.get(SCRIPTS)
    if value == 1:
        return Check(
            "can", True, f"trigger script: in AUTO ({SCRIPTS} is 1); a gateway tries it at its start"
        )
    known = "is not reported" if value is None else f"is {value:g}"
    return Check("can", True, f"trigger script: {SCRIPTS} {known}", f"for it set {SCRIPTS} to 1, and restart")


def alone_text(kind: Autopilot, parameters: Mapping[str, float]) -> str:
    """Return how long a gateway's vehicle drives on without its computer or link."""
    if not kind.drivable:
        return f"gateway: not with autopilots of kind {kind.name}"
    name = kind.driving.gives_up_parameter
    if name in parameters:
        remedy = f"; stopgo robot --set-timeout sets {ALONE_S:g} s" if parameters[name] > ALONE_S else ""
        return f"gateway: without its computer it drives on for {parameters[name]:g} s ({name}){remedy}"
    return f"gateway: without its computer it drives on for {kind.driving.gives_up_s:g} s, which is fixed"


def hands_text(peer: Peer) -> str:
    """Return how far a change by somebody else can be traced to the one who made it."""
    reports = peer.ask(MessageId.RC_CHANNELS) is not None
    remote = "a remote control by the channel that moved" if reports else "no remote control (no RC_CHANNELS)"
    return f"whose hand: {remote}; another station if this line carries its commands or the answers to them"


def health_reports_text(peer: Peer) -> str:
    """Return what the vehicle reports of its health, and what stays unknown."""
    reports = HealthReports()
    for number in HEALTH:
        message = peer.ask(number)
        if message is not None:
            reports.take(message.get_type(), message)
    now = reports.now
    known = {
        "charge": now.charge, "battery failsafe": now.battery, "position estimate": now.position,
        "geofence": now.fence, "remote control": now.remote_control,
    }  # fmt: skip
    told = ", ".join(name for name, value in known.items() if value is not None) or "nothing"
    unknown = ", ".join(name for name, value in known.items() if value is None) or "nothing"
    return f"health: reports {told}; unknown: {unknown}"
