"""Health of a vehicle as its autopilot reports it: battery, position estimate, geofence, remote control.

Each value is None where the autopilot reports nothing, or has the check switched off. Sources: SYS_STATUS
(ArduPilot's `update_sensor_status_flags`: the battery's bit is off from its failsafe until a restart or
BATTERY_RESET, the fence's while it is breached), BATTERY_STATUS, FENCE_STATUS and the estimators' reports.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from stopgo.mission.mavlink.telemetry import Message, charge_of

BATTERY_BIT, FENCE_BIT, REMOTE_CONTROL_BIT, ESTIMATE_BIT = 0x2000000, 0x100000, 0x10000, 0x200000
"""Of MAV_SYS_STATUS_SENSOR."""
CHARGE_OK, CHARGE_BAD = 1, range(3, 6)
"""MAV_BATTERY_CHARGE_STATE: OK, and CRITICAL to FAILED. LOW may be a warning only: the bit decides."""
LEVEL, RELATIVE, ABSOLUTE, CONSTANT = 1, 8, 16, 128
"""Flags of an estimator's report: attitude, relative position, absolute position, constant position mode."""


@dataclass(frozen=True)
class VehicleHealth:
    """Health as last reported; `None` is unknown."""

    charge: float | None = None
    """Charge of the battery, 0 to 1."""
    battery: bool | None = None
    """False while a failsafe of the battery lasts."""
    position: bool | None = None
    """False while the estimator has no position."""
    fence: bool | None = None
    """False while the geofence is breached."""
    remote_control: bool | None = None

    def lasting(self, paused_for: str = "") -> str:
        """Return the cause that keeps the vehicle from going on, and how to clear it; empty if there is none.

        A lost remote control counts only if the run was paused for it: many robots have none.
        """
        for name, cause, remedy in CAUSES:
            wants = name != "remote_control" or cause in paused_for
            if wants and getattr(self, name) is False:
                return f"{cause}, as the autopilot reports it: {remedy}"
        return ""


CAUSES = (
    (
        "battery",
        "its battery failsafe lasts",
        "charge or change the battery, then restart the autopilot, which keeps this failsafe until then",
    ),
    (
        "fence",
        "its geofence is breached",
        "drive it back inside by hand, or correct the fence",
    ),
    (
        "position",
        "its estimator has no position",
        "see that its localisation runs, and wait for its position (stopgo doctor --mavlink shows it)",
    ),
    ("remote_control", "remote control lost", "switch the remote control on"),
)


def has_position(flags: int) -> bool:
    """Return True if an estimator with these flags has a position.

    PX4 sets the flag of constant position mode at every standstill, also with an absolute position.
    """
    return bool(flags & LEVEL) and bool(flags & ABSOLUTE or (flags & RELATIVE and not flags & CONSTANT))


class HealthReports:
    """Takes messages one after another; `now` is the health by the newest of each."""

    def __init__(self) -> None:
        self.now = VehicleHealth()
        self._charge_state: bool | None = None
        self._battery_bit: bool | None = None
        self._estimate_bit: bool | None = None
        self._flags: bool | None = None
        self._fence_bit: bool | None = None
        self._breach: bool | None = None

    def take(self, name: str, message: Message) -> None:
        taken = TAKING.get(name)
        if taken is None:
            return
        taken(self, message)
        self.now = replace(
            self.now, battery=_worst(self._battery_bit, self._charge_state),
            position=self._estimate_bit if self._flags is None else self._flags,
            fence=_worst(self._fence_bit, self._breach),
        )  # fmt: skip

    def _take_system(self, message: Message) -> None:
        self._take_charge(message)
        self._battery_bit = _bit(message, BATTERY_BIT)
        self._fence_bit = _bit(message, FENCE_BIT)
        self._estimate_bit = _bit(message, ESTIMATE_BIT)
        self.now = replace(self.now, remote_control=_bit(message, REMOTE_CONTROL_BIT))

    def _take_battery(self, message: Message) -> None:
        self._take_charge(message)
        state = message.charge_state
        self._charge_state = True if state == CHARGE_OK else False if state in CHARGE_BAD else None

    def _take_charge(self, message: Message) -> None:
        charge = charge_of(message.battery_remaining)
        self.now = replace(self.now, charge=self.now.charge if charge is None else charge)

    def _take_estimator(self, message: Message) -> None:
        self._flags = has_position(message.flags)

    def _take_fence(self, message: Message) -> None:
        self._breach = not message.breach_status


def _bit(message: Message, bit: int) -> bool | None:
    """Return a sensor's health; `None` if it is not present, or switched off."""
    if not message.onboard_control_sensors_present & message.onboard_control_sensors_enabled & bit:
        return None
    return bool(message.onboard_control_sensors_health & bit)


def _worst(*reports: bool | None) -> bool | None:
    """Return False if any report is, else True if any is; `None` if all are unknown."""
    known = [report for report in reports if report is not None]
    return all(known) if known else None


TAKING: dict[str, Callable[[HealthReports, Message], None]] = {
    "SYS_STATUS": HealthReports._take_system,
    "BATTERY_STATUS": HealthReports._take_battery,
    "EKF_STATUS_REPORT": HealthReports._take_estimator,
    "ESTIMATOR_STATUS": HealthReports._take_estimator,
    "FENCE_STATUS": HealthReports._take_fence,
}
