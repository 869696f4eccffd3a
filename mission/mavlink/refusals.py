"""Reasons not to send a mission: it is implausible as items, or it needs values that the vehicle drops."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stopgo.mission.console.table import counted
from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.problems import problems_of
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.frames.geodesy import LATITUDE_LIMIT
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.fields import as_sent
from stopgo.mission.mavlink.items import Command, Placed
from stopgo.mission.mavlink.translation_options import TranslationOptions
from stopgo.mission.run.scans import needs_heading

LONGEST_SCRIPT_S = 255
"""NAV_SCRIPT_TIME keeps its timeout in a uint8."""
LARGEST_SCRIPT_NUMBER = 32_767
"""NAV_SCRIPT_TIME keeps the stop's number in an int16."""


def origin_of(mission: Mission) -> SiteOrigin:
    """Return the site's origin on the earth."""
    if mission.georeference is None:
        raise InputError(
            f"{mission.name}: no georeference; autopilots use only degrees; "
            "plan again with --origin LAT,LON,ALT,HEADING"
        )
    return mission.georeference


def check(mission: Mission, numbers: tuple[int, ...], options: TranslationOptions) -> None:
    """Refuse a mission that the vehicle would not execute as written."""
    _check_options(options)
    _check_origin(mission, options.origin)
    for problem in problems_of(mission):
        raise InputError(f"{mission.name}: {problem}; correct the mission or plan it again")
    _check_heading(mission, options.vehicle)
    for stop, number in zip(mission.stops, numbers, strict=True):
        _check_waits(mission, stop, options)
        _check_handshake(mission, stop, number, options)


def check_fields(mission: Mission, placed: Sequence[Placed]) -> None:
    """Refuse numbers that a float32 on the link does not hold; NaN is allowed where it is intended."""
    for one in placed:
        for number, (value, sent) in enumerate(
            zip(one.item.params, as_sent(one.item).params, strict=True), start=1
        ):
            if math.isinf(sent):
                whose = "robot" if one.stop is None else f"stop {one.stop}"
                raise InputError(
                    f"{mission.name}: {whose}: param{number} of {one.item.name} would be {value:g}, "
                    "more than a float32 holds; correct the mission"
                )


def check_count(mission: Mission, placed: Sequence[Placed], vehicle: Autopilot, most: int) -> None:
    """Refuse more items than the vehicle holds, with home if it holds that too."""
    count = vehicle.sequence(len(placed))
    if count <= most:
        return
    least = count - sum(one.role == "settle" for one in placed)
    enough = "which is enough" if least <= most else "which is not enough"
    with_hold = f"--settle-item hold makes it {least}, {enough}; or " if least < count else ""
    raise NegativeResult(
        f"{mission.name}: {counted(len(mission.stops), 'stop makes', 'stops make')} {count} items, "
        f"{vehicle.name} holds {most}; "
        f"{with_hold}plan fewer stops at once"
    )


def _check_options(options: TranslationOptions) -> None:
    needs = {"script": Command.DO_SEND_SCRIPT_MESSAGE, "camera": Command.IMAGE_START_CAPTURE}
    taken, name = options.vehicle.commands, options.vehicle.name
    if options.trigger != "none" and needs.get(options.trigger) not in taken:
        raise InputError(f"{name} has no trigger {options.trigger!r}; choose camera or none")
    if options.scan_wait == "script_time" and Command.NAV_SCRIPT_TIME not in taken:
        raise InputError(f"{name} has no NAV_SCRIPT_TIME; wait for a scan by delay")
    if not 0 <= options.max_lateral_m < math.inf:
        raise InputError(f"max_lateral_m is {options.max_lateral_m}; it must be finite and not negative")


def _check_origin(mission: Mission, origin: SiteOrigin) -> None:
    for key in ("lat", "lon", "alt", "heading_deg"):
        if not math.isfinite(getattr(origin, key)):
            raise InputError(
                f"{mission.name}: georeference.{key} is {getattr(origin, key)}; give a number with --origin"
            )
    if abs(origin.lat) > LATITUDE_LIMIT:
        raise InputError(
            f"{mission.name}: georeference.lat is {origin.lat}; autopilots' metres end at "
            f"±{LATITUDE_LIMIT:g}°, give another position with --origin"
        )


def _check_heading(mission: Mission, vehicle: Autopilot) -> None:
    """Refuse a scanner with a limited view on a vehicle that ignores the planned heading."""
    if needs_heading(mission.scanner) and not vehicle.turns:
        stop, fov = mission.stops[0], mission.scanner.fov_deg
        heading = math.degrees(stop.heading)
        why = "turns no rover to it" if vehicle.keeps_arrival else "drops it"
        raise NegativeResult(
            f"{mission.name}: stop {stop.id}: heading {heading:.1f}° is needed (scanner.fov_deg is {fov:g}), "
            f"and {vehicle.name} {why}; plan with --fov 360, or push to a robot of stopgo"
        )


def _check_waits(mission: Mission, stop: Stop, options: TranslationOptions) -> None:
    longest = options.vehicle.max_delay_s
    for field, seconds in {"settle_s": stop.settle_s, "scan.duration_s": stop.scan.duration_s}.items():
        if seconds > longest:
            raise NegativeResult(
                f"{mission.name}: stop {stop.id}: {field} is {seconds:g}, longer than the {longest:.0f} s "
                f"that {options.vehicle.name} waits; shorten it"
            )
    if options.settle == "hold" and not _can_be_held(stop.settle_s, options.vehicle):
        raise NegativeResult(
            f"{mission.name}: stop {stop.id}: settle_s is {stop.settle_s:g}, a hold is whole seconds up to "
            f"{options.vehicle.longest_hold_s:.0f}; round it or settle by delay"
        )


def _can_be_held(seconds: float, vehicle: Autopilot) -> bool:
    return seconds == round(seconds) and seconds <= vehicle.longest_hold_s


def _check_handshake(mission: Mission, stop: Stop, number: int, options: TranslationOptions) -> None:
    if options.scan_wait != "script_time":
        return
    if stop.scan.timeout_s > LONGEST_SCRIPT_S:
        raise NegativeResult(
            f"{mission.name}: stop {stop.id}: scan.timeout_s is {stop.scan.timeout_s:g}, NAV_SCRIPT_TIME "
            f"holds {LONGEST_SCRIPT_S} s; shorten it or wait by delay"
        )
    if number > LARGEST_SCRIPT_NUMBER:
        raise NegativeResult(
            f"{mission.name}: stop {stop.id}: number {number} is above the {LARGEST_SCRIPT_NUMBER} that "
            "NAV_SCRIPT_TIME holds; wait by delay"
        )
