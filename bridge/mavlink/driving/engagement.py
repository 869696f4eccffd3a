"""Engagement of an autopilot: reachable, armed and in its guided mode, from one moment to the next.

An operator at the vehicle wins: a mode changed by a remote control, an emergency stop or another station,
or a disarmed vehicle, ends the drive. Nothing is changed back before somebody commands to go on. A short
silence and a restart of the autopilot are waited for, and then the drive goes on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from threading import Event

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.command_refusal import COMMAND_S
from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot
from stopgo.bridge.robot.base import Outcome
from stopgo.mission.document import Point
from stopgo.mission.mavlink.autopilots.kind import Mode

TICK_S = 0.1
REPEAT_S = 1.0
"""Interval between two tries of arming, and between two commands to a stationary vehicle."""
STANDSTILL_S = 10.0
"""Longest wait for a standstill after a drive that ended early."""
TRIES = 3
"""Number of commands for the guided mode: a link may lose both directions, and setpoints may be missing."""
RESTART_S = 60.0
"""Time that a restarted autopilot may take until it can drive."""
HEARTBEAT_S = 2.0
"""A heartbeat comes within this time once a link is back."""
MOVED_M = 0.5
"""A vehicle that reports, after a restart, a position farther off than this was carried, or is lost."""
WARM_UP_S = 1.2
"""Setpoints must have come for a second before an autopilot that needs a stream of them can be driven."""


class DriveEnded(Exception):
    """A drive is over before its end."""

    def __init__(self, outcome: Outcome, why: str = "") -> None:
        super().__init__(why)
        self.outcome: Outcome = outcome
        self.why = why


def end_if(trouble: str) -> None:
    """End the drive as blocked if there is trouble."""
    if trouble:
        raise DriveEnded("blocked", trouble)


class Engagement:
    """Control over one vehicle for a drive; `not_ready` says why it cannot drive at present.

    `misplaced` says why its metres are not the mission's any more. The methods raise `DriveEnded` when the
    drive cannot go on.
    """

    def __init__(
        self,
        autopilot: OnboardAutopilot,
        *,
        clock: Clock,
        arms: bool,
        not_ready: Callable[[], str],
        misplaced: Callable[[], str],
    ) -> None:
        self._autopilot = autopilot
        self._peer = autopilot.peer
        self._control = autopilot.control
        self._telemetry = autopilot.telemetry
        self._clock = clock
        self._arms = arms
        self._not_ready, self._misplaced = not_ready, misplaced
        self._boots: int | None = None
        """Number of restarts when the vehicle was last driven."""
        self._last_position: Point | None = None
        self._late_until_s = -math.inf

    def disarmed(self) -> str:
        """Report a vehicle that is disarmed and that this robot may not arm; else empty."""
        if self._peer.armed or self._arms:
            return ""
        return "the autopilot is disarmed; arm it, or start stopgo robot with --arm"

    def begin(self, interrupt: Event) -> None:
        """Wait for the vehicle, arm it, and bring it into its guided mode while it stays where it is."""
        self._await_telemetry(interrupt)
        if self._boots not in (None, self._peer.boots):
            self._accept_restart(interrupt)
        end_if(self._not_ready() or self._control.mode_change())
        self._boots = self._peer.boots
        if not self._peer.armed:
            end_if(self._control.disarming() if self._control.is_disarmed_at_work else "")
            self._arm(interrupt)
        self._control.begin_work()
        with self._autopilot.setpoints.standing_at(self._telemetry.position()):
            self._guide(interrupt)

    def tick(self, interrupt: Event) -> bool:
        """Wait a moment; true if something has interrupted the drive, and that is over now."""
        self.pause(TICK_S, interrupt)
        was_late = self._await_telemetry(interrupt)
        if self._peer.boots != self._boots:
            self.begin(interrupt)
            return True
        if self._stopped_by_failsafe():
            self._control.known_mode = None
            self.begin(interrupt)
            return True
        self._control.note_armed()
        end_if(self._control.mode_change() or self._control.disarming() or self._control.other_hands())
        end_if(self._misplaced())
        self._last_position = self._telemetry.position()
        return was_late

    def release(self) -> None:
        """Hold after a drive that ended early, unless somebody else has the vehicle; await standstill."""
        self._control.accept_disarming()
        if self._control.is_changed and not self._telemetry.why_unknown():
            self._control.accept_mode()
        else:
            self._control.stop()
        until_s = self.now_s() + STANDSTILL_S
        while not (self._telemetry.is_stationary() or self._telemetry.why_unknown()):
            if self.now_s() >= until_s:
                return
            self._clock.wait(TICK_S)

    def pause(self, seconds: float, interrupt: Event) -> None:
        if self._clock.wait(seconds, interrupt):
            raise DriveEnded("interrupted")

    def now_s(self) -> float:
        return self._clock.now_ns() / 1e9

    def _arm(self, interrupt: Event) -> None:
        """Arm the vehicle; after a restart it refuses until its sensors agree, so the command is repeated."""
        while trouble := self._control.arm():
            end_if(trouble if self._telemetry.up_s > RESTART_S else "")
            self.pause(REPEAT_S, interrupt)
            self._await_telemetry(interrupt)
            end_if(self._not_ready() or self._control.mode_change())

    def _guide(self, interrupt: Event) -> None:
        """Bring the vehicle into its guided mode, as shown by its heartbeat."""
        trouble = ""
        for _ in range(TRIES):
            if self._autopilot.kind.driving.streams:
                self.pause(WARM_UP_S, interrupt)
            trouble = self._control.guide() or self._not_guided(interrupt)
            if not trouble:
                return
        end_if(trouble)

    def _not_guided(self, interrupt: Event) -> str:
        """Report that the guided mode was accepted and does not show; empty once it shows."""
        began_s = self.now_s()
        while not self._control.is_guided():
            if self.now_s() > began_s + COMMAND_S:
                return "the autopilot accepted the command and did not change its mode"
            self.pause(TICK_S, interrupt)
        return ""

    def _stopped_by_failsafe(self) -> bool:
        """True if the vehicle holds because it received no setpoints during a silence.

        Its heartbeat may show that a moment after the link is back. If somebody commanded hold meanwhile, the
        heartbeat shows no failsafe.
        """
        just_back = self.now_s() - self._late_until_s < HEARTBEAT_S
        return just_back and self._autopilot.kind.driving.streams and self._control.holds_by_failsafe

    def _await_telemetry(self, interrupt: Event) -> bool:
        """Wait for telemetry that is late, and have the vehicle stop meanwhile; true if it was late."""
        late = False
        while self._telemetry.is_late:
            late, self._late_until_s = True, self.now_s()
            if self._telemetry.is_lost:
                end_if(self._telemetry.why_unknown())
            self._autopilot.setpoints.halt()
            self.pause(TICK_S, interrupt)
        return late

    def _accept_restart(self, interrupt: Event) -> None:
        """Go on after a restart of the autopilot, if the vehicle was not moved and nobody else took it.

        In any other case it is left as it is; the next command to drive does not check again.
        """
        self._boots = self._peer.boots
        end_if("" if self._arms else f"{RESTARTED} and is disarmed; arm it, or start stopgo robot with --arm")
        boot_mode = self._await_restart(interrupt)
        position = self._telemetry.position()
        moved = math.dist(position, self._last_position or position)
        if moved > MOVED_M:
            end_if(f"{RESTARTED} and reports a position {moved:.2f} m from the last one: check where it is")
        end_if(self._control.hold_after_restart(boot_mode))

    def _await_restart(self, interrupt: Event) -> Mode:
        """Restore the origin; return the mode after the restart, once both are reported."""
        began_s, since_s = self.now_s(), time.monotonic()
        origin = self._telemetry.origin()
        boot_mode = None
        while boot_mode is None or self._telemetry.origin(since_s) is None:
            if self.now_s() > began_s + RESTART_S:
                missing = "mode" if boot_mode is None else "origin; set it to the mission’s"
                end_if(f"{RESTARTED} and reports no {missing}")
            if origin is not None:
                self._autopilot.restore_origin(origin)
            self.pause(TICK_S, interrupt)
            self._await_telemetry(interrupt)
            boot_mode = boot_mode or self._control.mode_since(since_s)
        return boot_mode


RESTARTED = "the autopilot was restarted"
