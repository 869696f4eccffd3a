"""A vehicle complete with all that it tells and obeys."""

from __future__ import annotations

from collections.abc import Callable

from bridge.link.clock import Clock
from bridge.mavlink.simulated.command_handlers import handlers
from bridge.mavlink.simulated.vehicle import Setting, Vehicle
from bridge.mavlink.simulated.vehicle_telemetry import MAKERS
from mission.mavlink.telemetry import Message


def complete_vehicle(
    setting: Setting, *, clock: Clock, wall: Clock, say: Callable[[Message], None]
) -> Vehicle:
    """The vehicle that `Vehicle` describes, with every message and order that there is."""
    return Vehicle(setting, clock=clock, wall=wall, say=say, makers=MAKERS, orders=handlers)
