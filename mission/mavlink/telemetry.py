"""What a vehicle's telemetry comes to: whether it stands still, whether it is still heard, where it is.

Here end the units of MAVLink's messages: steps of 1e-7 degrees, millimetres, centimetres a second, percent.
"""

from __future__ import annotations

import math
from typing import Any

from stopgo.mission.frames.geodesy import Geodetic, from_steps
from stopgo.mission.mavlink.local_frame import VehicleOrigin

Message = Any
"""A MAVLink message as pymavlink gives it, from a line or a log."""

STILL_M_S = 0.03
STILL_RAD_S = 0.03
"""An estimator's speeds of a robot that stands are not zero."""
BACK_MS = 1_000
"""A clock that goes back by more was started again; by less, two messages changed places."""
LOST_S = 3.0
"""Three heartbeats: one or two are lost on any bad line."""
COMPLAINTS = ("PreArm:", "Preflight Fail:", "Arm:")
"""What a vehicle's texts begin with that say why it does not arm."""


def stands_still(*, speed: float, yaw_rate: float) -> bool:
    """Whether a vehicle of this speed (m/s) that turns so fast (rad/s) stands."""
    return speed < STILL_M_S and abs(yaw_rate) < STILL_RAD_S


def is_lost(silent_s: float) -> bool:
    """Whether so long after it last told anything, or where it is, nobody knows what a vehicle does."""
    return silent_s > LOST_S


def began_again(before_ms: int, now_ms: int) -> bool:
    """Whether a vehicle was started anew between two of its times since boot."""
    return now_ms + BACK_MS < before_ms


def complains(text: str) -> bool:
    """Whether a STATUSTEXT says why the vehicle does not arm."""
    return text.startswith(COMPLAINTS)


def charge_of(remaining: int) -> float | None:
    """A battery_remaining (percent) as 0 to 1; `None` where the vehicle does not know it (-1)."""
    return remaining / 100 if 0 <= remaining <= 100 else None


def place_of(message: Any) -> Geodetic | None:
    """The `lat` and `lon` of a message; 0, 0 is no place."""
    return None if (message.lat, message.lon) == (0, 0) else from_steps(message.lat, message.lon)


def local_speed(message: Any) -> float:
    """Metres per second that a LOCAL_POSITION_NED tells."""
    return math.hypot(message.vx, message.vy)


def global_speed(message: Any) -> float:
    """Metres per second that a GLOBAL_POSITION_INT tells."""
    return math.hypot(message.vx, message.vy) / 100


def origin_of(message: Any) -> VehicleOrigin:
    """What a GPS_GLOBAL_ORIGIN tells."""
    place = from_steps(message.latitude, message.longitude)
    return VehicleOrigin(lat=place.lat, lon=place.lon, alt=message.altitude / 1000)
