"""Position error at the stops of a vehicle that drives its list in AUTO, from its own parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping

from stopgo.mission.document import Mission
from stopgo.mission.mavlink.autopilots.kind import Autopilot

STOPS_AFTER_S = 0.3
"""Time that a rover with the usual loops rolls on at its speed beyond a waypoint, seconds.

Measured: 0.27 s on the Rover whose log of five stops the simulated vehicle was compared with (218 mm at
0.8 m/s); 0.2 to 0.25 s on that vehicle at 0.2 to 1.2 m/s, 0.32 s with PX4's loops.
"""
LEAVES_LEGS = "in AUTO it cuts corners by its turning circle, and has position errors up to 2 m"
"""Behaviour of a rover that steers like a car (measured on ArduPilot: 0.1 to 2.2 m)."""


def stops_within(*, radius: float, speed: float) -> float:
    """Return the metres from a waypoint within which it stops, if it counts as reached within `radius`."""
    return max(radius, STOPS_AFTER_S * speed)


def accuracy_warning(mission: Mission, kind: Autopilot, values: Mapping[str, float]) -> str:
    """Return the message on a mission that needs finer vehicle parameters; empty if they suffice.

    `values`: the known parameters, such as its radius for waypoints and those of its steering.
    """
    fixed = kind.why_no_pivot(values)
    if fixed:
        return (
            f"this vehicle does not keep to a mission: {fixed}; {LEAVES_LEGS}; use one with two driven sides"
        )
    radius = values.get(kind.radius_parameter)
    return "" if radius is None else _tolerance_warning(mission, kind, radius)


def _tolerance_warning(mission: Mission, kind: Autopilot, radius: float) -> str:
    """Return the message for stops with tolerances that the vehicle does not meet."""
    least = min(stop.tolerance_m for stop in mission.stops)
    speed = mission.robot.speed
    within = stops_within(radius=radius, speed=speed)
    if within <= least:
        return ""
    tighter = sum(stop.tolerance_m < within for stop in mission.stops)
    slower = math.floor(100 * least / STOPS_AFTER_S) / 100
    wanted = [f"set {kind.radius_parameter} to {least:g}"] * (radius > least)
    wanted += [f"plan with --speed {slower:.2f}"] * (slower < speed)
    by = f"{kind.radius_parameter} {radius:g} m, {speed:g} m/s"
    return (
        f"this vehicle stops within {within:.2f} m in AUTO ({by}),"
        f" and {tighter} of {len(mission.stops)} stops must be met within less,"
        f" the tightest within {least:g} m:"
        f" {' and '.join(wanted)}, or drive it by stopgo robot --controller mavlink:URL"
    )
