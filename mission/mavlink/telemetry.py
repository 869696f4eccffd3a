"""State of a vehicle from its telemetry: standstill, link loss, restart, position.

The units of MAVLink's messages end here: steps of 1e-7 degrees, millimetres, centimetres a second, percent.
"""

from __future__ import annotations

import math
from typing import Any

from stopgo.mission.frames.geodesy import Geodetic, from_steps
from stopgo.mission.mavlink.local_frame import VehicleOrigin

Message = Any
"""A MAVLink message as pymavlink returns it, from a link or a log."""

STILL_M_S = 0.03
STILL_RAD_S = 0.03
"""Limits of a standstill: an estimator's speeds of a stationary robot are not zero."""
BACK_MS = 1_000
"""A clock that goes back by more was restarted; by less, two messages arrived out of order."""
LOST_S = 3.0
"""Three heartbeats: a bad link loses one or two."""
POSE_NUMBERS = {"LOCAL_POSITION_NED": ("x", "y", "vx", "vy"), "ATTITUDE": ("yaw",)}
MISSION_ID_AT = 6
"""Place of `mission_id` in the payload of MISSION_CURRENT, behind seq, total, state and mode."""
VERSION_2, HEADER_BYTES = b"\xfd", 10
"""First byte and header of a frame of MAVLink 2, whose payload may have newer fields."""
COMPLAINTS = ("PreArm:", "Preflight Fail:", "Arm:")
"""First words of a vehicle's texts that say why it does not arm."""


def stands_still(*, speed: float, yaw_rate: float) -> bool:
    """Return True for a standstill at this speed (m/s) and yaw rate (rad/s)."""
    return speed < STILL_M_S and abs(yaw_rate) < STILL_RAD_S


def is_lost(silent_s: float) -> bool:
    """Return True if the last data of a vehicle, or of its position, is too old to know its state."""
    return silent_s > LOST_S


def has_restarted(before_ms: int, now_ms: int) -> bool:
    """Return True if a vehicle restarted between two of its times since boot."""
    return now_ms + BACK_MS < before_ms


def is_arming_refusal(text: str) -> bool:
    """Return True if a STATUSTEXT says why the vehicle does not arm."""
    return text.startswith(COMPLAINTS)


def charge_of(remaining: int) -> float | None:
    """Return a battery_remaining (percent) as 0 to 1; `None` if the vehicle does not know it (-1)."""
    return remaining / 100 if 0 <= remaining <= 100 else None


def mission_id_of(message: Any) -> int:
    """Return the mission id in a MISSION_CURRENT, a newer field of 32 bits; 0 if there is none."""
    frame = bytes(message.get_msgbuf() or b"")
    if frame[:1] != VERSION_2:
        return 0
    payload = frame[HEADER_BYTES : HEADER_BYTES + frame[1]]
    return int.from_bytes(payload[MISSION_ID_AT : MISSION_ID_AT + 4], "little")


def place_of(message: Any) -> Geodetic | None:
    """Return the `lat` and `lon` of a message; None for 0, 0, which is no position."""
    return None if (message.lat, message.lon) == (0, 0) else from_steps(message.lat, message.lon)


def has_numbers(message: Message) -> bool:
    """Return False for a local position or an attitude that is no number: it says nothing of the vehicle."""
    names = POSE_NUMBERS.get(message.get_type(), ())
    return all(math.isfinite(getattr(message, name)) for name in names)


def local_speed(message: Any) -> float:
    """Return the metres per second in a LOCAL_POSITION_NED."""
    return math.hypot(message.vx, message.vy)


def global_speed(message: Any) -> float:
    """Return the metres per second in a GLOBAL_POSITION_INT."""
    return math.hypot(message.vx, message.vy) / 100


def origin_of(message: Any) -> VehicleOrigin:
    """Return the origin in a GPS_GLOBAL_ORIGIN."""
    place = from_steps(message.latitude, message.longitude)
    return VehicleOrigin(lat=place.lat, lon=place.lon, alt=message.altitude / 1000)
