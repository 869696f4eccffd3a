"""What a vehicle can be told to do, each done only when the vehicle shows that it does it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.line.messages import interval, set_current
from stopgo.bridge.mavlink.line.peer import Ack, Peer
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.mavlink.autopilots.kind import AUTO, HOLD, Mode
from stopgo.mission.mavlink.enums import CommandResult, MessageId
from stopgo.mission.mavlink.following.observer import Observer
from stopgo.mission.mavlink.items import Command
from stopgo.mission.run.orders import Refused

SHOWS_S = 5.0
"""A vehicle beats every second; so long it may take until it shows what it was told."""
MESSAGES = 5
"""So often something is told that is not answered, within that time."""
ASK_AGAIN_NS = 500_000_000
REPEATED_HZ = {
    MessageId.MISSION_CURRENT: 5.0,
    MessageId.MISSION_ITEM_REACHED: 2.0,
    MessageId.LOCAL_POSITION_NED: 10.0,
    MessageId.GLOBAL_POSITION_INT: 2.0,
    MessageId.ATTITUDE: 10.0,
    MessageId.SYS_STATUS: 1.0,
    MessageId.GPS_GLOBAL_ORIGIN: 0.5,
}
"""How often each message is wanted; what is lost is told again."""


class Denied(Exception):
    """The vehicle, or what is known of it, says no; nothing has changed."""

    def __init__(self, refused: Refused) -> None:
        super().__init__(refused.message)
        self.refused = refused


class ConfirmedCommands:
    """Orders to one vehicle, by its commands; whether it obeys, the observer tells.

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
        """Ask to be told everything often, without waiting for answers: some vehicles know no intervals."""
        for number, hertz in REPEATED_HZ.items():
            self._peer.send(interval(self._peer.who, number, hertz))

    def ask_for(self, number: int) -> None:
        """Ask for a message once more, without waiting; at most twice a second."""
        now_ns = self._clock.now_ns()
        if now_ns < self._asked_ns + ASK_AGAIN_NS:
            return
        self._asked_ns = now_ns
        self._peer.request(number)

    def hold(self) -> None:
        """Let it stand where it is."""
        self._mode(HOLD, self._peer.autopilot.modes.hold)

    def auto(self) -> None:
        """Let it follow its mission."""
        self._mode(AUTO, self._peer.autopilot.modes.auto)

    def jump(self, sequence: int, *, anew: bool = False) -> None:
        """Make an item the one it works on; a command that is no NAV command is passed at once.

        `anew` also takes a mission that is complete out of that state. PX4 does not know the command, but the
        older message, which nobody answers (measured).
        """
        asked_ns, what = self._clock.now_ns(), f"item {sequence}"
        ack = self._told(Command.DO_SET_MISSION_CURRENT, float(sequence), float(anew))
        if ack.result != CommandResult.UNSUPPORTED:
            self._must(ack, what)
        near = range(sequence, sequence + 3)

        def shown() -> bool:
            return self._observer.current_ns > asked_ns and self._observer.sequence in near

        for _ in range(MESSAGES if ack.result == CommandResult.UNSUPPORTED else 0):
            self._peer.send(set_current(self._peer.who, sequence))
            with self.news:
                if self.news.wait_for(shown, SHOWS_S / MESSAGES):
                    return
        self._shown(shown, f"going to {what}")

    def arm(self, armed: bool = True) -> None:
        """Arm it, or disarm it."""
        what = "arming" if armed else "disarming"
        self._order(Command.COMPONENT_ARM_DISARM, float(armed), what=what)
        self._shown(lambda: self._observer.armed == armed, what)

    def speed(self, metres_per_s: float) -> None:
        """Set the speed that the mission's first item sets; not every firmware takes it from elsewhere."""
        with suppress(OutcomeUnknown):
            self._peer.command(Command.DO_CHANGE_SPEED, 1.0, metres_per_s, -1.0)

    def _mode(self, name: str, mode: Mode) -> None:
        asked_ns = self._clock.now_ns()
        self._order(Command.DO_SET_MODE, *mode.params, what=f"mode {name}")
        self._shown(
            lambda: self._observer.mode == name and self._observer.mode_ns > asked_ns, f"changing to {name}"
        )

    def _order(self, number: int, *params: float, what: str) -> None:
        self._must(self._told(number, *params), what)

    def _told(self, number: int, *params: float) -> Ack:
        self.working()
        return self._peer.command(number, *params)

    def _must(self, ack: Ack, what: str) -> None:
        """The vehicle has taken the order."""
        if not ack.accepted:
            text = self._peer.newest("STATUSTEXT")
            said = f', and last said "{text.text}"' if text is not None else ""
            raise Denied(Refused("denied", f"the vehicle answered {ack.name} to {what}{said}"))

    def _shown(self, seen: Callable[[], bool], what: str) -> None:
        with self.news:
            if not self.news.wait_for(seen, SHOWS_S):
                raise OutcomeUnknown(
                    f"{self._peer}: {what} was accepted and does not show in what it tells;"
                    " see stopgo status, and the vehicle"
                )
