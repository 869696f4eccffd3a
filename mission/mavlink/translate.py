"""Mission -> the items of one autopilot, in an order in which no scan begins before the robot is stationary.

At each stop: drive there, settle, trigger, wait for the scan. A command that is no NAV command runs together
with the NAV command after it. So the trigger is between two waits: it fires when the first is over.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from stopgo.mission.document import Mission, Stop
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.corners import corners
from stopgo.mission.mavlink.items import Command, Item, ItemList, Placed
from stopgo.mission.mavlink.notes import notes_of
from stopgo.mission.mavlink.refusals import check, check_count, check_fields, origin_of
from stopgo.mission.mavlink.stop_numbers import numbers_of
from stopgo.mission.mavlink.translation_options import ScanWait, Settle, TranslationOptions, Trigger
from stopgo.mission.mavlink.writing import (
    capture,
    corner_waypoint,
    delay,
    script_message,
    script_time,
    speed_change,
    stop_waypoint,
)


def translate(
    mission: Mission,
    autopilot: str = "ardupilot",
    *,
    trigger: Trigger = "auto",
    scan_wait: ScanWait = "delay",
    settle: Settle = "delay",
    max_lateral_m: float = 0.02,
    max_items: int | None = None,
) -> ItemList:
    """Return the mission as items for an autopilot.

    Parameters
    ----------
    trigger, scan_wait, settle, max_lateral_m
        As in `TranslationOptions`.
    max_items
        Capacity of this vehicle, home included, if it differs from its kind.

    Raises
    ------
    InputError
        If the mission has no georeference, is implausible, or the autopilot is unknown.
    NegativeResult
        If the mission needs what the autopilot drops: a heading, a wait, items above its number.
    """
    vehicle = autopilot_named(autopilot)
    options = TranslationOptions(
        origin=origin_of(mission), vehicle=vehicle, trigger=_resolved_trigger(vehicle, trigger),
        scan_wait=scan_wait, settle=settle, max_lateral_m=max_lateral_m,
    )  # fmt: skip
    numbers = numbers_of(mission)
    check(mission, numbers, options)
    placed = tuple(_without_repeats(_placed(mission, numbers, options)))
    check_fields(mission, placed)
    check_count(mission, placed, vehicle, max_items or vehicle.max_items)
    return ItemList(vehicle.name, options.origin, placed, notes=notes_of(mission, options))


def _resolved_trigger(vehicle: Autopilot, trigger: Trigger) -> Trigger:
    """Return the trigger that `auto` means."""
    if trigger != "auto":
        return trigger
    return "script" if Command.DO_SEND_SCRIPT_MESSAGE in vehicle.commands else "camera"


def _placed(mission: Mission, numbers: Sequence[int], options: TranslationOptions) -> Iterator[Placed]:
    """Yield all items; the robot is already at its start, so that this needs no item."""
    yield Placed(speed_change(mission.robot.speed), "speed")
    for stop, number in zip(mission.stops, numbers, strict=True):
        for point in corners(stop.approach, within=options.max_lateral_m)[1:-1]:
            yield Placed(corner_waypoint(point, stop.tolerance_m, options), "corner", stop.id)
        yield from _stop_items(stop, number, options)
    tolerance_m = mission.stops[-1].tolerance_m
    for point in corners(mission.return_ or (), within=options.max_lateral_m)[1:]:
        yield Placed(corner_waypoint(point, tolerance_m, options), "return")


def _stop_items(stop: Stop, number: int, options: TranslationOptions) -> Iterator[Placed]:
    yield Placed(stop_waypoint(stop, options), "stop", stop.id)
    if stop.settle_s > 0 and options.settle == "delay":
        yield Placed(delay(stop.settle_s), "settle", stop.id)
    if options.trigger == "script":
        yield Placed(script_message(stop, number), "trigger", stop.id)
    if options.trigger == "camera":
        yield Placed(capture(number), "trigger", stop.id)
    wait = script_time(stop, number) if options.scan_wait == "script_time" else delay(stop.scan.duration_s)
    yield Placed(wait, "scan", stop.id)


def _without_repeats(placed: Iterable[Placed]) -> Iterator[Placed]:
    """Leave out a corner that equals the waypoint before it, in steps of 1e-7 degrees."""
    before: Item | None = None
    for one in placed:
        passing = one.role in ("corner", "return")
        if passing and before is not None and (before.x, before.y) == (one.item.x, one.item.y):
            continue
        if one.item.command == Command.NAV_WAYPOINT:
            before = one.item
        yield one
