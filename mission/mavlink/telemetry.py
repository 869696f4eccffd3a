"""What a vehicle's telemetry comes to: whether it stands still, and whether it is still heard."""

from __future__ import annotations

STILL_M_S = 0.03
STILL_RAD_S = 0.03
"""An estimator's speeds of a robot that stands are not zero."""
LOST_S = 3.0
"""Three heartbeats: one or two are lost on any bad line."""


def stands_still(*, speed: float, yaw_rate: float) -> bool:
    """Whether a vehicle of this speed (m/s) that turns so fast (rad/s) stands."""
    return speed < STILL_M_S and abs(yaw_rate) < STILL_RAD_S


def is_lost(silent_s: float) -> bool:
    """Whether so long after it last told anything, or where it is, nobody knows what a vehicle does."""
    return silent_s > LOST_S
