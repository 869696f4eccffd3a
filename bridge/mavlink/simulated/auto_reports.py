"""Reports of the simulated vehicle while it drives its mission in AUTO: one function per event."""

from __future__ import annotations

from stopgo.bridge.mavlink.simulated.auto_mission import AutoEvents
from stopgo.bridge.mavlink.simulated.vehicle import Vehicle
from stopgo.mission.mavlink.enums import MessageId


def auto_events(vehicle: Vehicle) -> AutoEvents:
    """The events of the vehicle's mission, reported by it."""
    return AutoEvents(
        current=lambda number: _report_current(vehicle),
        reached=lambda number: _report_reached(vehicle, number),
        trigger=lambda number, seconds, now_ns: _trigger_scan(vehicle, number, seconds, now_ns),
        finished=lambda now_ns: _finish(vehicle),
        reboot=vehicle.reboot,
        text=vehicle.text,
    )


def _report_current(vehicle: Vehicle) -> None:
    vehicle.report(MessageId.MISSION_CURRENT)


def _report_reached(vehicle: Vehicle, number: int) -> None:
    vehicle.reached = number
    vehicle.report(MessageId.MISSION_ITEM_REACHED)


def _trigger_scan(vehicle: Vehicle, number: int, seconds: float, now_ns: int) -> None:
    vehicle.time.advance(now_ns)
    if not vehicle.camera.begin(number, seconds, vehicle.now_ns):
        vehicle.text(f"Scan {number}: the scanner is busy")


def _finish(vehicle: Vehicle) -> None:
    vehicle.text("Mission Complete")
    vehicle.report(MessageId.MISSION_CURRENT)
    if vehicle.autopilot.behaviour.done_mode != vehicle.mode:
        vehicle.mode = vehicle.autopilot.behaviour.done_mode
        vehicle.report(MessageId.HEARTBEAT)
