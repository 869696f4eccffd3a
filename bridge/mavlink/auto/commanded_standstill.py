"""Commanded standstill: HOLD again and again, until the vehicle reports HOLD and a speed of zero."""

from __future__ import annotations

import time
from collections.abc import Callable

from stopgo.bridge.mavlink.auto.confirmed_commands import Denied
from stopgo.bridge.mavlink.vehicle_link.messages import command_long, enum_name, interval, request
from stopgo.bridge.mavlink.vehicle_link.peer import AGAIN_S, Peer
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.mavlink.autopilots.kind import HOLD, Autopilot
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import Message, global_speed, local_speed, stands_still
from stopgo.mission.run.run_commands import Refused

REPORTS_S = 1.0
"""Interval of the reports while the vehicle still drives."""
MOTION_HZ = {MessageId.LOCAL_POSITION_NED: 10.0, MessageId.GLOBAL_POSITION_INT: 5.0, MessageId.ATTITUDE: 10.0}


class ReportedMotion:
    """Mode and motion as the vehicle reports them; a standstill counts only after a report of HOLD."""

    TYPES = ("HEARTBEAT", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "ATTITUDE", "COMMAND_ACK")

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._yaw_rate = 0.0
        self._local = False
        self.mode = ""
        self.speed: float | None = None
        """Metres per second; `None` if it was not reported."""
        self.stands = False
        self.refusal = ""
        """Name of the last answer to HOLD that was no acceptance."""

    def take(self, message: Message) -> None:
        TAKING[message.get_type()](self, message)

    def __str__(self) -> str:
        speed = "no speed reported" if self.speed is None else f"{self.speed:.2f} m/s"
        return f"mode {self.mode or 'not reported'}, {speed}"

    def _take_heartbeat(self, message: Message) -> None:
        self.mode = self._autopilot.mode_name(message)

    def _take_local(self, message: Message) -> None:
        self._local = True
        self._take_speed(local_speed(message))

    def _take_global(self, message: Message) -> None:
        if not self._local:  # a vehicle without satellites reports zero speed here
            self._take_speed(global_speed(message))

    def _take_speed(self, speed: float) -> None:
        self.speed = speed
        self.stands = self.mode == HOLD and stands_still(speed=speed, yaw_rate=self._yaw_rate)

    def _take_attitude(self, message: Message) -> None:
        self._yaw_rate = message.yawspeed

    def _take_answer(self, message: Message) -> None:
        if message.command == Command.DO_SET_MODE:
            accepted = message.result in (CommandResult.ACCEPTED, CommandResult.IN_PROGRESS)
            self.refusal = "" if accepted else enum_name("MAV_RESULT", message.result)


TAKING: dict[str, Callable[[ReportedMotion, Message], None]] = {
    "HEARTBEAT": ReportedMotion._take_heartbeat,
    "LOCAL_POSITION_NED": ReportedMotion._take_local,
    "GLOBAL_POSITION_INT": ReportedMotion._take_global,
    "ATTITUDE": ReportedMotion._take_attitude,
    "COMMAND_ACK": ReportedMotion._take_answer,
}


def stand(
    peer: Peer,
    *,
    patience_s: float,
    report: Callable[[str], None] = lambda line: None,
    sent: Callable[[], None] = lambda: None,
) -> None:
    """Command HOLD until the vehicle reports a standstill in HOLD.

    `report` is called every second with its motion, `sent` once after the first command; neither may wait.

    Raises
    ------
    Denied
        If it refuses the mode, and is not in it.
    OutcomeUnknown
        If it does not report a standstill within `patience_s`.
    """
    motion = ReportedMotion(peer.autopilot)
    began = reported = time.monotonic()
    with peer.waiting(*ReportedMotion.TYPES) as waiting:
        _send_hold(peer)
        sent()
        while True:
            again = time.monotonic() + AGAIN_S
            while (message := waiting.get(again - time.monotonic())) is not None:
                motion.take(message)
                if motion.stands:
                    return
            now = time.monotonic()
            if now - began >= patience_s:
                break
            if now - reported >= REPORTS_S:
                reported = now
                report(f"{peer}: HOLD sent again; {motion}")
            _send_hold(peer)
    raise _not_standing(peer, motion, patience_s)


def _send_hold(peer: Peer) -> None:
    peer.send(command_long(peer.who, Command.DO_SET_MODE, *peer.autopilot.modes.hold.params))
    peer.send(request(peer.who, MessageId.HEARTBEAT))
    for number, hertz in MOTION_HZ.items():
        peer.send(interval(peer.who, number, hertz))


def _not_standing(peer: Peer, motion: ReportedMotion, waited_s: float) -> Denied | OutcomeUnknown:
    if motion.refusal and motion.mode != HOLD:
        return Denied(
            Refused(
                "denied", f"the vehicle answered {motion.refusal} to mode {HOLD}; stop it by its own control"
            )
        )
    return OutcomeUnknown(
        f"{peer}: HOLD was sent for {waited_s:g} s, and a standstill is not confirmed ({motion});"
        " look at the vehicle"
    )
