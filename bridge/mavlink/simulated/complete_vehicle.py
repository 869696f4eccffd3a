"""A simulated vehicle with all its messages, commands and reports."""

from __future__ import annotations

from collections.abc import Callable

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.simulated.auto_reports import auto_events
from stopgo.bridge.mavlink.simulated.command_handlers import handlers
from stopgo.bridge.mavlink.simulated.vehicle import Vehicle, VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_telemetry import MAKERS
from stopgo.mission.mavlink.telemetry import Message


def complete_vehicle(
    setup: VehicleSetup, *, clock: Clock, wall: Clock, send: Callable[[Message], None]
) -> Vehicle:
    """The vehicle that `Vehicle` describes, with every message, command and report."""
    return Vehicle(
        setup, clock=clock, wall=wall, send=send, makers=MAKERS, events=auto_events, commands=handlers
    )
