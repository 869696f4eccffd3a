"""Watch for somebody who takes the vehicle while it stands at a stop: by mode, set points or disarming."""

from __future__ import annotations

import time

from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot

BOOT_SHOWS_S = 1.0
"""Time within which a restart, which also changes the mode, shows in the autopilot's clock."""


class TakeoverWatch:
    """Watches one vehicle from now on. A restart is no takeover, whatever mode the vehicle has after it."""

    def __init__(self, autopilot: OnboardAutopilot, *, by_hold: bool) -> None:
        self._autopilot = autopilot
        self._by_hold = by_hold
        """True if a hold that somebody else commands is a takeover too."""
        self._boots = autopilot.peer.boots
        self._began_s = time.monotonic()
        self._was_taken = bool(self._mode_taken())
        """True if it was in such a mode before: a restarted autopilot may be scanned from as it is."""
        self._taken_s: float | None = None
        """Time since when a mode is reported in which somebody else drives, or that a restart brought."""

        self._disarmed_s: float | None = None
        """Time since when it is reported as disarmed, by somebody or by a restart."""

    @property
    def is_restarted(self) -> bool:
        return self._autopilot.peer.boots != self._boots

    def taken(self) -> str:
        """Return the mode in which somebody else has the vehicle; empty if nobody has."""
        taken = "" if self._was_taken or self.is_restarted else self._mode_taken()
        self._taken_s = (self._taken_s or time.monotonic()) if taken else None
        lasts = self._taken_s is not None and time.monotonic() - self._taken_s >= BOOT_SHOWS_S
        return taken if lasts else ""

    def steered(self) -> str:
        """Return who steers the vehicle in the guided mode; empty if nobody was heard."""
        return self._autopilot.control.other_hands(time.monotonic() - self._began_s)

    def disarmed(self) -> str:
        """Return who has disarmed the vehicle; empty if nobody has."""
        control = self._autopilot.control
        control.note_armed()
        is_off = control.is_disarmed_at_work
        self._disarmed_s = (self._disarmed_s or time.monotonic()) if is_off else None
        lasts = self._disarmed_s is not None and time.monotonic() - self._disarmed_s >= BOOT_SHOWS_S
        return control.disarming() if lasts else ""

    def _mode_taken(self) -> str:
        control = self._autopilot.control
        by_hold = control.mode_change() if self._by_hold and control.is_put_on_hold else ""
        return control.other_control() or by_hold
