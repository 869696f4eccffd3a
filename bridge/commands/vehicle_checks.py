"""What stands between a vehicle and a mission of scan stops: its state, its place, its parameters."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

from stopgo.bridge.commands.checks import Check
from stopgo.bridge.mavlink.vehicle_link.parameter_reading import read_parameters
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.accuracy import LEAVES_LEGS
from stopgo.mission.mavlink.autopilots.kind import Autopilot, ParameterRule, why_no_rover
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import charge_of, complains

PREARM_BIT = 0x10000000
"""MAV_SYS_STATUS_PREARM_CHECK."""
LEVEL, NEAR, FAR, FIXED = 1, 8, 16, 128
"""Flags of an estimator's report: attitude, place from its start, place on earth, and place only held."""
COMPLAIN_S = 2.0
LEAST_CHARGE = 0.2


def vehicle_checks(peer: Peer, *, any_origin: bool) -> Iterator[Check]:
    """Look at a vehicle; nothing of it is changed.

    `any_origin`: it finds its place by satellites, and not by somebody else's localisation.
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
    names = {name for rule in wanted for either in _either(rule) for name in either.names}
    values = read_parameters(peer, names | set(kind.steering.parameters)) if names else {}
    yield from steering_check(kind, values)
    yield from parameter_checks(kind, values, any_origin=any_origin)


def steering_check(kind: Autopilot, values: Mapping[str, float]) -> Iterator[Check]:
    """A line if it cannot turn on the spot."""
    fixed = kind.why_no_pivot(values)
    if fixed:
        yield Check("steering", False, f"{fixed}: {LEAVES_LEGS}", "use one with two driven sides")


def parameter_checks(kind: Autopilot, values: Mapping[str, float], *, any_origin: bool) -> Iterator[Check]:
    """A line for each parameter that should be set, and one for how many are right."""
    right, untold = 0, []
    for rule in kind.parameters:
        if rule.when == "indoors" and any_origin:
            continue
        told = [(name, either) for either in _either(rule) for name in either.names if name in values]
        if not told:
            untold.append(rule.names[0])
            continue
        name, either = told[0]
        if either.right(values[name]):
            right += 1
        else:
            yield _to_set(either, name, values[name])
    if right or untold:
        more = f"; not told by the vehicle: {', '.join(untold)}" if untold else ""
        yield Check("params", True, f"{right} of those that a mission needs are right{more}")


def _either(rule: ParameterRule) -> tuple[ParameterRule, ...]:
    """The rule, and that of older releases."""
    return (rule,) if rule.before is None else (rule, rule.before)


def _to_set(rule: ParameterRule, name: str, value: float) -> Check:
    return Check(name, not rule.must, f"is {value:g}: {rule.why}", f"set {name} to {rule.set_to}")


def _arming(peer: Peer) -> Iterator[Check]:
    """What it says against being armed; asked to look, where it can be asked."""
    if peer.armed:
        return
    said: list[str] = []
    with peer.waiting("STATUSTEXT") as waiting:
        accepted = peer.command(Command.RUN_PREARM_CHECKS).accepted
        until = time.monotonic() + (COMPLAIN_S if accepted else 0.0)
        while (message := waiting.get(until - time.monotonic())) is not None:
            words = "".join(letter for letter in message.text if letter.isprintable()).strip()
            if complains(words) and words not in said:
                said.append(words)
    for words in said:
        yield Check("arming", False, f'it says "{words}"', "see to that first: it does not arm like this")
    status = peer.ask(MessageId.SYS_STATUS)
    if status is None or not status.onboard_control_sensors_present & PREARM_BIT or said:
        return
    ready = bool(status.onboard_control_sensors_health & PREARM_BIT)
    yield Check("arming", ready, "ready to arm" if ready else "not ready to arm, and it does not say why")


def knows_its_place(flags: int) -> bool:
    """Whether an estimator with these flags has a place to tell.

    PX4 tells that its place is only held whenever the vehicle stands, also with a place on earth.
    """
    return bool(flags & LEVEL) and bool(flags & FAR or (flags & NEAR and not flags & FIXED))


def _estimator(peer: Peer) -> Check:
    """Whether its estimator has a place to tell."""
    for number in (MessageId.EKF_STATUS_REPORT, MessageId.ESTIMATOR_STATUS):
        report = peer.ask(number)
        if report is None:
            continue
        flags = report.flags
        ok = knows_its_place(flags)
        do = (
            "" if ok else "send it the robot's pose as ODOMETRY, 4 times a second or more, and set its origin"
        )
        return Check("filter", ok, f"{'knows' if ok else 'does not know'} its place (flags {flags})", do)
    return Check("filter", True, "tells nothing of its estimator")


def _origin(peer: Peer) -> Check:
    origin = peer.origin()
    if origin is None:
        return Check(
            "origin", False, "not set, or not told", "set it after each boot (SET_GPS_GLOBAL_ORIGIN)"
        )
    place, unplaced = origin.place, peer.unplaced()
    if unplaced:
        return Check("origin", False, *unplaced.split("; "))
    return Check("origin", True, f"{place.lat:.7f}, {place.lon:.7f}; push compares it with the mission's")


def _pose(peer: Peer) -> Check:
    pose = peer.ask(MessageId.LOCAL_POSITION_NED)
    if pose is None:
        return Check("pose", False, "tells no place in metres", "is the robot's localisation running?")
    return Check("pose", True, f"{pose.x:.2f} m north, {pose.y:.2f} m east of its origin")


def _battery(peer: Peer) -> Iterator[Check]:
    status = peer.ask(MessageId.SYS_STATUS)
    charge = None if status is None else charge_of(status.battery_remaining)
    if charge is not None:
        ok = charge >= LEAST_CHARGE
        yield Check("battery", ok, f"{100 * charge:.0f} %", "" if ok else "charge it first")
