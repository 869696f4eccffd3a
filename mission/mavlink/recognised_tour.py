"""Recognised items -> a route past scan stops in the site's frame, in metres and seconds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stopgo.mission.document import Point
from stopgo.mission.errors import InputError
from stopgo.mission.frames.geodesy import from_geodetic, from_steps, heading_of
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.items import Command, Item, Placed
from stopgo.mission.mavlink.recognise import number_carried

FAR_M = 100_000.0
"""Metres from a site's origin beyond which a position belongs to another site."""


@dataclass(frozen=True)
class RecognisedStop:
    """A scan stop as the items describe it."""

    at: Point
    """Metres in the site's frame."""
    heading: float | None
    """Radians counter-clockwise from +x; None if not given, or dropped."""
    settle_s: float
    scan_s: float | None
    """None if not given, or if a script ends the scan."""
    number: int | None
    """Number that its trigger carries; None if it carries none, or the same as another's."""
    through: tuple[Point, ...]
    """Corners of the leg from the previous stop."""
    index: int
    """Index of its waypoint in the list."""


@dataclass(frozen=True)
class RecognisedTour:
    """A route past scan stops as the items describe it."""

    visits: tuple[RecognisedStop, ...]
    back: tuple[Point, ...]
    """Points driven through after the last stop."""
    speed: float | None
    """Metres per second of the first change of speed."""


def recognised_tour(
    placed: Sequence[Placed], origin: SiteOrigin, autopilot: str = "ardupilot", *, first: int = 1
) -> RecognisedTour:
    """Return the stops and the route in the site's frame, of items from `recognise` or `translate`.

    `first` is the number of the first item in error messages.

    Raises
    ------
    InputError
        If a position is too far from the origin to be of this site.
    """
    vehicle = autopilot_named(autopilot)
    numbers = _distinct_numbers(placed)
    visits: list[RecognisedStop] = []
    through: list[Point] = []
    for index, one in enumerate(placed):
        if one.role in ("corner", "return"):
            through.append(_point(one.item, first + index, origin, vehicle))
        elif one.role == "stop":
            at = _point(one.item, first + index, origin, vehicle)
            settle, scan = _times(placed, index)
            heading = _heading(one.item, origin, vehicle)
            visits.append(
                RecognisedStop(at, heading, settle, scan, numbers.get(len(visits)), tuple(through), index)
            )
            through = []
    speeds = [one.item.params[1] for one in placed if one.role == "speed"]
    return RecognisedTour(tuple(visits), tuple(through), speeds[0] if speeds else None)


def _heading(item: Item, origin: SiteOrigin, vehicle: Autopilot) -> float | None:
    """Return radians; None of a vehicle that drops it and reads back 0."""
    yaw = item.params[3]
    return heading_of(origin, yaw) if vehicle.keeps_arrival and math.isfinite(yaw) else None


def _times(placed: Sequence[Placed], index: int) -> tuple[float, float | None]:
    """Return the seconds of settling and of scanning.

    A hold is settling if there is no other wait, and the scan if there is no other action.
    """
    hold = placed[index].item.params[0]
    done = [one for one in _after(placed, index) if one.role != "speed"]
    if not done:
        return 0.0, hold or None
    settle = sum(one.item.params[0] for one in done if one.role == "settle")
    scans = [
        one.item.params[0] for one in done if one.role == "scan" and one.item.command == Command.NAV_DELAY
    ]
    return settle or hold, sum(scans) if scans else None


def _after(placed: Sequence[Placed], index: int) -> Iterator[Placed]:
    """Yield the items executed at the waypoint at `index`."""
    for one in placed[index + 1 :]:
        if one.role in ("stop", "corner", "return"):
            return
        yield one


def _distinct_numbers(placed: Sequence[Placed]) -> dict[int, int]:
    """Return the number of each stop, by its index among the stops; empty if two have the same."""
    numbers: dict[int, int] = {}
    stop = -1
    for one in placed:
        stop += one.role == "stop"
        number = number_carried(one.item) if one.role in ("trigger", "scan") else None
        if number is not None:
            numbers.setdefault(stop, number)
    return numbers if len(set(numbers.values())) == len(numbers) else {}


def _point(item: Item, number: int, origin: SiteOrigin, vehicle: Autopilot) -> Point:
    place = from_steps(item.x, item.y)
    point = from_geodetic(origin, place, vehicle.rule)
    if not math.hypot(*point) <= FAR_M:
        raise InputError(
            f"item {number}: {place.lat:.7f}, {place.lon:.7f} is {math.hypot(*point) / 1000:.0f} km from the "
            f"site's origin {origin.lat:.7f}, {origin.lon:.7f}: another site; give its --origin"
        )
    return point
