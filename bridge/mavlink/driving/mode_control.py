"""Mode and arming of an autopilot: its guided mode, hold, and changes by another operator.

A stop waits behind no other command. It stays pending, and is sent again, until a heartbeat shows another
mode than the guided one: so it also outlives a link that is cut.
"""

from __future__ import annotations

import math
import threading
import time

from stopgo.bridge.mavlink.driving.autopilot_telemetry import NewestMessages
from stopgo.bridge.mavlink.driving.command_refusal import COMMAND_S, refusal
from stopgo.bridge.mavlink.vehicle_link.foreign_commands import JUST_NOW_S, Effect
from stopgo.bridge.mavlink.vehicle_link.messages import command_long
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.mission.mavlink.autopilots.kind import Mode
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.failsafes import UNNAMED
from stopgo.mission.mavlink.following.steps import SOMEBODY
from stopgo.mission.mavlink.items import Command

TICK_S = 0.1
STOP_S = 2.5
"""Longest wait of `stop` for the vehicle to show hold; the command is repeated after that, too."""
GUARD_S = 10.0
"""A hold that shows within this time after the guard's stop is the guard's."""
WORKED_S = 10.0
"""A vehicle that was seen armed so short a time ago was disarmed during the robot's work."""
IN_FLIGHT_S = 0.3
"""A heartbeat that comes this soon after a command may have been sent before it."""


class ModeControl:
    """Commands for one autopilot's mode, and the mode that was last commanded or accepted."""

    def __init__(self, peer: Peer, newest: NewestMessages, closing: threading.Event) -> None:
        self.known_mode: Mode | None = None
        """The mode as commanded or accepted here: somebody else chose any other one."""
        self._peer = peer
        self._kind = peer.autopilot
        self._modes = peer.autopilot.modes
        self._newest = newest
        self._closing = closing
        self._lock = threading.Lock()
        """Keeps commands for hold and for the guided mode in order, never crossed."""
        self._guide_sent_s = 0.0
        self._guard_stop_s = -math.inf
        self._stop_pending = threading.Event()
        self._stop_sent_s = 0.0
        self._armed_s = -math.inf
        """Time at which the vehicle was last seen armed while the robot worked."""
        self._armed_boots = 0
        """Number of its restarts when the robot last began to drive: a restart disarms it, too."""

    # Reported mode

    def mode(self) -> Mode:
        return self._kind.mode_of(self._peer.heartbeat)

    def mode_since(self, at_s: float) -> Mode | None:
        """The mode in a heartbeat since then (monotonic); `None` if none came."""
        beat = self._newest.since("HEARTBEAT", at_s)
        return None if beat is None else self._kind.mode_of(beat)

    def is_guided(self) -> bool:
        """True if a heartbeat since `guide` shows the guided mode; an older one proves nothing."""
        beat = self._newest.since("HEARTBEAT", self._guide_sent_s)
        if beat is None:
            self._peer.request(MessageId.HEARTBEAT)
            return False
        return self._kind.mode_of(beat) == self._modes.guided

    @property
    def is_in_guided_mode(self) -> bool:
        """True if the last heartbeat shows the guided mode."""
        return self.mode() == self._modes.guided

    def note_guard_stop(self) -> None:
        """Note that the guard has put the vehicle on hold, because this program hung."""
        self._guard_stop_s = time.monotonic()

    @property
    def holds_by_failsafe(self) -> bool:
        """True if a failsafe of its own put it on hold, for instance because setpoints were missing."""
        beat = self._peer.heartbeat
        return self._kind.mode_of(beat) == self._modes.hold and self._kind.in_failsafe(beat)

    # Control by somebody else

    def other_control(self) -> str:
        """Report the mode if it is neither the guided mode nor hold: somebody else drives; else empty."""
        mode = self.mode()
        if mode in (self._modes.guided, self._modes.hold):
            return ""
        name = self._modes.name(mode)
        return f"the autopilot is in {name}: somebody else drives it; to hand it over, switch it to HOLD"

    @property
    def is_changed(self) -> bool:
        """True if somebody else has changed the mode since the known one."""
        mode = self.mode()
        ours = self._stop_pending.is_set() and mode == self._modes.hold
        return not ours and self.known_mode not in (None, mode)

    @property
    def is_put_on_hold(self) -> bool:
        """True if somebody else has put the vehicle on hold since the known mode."""
        return self.is_changed and self.mode() == self._modes.hold

    def mode_change(self) -> str:
        """Report a change of mode that somebody else made since the known mode; empty if there was none."""
        return self._switched() if self.is_changed else ""

    def _switched(self) -> str:
        mode = self.mode()
        return f"{self._author('mode', mode)} switched the autopilot to {self._modes.name(mode)}"

    def disarming(self) -> str:
        """Report a disarmed autopilot, and who disarmed it; empty if it is armed."""
        return "" if self._peer.armed else f"the autopilot was disarmed by {self._author('arming')}"

    def note_armed(self) -> None:
        """Note that the robot works with an armed vehicle; a heartbeat may be from before a restart."""
        if self._peer.armed and self._peer.boots == self._armed_boots:
            self._armed_s = time.monotonic()

    def begin_work(self) -> None:
        """Note that the robot begins to drive the vehicle, which is armed."""
        self._armed_s, self._armed_boots = time.monotonic(), self._peer.boots

    def accept_disarming(self) -> None:
        """Take a disarmed vehicle as known: who commands to go on may have it armed again."""
        self._armed_s = -math.inf

    @property
    def is_disarmed_at_work(self) -> bool:
        """True if the vehicle was disarmed while the robot worked with it, and not by a restart."""
        is_recent = time.monotonic() - self._armed_s < WORKED_S
        return not self._peer.armed and is_recent and self._peer.boots == self._armed_boots

    def other_hands(self, within_s: float = JUST_NOW_S) -> str:
        """Report whoever else has steered the vehicle in the guided mode; empty if none was heard."""
        if not self.is_in_guided_mode:
            return ""
        station = self._peer.foreign.sends_set_points(within_s)
        if station:
            return f"{station} sends the vehicle set points"
        moved = self._peer.foreign.sticks_moved(within_s)
        return f"{moved} steers the vehicle" if moved else ""

    def _author(self, effect: Effect, mode: Mode | None = None) -> str:
        """Author of the change: our guard, a station, a failsafe, a remote control, or unknown."""
        if time.monotonic() - self._guard_stop_s < GUARD_S:
            return "the gateway's own guard (its program did not run for a while)"
        station = self._peer.foreign.station(effect, mode=mode)
        if station:
            return station
        failsafe = self._newest.recent_failsafe
        if failsafe is not None:
            return str(failsafe)
        if self._kind.in_failsafe(self._peer.heartbeat):
            return UNNAMED
        seen_s = time.monotonic()
        while self._peer.foreign.awaits_channels(time.monotonic() - seen_s) and not self._closing.is_set():
            self._closing.wait(TICK_S)
        return self._peer.foreign.remote_control(time.monotonic() - seen_s) or SOMEBODY

    def accept_mode(self) -> None:
        """Take the reported mode as known: an operator who commands to go on knows it.

        In a mode in which somebody else drives, hold is the handover, so no mode is known until then.
        """
        self.known_mode = None if self.other_control() else self.mode()

    # Commands

    def arm(self) -> str:
        """Arm the vehicle; return why that failed, else empty."""
        return refusal(self._peer, Command.COMPONENT_ARM_DISARM, 1.0, what="arming")

    def guide(self) -> str:
        """Command the guided mode; return why it was refused, else empty (then see `is_guided`)."""
        with self._lock:
            self._stop_pending.clear()
            self._guide_sent_s = time.monotonic()
        self.known_mode = guided = self._modes.guided
        name = self._modes.name(guided)
        return refusal(self._peer, Command.DO_SET_MODE, *guided.params, what=f"the mode {name}")

    def hold_after_restart(self, boot_mode: Mode) -> str:
        """Put an autopilot that restarted in `boot_mode` on hold; return why not, else empty."""
        if self.mode() not in (boot_mode, self._modes.hold):
            return self._switched()
        self.known_mode = None
        sent_s = time.monotonic()
        why = refusal(self._peer, Command.DO_SET_MODE, *self._modes.hold.params, what="the mode to hold")
        while not why and self.mode_since(sent_s) != self._modes.hold:
            self._peer.request(MessageId.HEARTBEAT)
            self._closing.wait(TICK_S)
            if time.monotonic() > sent_s + COMMAND_S:
                why = "the autopilot accepted hold and does not show it"
        return why

    def stop(self) -> None:
        """Command hold, and wait a moment until the vehicle shows it; hold stays pending until then.

        A vehicle that somebody else drives in another mode is left alone.
        """
        self._stop_sent_s = time.monotonic()
        self._stop_pending.set()
        until = self._stop_sent_s + STOP_S
        while self._stop_pending.is_set() and time.monotonic() < until and not self._closing.is_set():
            self.repeat_stop()
            self._closing.wait(TICK_S)

    def repeat_stop(self) -> None:
        """Send a pending stop again, or clear it once the vehicle shows another mode."""
        if not self._stop_pending.is_set():
            return
        with self._lock:
            if not self._stop_pending.is_set():
                return
            beat = self._newest.since("HEARTBEAT", self._stop_sent_s + IN_FLIGHT_S)
            mode = self.mode()
            if beat is not None and mode != self._modes.guided:
                self.accept_mode()
                self._stop_pending.clear()
            elif mode in (self._modes.guided, self._modes.hold):
                self._peer.send(command_long(self._peer.who, Command.DO_SET_MODE, *self._modes.hold.params))
        self._peer.request(MessageId.HEARTBEAT)
