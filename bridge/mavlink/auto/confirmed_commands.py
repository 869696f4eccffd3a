"""Commands to a vehicle, each done only when the vehicle's telemetry shows its effect."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.vehicle_link.messages import (
    command_long,
    every_component,
    interval,
    request,
    set_current,
)
from stopgo.bridge.mavlink.vehicle_link.peer import Ack, Peer
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.mavlink.autopilots.kind import AUTO, HOLD, Mode
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.items import Command
from stopgo.mission.run.run_commands import Refused

SHOWS_S = 5.0
"""Longest wait for the effect of a command; a vehicle sends a heartbeat every second."""
REPEATS = 5
"""Number of times that a message without answer is sent within `SHOWS_S`."""
ASK_AGAIN_NS = 500_000_000
REPEATED_HZ = {
    MessageId.HEARTBEAT: 4.0,
    MessageId.MISSION_CURRENT: 5.0,
    MessageId.MISSION_ITEM_REACHED: 2.0,
    MessageId.LOCAL_POSITION_NED: 10.0,
    MessageId.GLOBAL_POSITION_INT: 2.0,
    MessageId.ATTITUDE: 10.0,
    MessageId.SYS_STATUS: 1.0,
    MessageId.BATTERY_STATUS: 0.5,
    MessageId.EKF_STATUS_REPORT: 1.0,
    MessageId.ESTIMATOR_STATUS: 1.0,
    MessageId.FENCE_STATUS: 1.0,
    MessageId.GPS_GLOBAL_ORIGIN: 0.5,
    MessageId.RC_CHANNELS: 4.0,
}
"""Wanted rate of each message, in Hz; so a lost one is followed by another."""


class Denied(Exception):
    """Refused by the vehicle, or because of its known state; nothing has changed."""

    def __init__(self, refused: Refused) -> None:
        super().__init__(refused.message)
        self.refused = refused


class ConfirmedCommands:
    """Commands to one vehicle; the observer shows their effects.

    `news` is notified whenever the observer has taken a message.
    """

    def __init__(self, peer: Peer, observer: Observer, clock: Clock) -> None:
        self.news = threading.Condition()
        self.working: Callable[[], None] = lambda: None
        """Called before each command."""
        self._peer = peer
        self._observer = observer
        self._clock = clock
        self._asked_ns = 0

    def ask_for_telemetry(self) -> None:
        """Request all wanted messages at their rates, without an answer: some vehicles know no intervals."""
        for number, hertz in REPEATED_HZ.items():
            self._peer.send(interval(self._peer.who, number, hertz))

    def ask_for_picture(self) -> None:
        """Request the last picture of every component, at most twice a second, without waiting."""
        now_ns = self._clock.now_ns()
        if now_ns >= self._asked_ns + ASK_AGAIN_NS:
            self._asked_ns = now_ns
            self._peer.send(request(every_component(self._peer.who), MessageId.CAMERA_IMAGE_CAPTURED))

    def hold(self) -> None:
        """Put the vehicle on hold."""
        self._mode(HOLD, self._peer.autopilot.modes.hold)

    def send_hold(self) -> None:
        """Send HOLD once, without waiting for its effect."""
        self._peer.send(
            command_long(self._peer.who, Command.DO_SET_MODE, *self._peer.autopilot.modes.hold.params)
        )

    def auto(self) -> None:
        """Have the vehicle follow its mission."""
        self._mode(AUTO, self._peer.autopilot.modes.auto)

    def jump(self, sequence: int, *, reset: bool = False) -> None:
        """Make an item the current one; an item that is no NAV command is passed at once.

        `reset` also takes a mission that is complete out of that state. PX4 does not know the command, but
        the older message, which it does not answer (measured).
        """
        asked_ns, what = self._clock.now_ns(), f"item {sequence}"
        ack = self._send(Command.DO_SET_MISSION_CURRENT, float(sequence), float(reset))
        if ack.result != CommandResult.UNSUPPORTED:
            self._check_accepted(ack, what)
        near = range(sequence, sequence + 3)

        def shown() -> bool:
            return self._observer.position.current_ns > asked_ns and self._observer.position.sequence in near

        for _ in range(REPEATS if ack.result == CommandResult.UNSUPPORTED else 0):
            self._peer.send(set_current(self._peer.who, sequence))
            with self.news:
                if self.news.wait_for(shown, SHOWS_S / REPEATS):
                    return
        self._await(shown, f"going to {what}")

    def arm(self, armed: bool = True) -> None:
        """Arm it, or disarm it."""
        what = "arming" if armed else "disarming"
        self._command(Command.COMPONENT_ARM_DISARM, float(armed), what=what)
        self._await(lambda: self._observer.status.armed == armed, what)

    def speed(self, metres_per_s: float) -> None:
        """Set the speed that the mission's first item sets; not every firmware takes it from elsewhere."""
        with suppress(OutcomeUnknown):
            self._peer.command(Command.DO_CHANGE_SPEED, 1.0, metres_per_s, -1.0)

    def _mode(self, name: str, mode: Mode) -> None:
        asked_ns = self._clock.now_ns()
        self._command(Command.DO_SET_MODE, *mode.params, what=f"mode {name}")
        self._await(
            lambda: self._observer.status.mode == name and self._observer.status.mode_ns > asked_ns,
            f"changing to {name}",
        )

    def _command(self, number: int, *params: float, what: str) -> None:
        self._check_accepted(self._send(number, *params), what)

    def _send(self, number: int, *params: float) -> Ack:
        self.working()
        return self._peer.command(number, *params)

    def _check_accepted(self, ack: Ack, what: str) -> None:
        """Raise `Denied` unless the vehicle has accepted the command."""
        if not ack.accepted:
            text = self._peer.newest("STATUSTEXT")
            said = f', and last said "{text.text}"' if text is not None else ""
            raise Denied(Refused("denied", f"the vehicle answered {ack.name} to {what}{said}"))

    def _await(self, seen: Callable[[], bool], what: str) -> None:
        """Wait until the telemetry shows the effect of a command."""
        with self.news:
            if not self.news.wait_for(seen, SHOWS_S):
                raise OutcomeUnknown(
                    f"{self._peer}: {what} was accepted and does not show in its telemetry;"
                    " see stopgo status, and the vehicle"
                )
