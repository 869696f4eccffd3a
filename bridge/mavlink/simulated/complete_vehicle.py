"""A vehicle complete with all that it tells and obeys."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated.command_handlers import handlers
from stopgo.bridge.mavlink.simulated.vehicle import Setting, Vehicle
from stopgo.bridge.mavlink.simulated.vehicle_telemetry import MAKERS
from stopgo.mission.mavlink.telemetry import Message


def complete_vehicle(
    setting: Setting, *, clock: Clock, wall: Clock, say: Callable[[Message], None]
) -> Vehicle:
    """The vehicle that `Vehicle` describes, with every message and order that there is."""
    return Vehicle(setting, clock=clock, wall=wall, say=say, makers=MAKERS, orders=handlers)
