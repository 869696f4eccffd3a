"""Checks of a vehicle before a mission of scan stops: its state, its position, its parameters."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

from stopgo.bridge.commands.checks import Check
from stopgo.bridge.commands.vehicle_abilities import abilities
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.accuracy import LEAVES_LEGS
from stopgo.mission.mavlink.autopilots.kind import Autopilot, ParameterRule, why_no_rover
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.following.vehicle_health import has_position
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import charge_of, is_arming_refusal

PREARM_BIT = 0x10000000
"""MAV_SYS_STATUS_PREARM_CHECK."""
COMPLAIN_S = 2.0
"""Wait for messages of the prearm check."""
LEAST_CHARGE = 0.2


def vehicle_checks(peer: Peer, *, any_origin: bool) -> Iterator[Check]:
    """Check a vehicle, without changing anything.

    `any_origin`: the vehicle has satellite positions, not those of an external localisation.
    """
    kind, beat = peer.autopilot, peer.heartbeat
    wrong = why_no_rover(beat.type)
    armed = ", armed" if peer.armed else ""
    yield Check("vehicle", not wrong, wrong or f"{peer}, mode {kind.mode_name(beat)}{armed}")
    if not kind.drivable:
        yield Check("kind", True, f"of {kind.name} autopilots only the mission protocol is known")
    yield from _arming(peer)
    yield _estimator(peer)
    yield _origin(peer)
    yield _pose(peer)
    yield from _battery(peer)
    wanted = [rule for rule in kind.parameters if rule.when == "always" or not any_origin]
    names = {name for rule in wanted for one in _releases(rule) for name in one.names}
    values = read_parameters(peer, names | set(kind.steering.parameters)) if names else {}
    yield from steering_check(kind, values)
    yield from parameter_checks(kind, values, any_origin=any_origin)
    alone = kind.driving.gives_up_parameter
    yield from abilities(peer, values if alone in values else {**values, **read_parameters(peer, [alone])})


def steering_check(kind: Autopilot, values: Mapping[str, float]) -> Iterator[Check]:
    """Check that the vehicle can turn on the spot."""
    reason = kind.why_no_pivot(values)
    if reason:
        yield Check("steering", False, f"{reason}: {LEAVES_LEGS}", "use one with two driven sides")


def parameter_checks(kind: Autopilot, values: Mapping[str, float], *, any_origin: bool) -> Iterator[Check]:
    """Return a check for each parameter that should be set, and one that counts the correct ones."""
    right, unreported = 0, []
    for rule in kind.parameters:
        if rule.when == "indoors" and any_origin:
            continue
        reported = [(name, one) for one in _releases(rule) for name in one.names if name in values]
        if not reported:
            unreported.append(rule.names[0])
            continue
        name, matching = reported[0]
        if matching.right(values[name]):
            right += 1
        else:
            yield _to_set(matching, name, values[name])
    if right or unreported:
        more = f"; not reported by the vehicle: {', '.join(unreported)}" if unreported else ""
        yield Check("params", True, f"{right} of those that a mission needs are right{more}")


def _releases(rule: ParameterRule) -> tuple[ParameterRule, ...]:
    """Return the rule, and that of older releases of the autopilot."""
    return (rule,) if rule.before is None else (rule, rule.before)


def _to_set(rule: ParameterRule, name: str, value: float) -> Check:
    return Check(name, not rule.must, f"is {value:g}: {rule.why}", f"set {name} to {rule.set_to}")


def _arming(peer: Peer) -> Iterator[Check]:
    """Check that the vehicle can be armed; it runs its prearm check if it supports that."""
    if peer.armed:
        return
    complaints: list[str] = []
    with peer.waiting("STATUSTEXT") as waiting:
        accepted = peer.command(Command.RUN_PREARM_CHECKS).accepted
        until = time.monotonic() + (COMPLAIN_S if accepted else 0.0)
        while (message := waiting.get(until - time.monotonic())) is not None:
            words = "".join(letter for letter in message.text if letter.isprintable()).strip()
            if is_arming_refusal(words) and words not in complaints:
                complaints.append(words)
    for words in complaints:
        yield Check("arming", False, f'it reports "{words}"', "correct that first; it does not arm like this")
    status = peer.ask(MessageId.SYS_STATUS)
    if status is None or not status.onboard_control_sensors_present & PREARM_BIT or complaints:
        return
    ready = bool(status.onboard_control_sensors_health & PREARM_BIT)
    yield Check("arming", ready, "ready to arm" if ready else "not ready to arm; it reports no reason")


def _estimator(peer: Peer) -> Check:
    """Check that the vehicle's estimator has a position."""
    for number in (MessageId.EKF_STATUS_REPORT, MessageId.ESTIMATOR_STATUS):
        report = peer.ask(number)
        if report is None:
            continue
        flags = report.flags
        ok = has_position(flags)
        action = (
            "" if ok else "send it the robot's pose as ODOMETRY, 4 times a second or more, and set its origin"
        )
        return Check("filter", ok, f"{'has a' if ok else 'has no'} position (flags {flags})", action)
    return Check("filter", True, "reports nothing about its estimator")


def _origin(peer: Peer) -> Check:
    origin = peer.origin()
    if origin is None:
        return Check(
            "origin", False, "not set, or not reported", "set it after each boot (SET_GPS_GLOBAL_ORIGIN)"
        )
    position, unplaced = origin.place, peer.unplaced()
    if unplaced:
        return Check("origin", False, *unplaced.split("; "))
    return Check(
        "origin", True, f"{position.lat:.7f}, {position.lon:.7f}; push compares it with the mission's"
    )


def _pose(peer: Peer) -> Check:
    pose = peer.ask(MessageId.LOCAL_POSITION_NED)
    if pose is None:
        return Check("pose", False, "reports no position in metres", "is the robot's localisation running?")
    return Check("pose", True, f"{pose.x:.2f} m north, {pose.y:.2f} m east of its origin")


def _battery(peer: Peer) -> Iterator[Check]:
    status = peer.ask(MessageId.SYS_STATUS)
    charge = None if status is None else charge_of(status.battery_remaining)
    if charge is not None:
        ok = charge >= LEAST_CHARGE
        yield Check("battery", ok, f"{100 * charge:.0f} %", "" if ok else "charge it first")
