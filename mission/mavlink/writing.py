"""Single items, each from what it is to do."""

from __future__ import annotations

import math

from stopgo.mission.document import Point, Stop
from stopgo.mission.frames.geodesy import bearing_deg, to_geodetic, to_steps
from stopgo.mission.mavlink.items import NAN, Command, Item, MavFrame
from stopgo.mission.mavlink.translation_options import TranslationOptions

SCAN_MESSAGE = 100
"""Message id by which a script on the vehicle knows that a scan is due."""
SCRIPT_COMMAND = 1
"""Command number by which a script knows the NAV_SCRIPT_TIME that waits for a scan."""
SHORTEST_DELAY_S = 0.001
"""A delay of 0 means "until a time of day" to ArduPilot, and a wait must follow every trigger."""


def stop_waypoint(stop: Stop, options: TranslationOptions) -> Item:
    """Where the robot is to stop; with its tolerance and heading where the vehicle keeps them."""
    held = max(options.vehicle.brake_hold_s, stop.settle_s if options.settle == "hold" else 0.0)
    if not options.vehicle.keeps_arrival:
        return _waypoint((stop.x, stop.y), options, hold=held)
    bearing = round(bearing_deg(options.origin, stop.heading), 2) % 360.0
    return _waypoint((stop.x, stop.y), options, hold=held, radius=stop.tolerance_m, yaw=bearing)


def corner_waypoint(point: Point, tolerance_m: float, options: TranslationOptions) -> Item:
    """A place to drive through, told so that the vehicle does not cut it.

    ArduPilot is told to stop there, others a radius: without one they go on to the next waypoint within
    a radius of their own, PX4 within 10 m unless set (source).
    """
    hold = options.vehicle.brake_hold_s
    if not options.vehicle.keeps_arrival:
        return _waypoint(point, options, hold=hold)
    return _waypoint(point, options, hold=hold, radius=tolerance_m, yaw=NAN)


def delay(seconds: float) -> Item:
    """A wait; the time of day is -1, "none", for ArduPilot refuses NaN."""
    held = max(seconds, SHORTEST_DELAY_S)
    return Item(Command.NAV_DELAY, MavFrame.MISSION, params=(held, -1.0, -1.0, -1.0))


def speed_change(speed: float) -> Item:
    """Speed over ground in metres per second; throttle unchanged."""
    return Item(Command.DO_CHANGE_SPEED, MavFrame.MISSION, params=(1.0, speed, -1.0, 0.0))


def script_message(stop: Stop, number: int) -> Item:
    """Message id, the stop's number, seconds of scan, seconds after which a scan has failed."""
    scan = stop.scan
    params = (float(SCAN_MESSAGE), float(number), scan.duration_s, scan.timeout_s)
    return Item(Command.DO_SEND_SCRIPT_MESSAGE, MavFrame.MISSION, params=params)


def script_time(stop: Stop, number: int) -> Item:
    """Command, timeout in whole seconds; the stop's number in x, which float16 would not hold exactly."""
    timeout = max(1, math.ceil(stop.scan.timeout_s))  # 0 would wait for ever
    params = (float(SCRIPT_COMMAND), float(timeout), 0.0, 0.0)
    return Item(Command.NAV_SCRIPT_TIME, MavFrame.MISSION, params=params, x=number)


def capture(number: int) -> Item:
    """All cameras, no interval, one picture, with the stop's number."""
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
