"""What a vehicle's telemetry comes to: whether it stands still, and whether it is still heard."""

from __future__ import annotations

STILL_M_S = 0.03
STILL_RAD_S = 0.03
"""An estimator's speeds of a robot that stands are not zero."""
BACK_MS = 1_000
"""A clock that goes back by more was started again; by less, two messages changed places."""
LOST_S = 3.0
"""Three heartbeats: one or two are lost on any bad line."""


def stands_still(*, speed: float, yaw_rate: float) -> bool:
    """Whether a vehicle of this speed (m/s) that turns so fast (rad/s) stands."""
    return speed < STILL_M_S and abs(yaw_rate) < STILL_RAD_S


def is_lost(silent_s: float) -> bool:
    """Whether so long after it last told anything, or where it is, nobody knows what a vehicle does."""
    return silent_s > LOST_S


def began_again(before_ms: int, now_ms: int) -> bool:
    """Whether a vehicle was started anew between two of its times since boot."""
    return now_ms + BACK_MS < before_ms


def charge_of(remaining: int) -> float | None:
    """A battery_remaining (percent) as 0 to 1; `None` where the vehicle does not know it (-1)."""
    return remaining / 100 if 0 <= remaining <= 100 else None
