"""How each autopilot is driven from outside: the modes it is put into, and what it then takes.

ArduPilot Rover is driven in GUIDED, which stays at its last place whatever becomes of us. PX4 is driven in
OFFBOARD, not by DO_REPOSITION: that drives in the very mode (AUTO.LOITER) that also means to hold, so that a
stop could not be seen to have been obeyed; and OFFBOARD ends by itself when our setpoints cease.
"""

from __future__ import annotations

from dataclasses import dataclass

from bridge.mavlink.line.wire import dialect
from mission.errors import InputError

CUSTOM_MODE = float(dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)

ROVER_MODES = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE", 8: "DOCK",
    9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED", 16: "INITIALISING",
}  # fmt: skip
PX4_MAIN = {
    1: "MANUAL", 2: "ALTITUDE", 3: "POSITION", 4: "AUTO", 5: "ACRO", 6: "OFFBOARD", 7: "STABILIZED",
}  # fmt: skip
PX4_AUTO = {2: "TAKEOFF", 3: "HOLD", 4: "MISSION", 5: "RETURN", 6: "LAND"}
ROVERS = (dialect.MAV_TYPE_GROUND_ROVER, dialect.MAV_TYPE_SURFACE_BOAT)


@dataclass(frozen=True)
class Mode:
    """A mode as DO_SET_MODE names it."""

    main: int
    sub: int = 0

    @property
    def params(self) -> tuple[float, float, float]:
        return (CUSTOM_MODE, float(self.main), float(self.sub))


@dataclass(frozen=True)
class Driving:
    """What must be known of an autopilot to drive it."""

    rule: str
    """How it turns metres into degrees, one of `mission.geodesy.RULES`."""
    guided: Mode
    hold: Mode
    packed: bool
    """Its heartbeat has main and sub mode in the two upper bytes of `custom_mode`."""
    streams: bool
    """It leaves `guided` unless setpoints keep coming, so it is put on hold wherever it arrives."""
    takes_speed: bool
    """DO_CHANGE_SPEED counts in `guided`."""
    turns: bool
    """It turns to a yaw that is told without a place."""

    def mode_of(self, custom_mode: int) -> Mode:
        """The mode in a heartbeat."""
        if not self.packed:
            return Mode(custom_mode)
        return Mode(custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF)

    def name_of(self, mode: Mode) -> str:
        """What people call the mode."""
        if not self.packed:
            return ROVER_MODES.get(mode.main, f"mode {mode.main}")
        if mode.main == self.hold.main:
            return PX4_AUTO.get(mode.sub, f"AUTO {mode.sub}")
        return PX4_MAIN.get(mode.main, f"mode {mode.main}")


# ArduPilot, source (Rover/mode_guided.cpp): set_desired_speed counts only while it drives to a place, so that
# is sent first; a yaw alone is followed for GUID_TIMEOUT (3 s) and then stops it.
# PX4, documentation: setpoints at 2 Hz or more for a second before OFFBOARD and as long as it lasts; speed in
# it is the vehicle's own (RO_SPEED_LIM), and yaw is of mecanum drives alone (SurfaceVehiclePositionSetpoint).
DRIVING: dict[str, Driving] = {
    "ardupilot": Driving(
        rule="ardupilot", guided=Mode(15), hold=Mode(4), packed=False, streams=False,
        takes_speed=True, turns=True,
    ),
    "px4": Driving(
        rule="px4", guided=Mode(6), hold=Mode(4, 3), packed=True, streams=True,
        takes_speed=False, turns=False,
    ),
}  # fmt: skip


def driving_of(autopilot: str, vehicle_type: int) -> Driving:
    """How a vehicle is driven.

    Raises
    ------
    InputError
        If it cannot be.
    """
    if autopilot not in DRIVING:
        known = " and ".join(DRIVING)
        raise InputError(f"--controller: an autopilot of kind {autopilot!r} cannot be driven; {known} can")
    if vehicle_type not in ROVERS:
        raise InputError(f"--controller: vehicle type {vehicle_type} is no rover (10) or boat (11)")
    return DRIVING[autopilot]
