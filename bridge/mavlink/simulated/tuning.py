"""Numbers by which the simulated vehicle drives: an autopilot's parameters, and those of its chassis.

The autopilots' names are those of their sources (ArduPilot Rover 4.7: AR_WPNav, AR_PivotTurn,
AR_AttitudeControl, AR_PosControl; PX4: RoverControl, rover_differential). ArduPilot's values are those of the
Rover whose log of five stops the vehicle was compared with. No autopilot has those with SIM_: they describe
the simulation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from stopgo.mission.mavlink.autopilots import AUTOPILOTS
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT

CHASSIS = {
    "SIM_TOP_SPEED": 4.0,  # m/s at full throttle
    "SIM_LAG": 0.4,  # s until most of a change of throttle has become speed: drive 0.29, servos the rest
    "SIM_TURN_TOP": 280.0,  # degrees a second at full steering
    "SIM_TURN_LAG": 0.1,  # s
    "SIM_TURN_RADIUS": 0.9,  # m, of one that steers like a car
    "SIM_STICTION": 0.0,  # throttle below which wheels that stand do not begin to turn
    "SIM_POS_DRIFT": 0.006,  # m by which the estimated place wanders (standard deviation)
    "SIM_POS_NOISE": 0.001,  # m from one estimate to the next
    "SIM_VEL_NOISE": 0.003,  # m/s
    "SIM_YAW_DRIFT": 0.3,  # degrees
    "SIM_EST_LAG": 0.06,  # s by which the estimate is late
    "SIM_ARM_AFTER": 0.0,  # s from its start until its sensors agree and it lets itself be armed
}
ARDUPILOT_ROVER = {
    "WP_SPEED": 0.8, "WP_RADIUS": 0.02, "WP_ACCEL": 0.0, "WP_JERK": 0.0,
    "WP_PIVOT_ANGLE": 60.0, "WP_PIVOT_RATE": 60.0, "TURN_RADIUS": 0.9,
    "CRUISE_SPEED": 3.0, "CRUISE_THROTTLE": 75.0, "GUID_TIMEOUT": 3.0,
    "ATC_ACCEL_MAX": 1.0, "ATC_DECEL_MAX": 0.0, "ATC_BRAKE": 1.0, "ATC_STOP_SPEED": 0.1,
    "ATC_SPEED_P": 0.1, "ATC_SPEED_I": 0.2, "ATC_SPEED_IMAX": 1.0,
    "ATC_STR_ANG_P": 2.0, "ATC_STR_ACC_MAX": 120.0, "ATC_STR_RAT_MAX": 120.0,
    "ATC_STR_RAT_FF": 0.2, "ATC_STR_RAT_P": 0.2, "ATC_STR_RAT_I": 0.2,
    "PSC_POS_P": 0.2, "PSC_VEL_P": 1.0,
}  # fmt: skip
PX4_ROVER = {
    "RO_SPEED_LIM": 0.8, "RO_ACCEL_LIM": 0.5, "RO_DECEL_LIM": 0.5, "RO_MAX_THR_SPEED": 4.0,
    "RO_SPEED_P": 0.1, "RO_SPEED_I": 0.2, "RO_SPEED_TH": 0.1,
    "RO_YAW_P": 2.0, "RO_YAW_RATE_LIM": 60.0, "RO_YAW_ACCEL_LIM": 120.0,
    "RD_TRANS_DRV_TRN": 0.174533, "RD_TRANS_TRN_DRV": 0.0872665, "RD_WHEEL_TRACK": 0.5,
    "PP_LOOKAHD_GAIN": 1.0, "PP_LOOKAHD_MIN": 1.0, "PP_LOOKAHD_MAX": 10.0,
    "NAV_ACC_RAD": 0.5, "COM_OF_LOSS_T": 1.0, "CA_AIRFRAME": 6.0,
}  # fmt: skip
SERVOS = {
    **dict.fromkeys(ARDUPILOT.steering.parameters, 0.0),
    "SERVO1_FUNCTION": 73.0,
    "SERVO3_FUNCTION": 74.0,
}
"""Separate outputs for each side, so that it turns on the spot."""
STRICT = {"WP_RADIUS": 0.1}
OF_KIND: Mapping[str, Mapping[str, float]] = {
    "ardupilot": {**ARDUPILOT_ROVER, **SERVOS, **CHASSIS},
    "px4": {**PX4_ROVER, **CHASSIS},
    "generic": STRICT,
}
MUST_BE_MORE = (
    "SIM_TOP_SPEED",
    "SIM_TURN_TOP",
    "SIM_TURN_RADIUS",
    "CRUISE_SPEED",
    "CRUISE_THROTTLE",
    "RO_MAX_THR_SPEED",
)
HIGHEST = 10_000.0


class Tuning:
    """Present parameters of one vehicle."""

    def __init__(self, kind: str, **changed: float) -> None:
        self._kind = AUTOPILOTS[kind]
        self.values = {**OF_KIND[kind], **changed}
        self.pivots = not self._kind.why_no_pivot(self.values)
        """It turns on the spot; else it steers like a car."""

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def set(self, name: str, value: float) -> bool:
        """Change a parameter; false if the value is not allowed."""
        least = 1e-3 if name in MUST_BE_MORE else 0.0
        if name not in self.values or not (math.isfinite(value) and least <= value <= HIGHEST):
            return False
        self.values[name] = value
        self.pivots = not self._kind.why_no_pivot(self.values)
        return True
