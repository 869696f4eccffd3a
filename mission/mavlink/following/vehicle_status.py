"""Clock, mode, arming, battery and failsafe of a vehicle, each as last reported."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.enums import ModeFlag
from stopgo.mission.mavlink.failsafes import RECENT_S, UNNAMED, Failsafe, failsafe_of
from stopgo.mission.mavlink.following.vehicle_health import HealthReports, VehicleHealth
from stopgo.mission.mavlink.telemetry import Message, is_lost

CLOCKS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "ATTITUDE", "SYSTEM_TIME")
"""Messages with the vehicle's time since boot."""


@dataclass(frozen=True)
class TimestampedMessage:
    """A message, and the time of its arrival."""

    message: Message
    ns: int


class VehicleStatus:
    """Takes messages one after another; returns the status on request."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._heartbeat: TimestampedMessage | None = None
        self._clock: TimestampedMessage | None = None
        """The newest message that contains the vehicle's time."""
        self._mode_began_ns = 0
        """Time when the vehicle was first in its present mode."""
        self._failsafe: tuple[Failsafe, int] | None = None
        """The failsafe that a text reported last, and when."""
        self._health = HealthReports()

    @property
    def health(self) -> VehicleHealth:
        """Battery, position estimate, geofence and remote control, as last reported."""
        return self._health.now

    def take(self, name: str, message: Message, now_ns: int) -> None:
        self._health.take(name, message)
        if name in CLOCKS:
            self._clock = TimestampedMessage(message, now_ns)
        elif name == "HEARTBEAT":
            self._take_heartbeat(message, now_ns)
        elif name == "STATUSTEXT":
            failsafe = failsafe_of(message.text)
            self._failsafe = self._failsafe if failsafe is None else (failsafe, now_ns)

    def _take_heartbeat(self, message: Message, now_ns: int) -> None:
        before = (self.mode, self.armed)
        self._heartbeat = TimestampedMessage(message, now_ns)
        if (self.mode, self.armed) != before:
            self._mode_began_ns = now_ns

    @property
    def clock(self) -> TimestampedMessage | None:
        """The newest message that contains the vehicle's time."""
        return self._clock

    @property
    def boot_ms(self) -> int:
        """Its time since boot, as last reported."""
        return 0 if self._clock is None else int(self._clock.message.time_boot_ms)

    @property
    def is_known(self) -> bool:
        """True once a heartbeat has come."""
        return self._heartbeat is not None

    @property
    def mode(self) -> str:
        """AUTO, HOLD or another; empty before a heartbeat."""
        return "" if self._heartbeat is None else self._autopilot.mode_name(self._heartbeat.message)

    @property
    def mode_ns(self) -> int:
        """Time of the last report of the mode."""
        return 0 if self._heartbeat is None else self._heartbeat.ns

    @property
    def mode_began_ns(self) -> int:
        """Time when it was first in its present mode, armed or disarmed as now."""
        return self._mode_began_ns

    @property
    def armed(self) -> bool:
        beat = self._heartbeat
        return beat is not None and bool(beat.message.base_mode & ModeFlag.SAFETY_ARMED)

    def mode_explained(self, current_ns: int, now_ns: int) -> bool:
        """Return True if clock and item came since the mode changed, which a reboot or an end may explain.

        `current_ns` is the time of the last report of the current item.
        """
        explained = self._clock is not None and min(self._clock.ns, current_ns) > self._mode_began_ns
        return explained or is_lost((now_ns - self._mode_began_ns) / 1e9)

    def failsafe_text(self) -> str:
        """Return the failsafe that may have caused the present mode; empty if none is reported."""
        if self._failsafe is not None and self._failsafe[1] > self._mode_began_ns - RECENT_S * 1e9:
            return str(self._failsafe[0])
        beat = self._heartbeat
        return UNNAMED if beat is not None and self._autopilot.in_failsafe(beat.message) else ""
