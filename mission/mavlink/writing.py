"""Single items, one function for each purpose."""

from __future__ import annotations

import math

from stopgo.mission.document import Point, Stop
from stopgo.mission.frames.geodesy import bearing_deg, to_geodetic, to_steps
from stopgo.mission.mavlink.items import NAN, Command, Item, MavFrame
from stopgo.mission.mavlink.translation_options import TranslationOptions

SCAN_MESSAGE = 100
"""Message id of a scan request to a script on the vehicle."""
SCRIPT_COMMAND = 1
"""Command number of the NAV_SCRIPT_TIME that waits for a scan."""
SHORTEST_DELAY_S = 0.001
"""A delay of 0 means "until a time of day" to ArduPilot, and a wait must follow every trigger."""


def stop_waypoint(stop: Stop, options: TranslationOptions) -> Item:
    """Return the waypoint of a stop; with its tolerance and heading if the vehicle keeps them."""
    held = max(options.vehicle.brake_hold_s, stop.settle_s if options.settle == "hold" else 0.0)
    if not options.vehicle.keeps_arrival:
        return _waypoint((stop.x, stop.y), options, hold=held)
    bearing = round(bearing_deg(options.origin, stop.heading), 2) % 360.0
    return _waypoint((stop.x, stop.y), options, hold=held, radius=stop.tolerance_m, yaw=bearing)


def corner_waypoint(point: Point, tolerance_m: float, options: TranslationOptions) -> Item:
    """Return a waypoint to drive through without cutting the corner.

    ArduPilot gets a hold, to stop there; others get a radius. Without it they go on to the next waypoint
    within a radius of their own, PX4 within 10 m unless set (source).
    """
    hold = options.vehicle.brake_hold_s
    if not options.vehicle.keeps_arrival:
        return _waypoint(point, options, hold=hold)
    return _waypoint(point, options, hold=hold, radius=tolerance_m, yaw=NAN)


def delay(seconds: float) -> Item:
    """Return a wait; the time of day is -1, "none", because ArduPilot refuses NaN."""
    held = max(seconds, SHORTEST_DELAY_S)
    return Item(Command.NAV_DELAY, MavFrame.MISSION, params=(held, -1.0, -1.0, -1.0))


def speed_change(speed: float) -> Item:
    """Return a change of speed over ground in metres per second; throttle unchanged."""
    return Item(Command.DO_CHANGE_SPEED, MavFrame.MISSION, params=(1.0, speed, -1.0, 0.0))


def script_message(stop: Stop, number: int) -> Item:
    """Return the scan request: message id, the stop's number, duration and timeout of the scan in seconds."""
    scan = stop.scan
    params = (float(SCAN_MESSAGE), float(number), scan.duration_s, scan.timeout_s)
    return Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, params=params)


def script_time(stop: Stop, number: int) -> Item:
    """Return the wait for a script: timeout in whole seconds, stop's number in x (float16 is not exact)."""
    timeout = max(1, math.ceil(stop.scan.timeout_s))  # 0 would wait for ever
    params = (float(SCRIPT_COMMAND), float(timeout), 0.0, 0.0)
    return Item(Command.NAV_SCRIPT_TIME, MavFrame.MISSION, params=params, x=number)


def capture(number: int) -> Item:
    """Return the camera command: all cameras, no interval, one picture, with the stop's number."""
    return Item(Command.IMAGE_START_CAPTURE, MavFrame.MISSION, params=(0.0, 0.0, 1.0, float(number)))


def _waypoint(
    point: Point, options: TranslationOptions, *, hold: float, yaw: float = 0.0, radius: float = 0.0
) -> Item:
    x, y = to_steps(to_geodetic(options.origin, point, options.vehicle.rule))
    return Item(
        Command.NAV_WAYPOINT,
        options.vehicle.frame,
        params=(float(hold), radius, 0.0, yaw),
        x=x,
        y=y,
    )
