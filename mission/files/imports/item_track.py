"""Mission items of a file -> track: waypoints with a wait or a trigger are stops.

Only items that a stopgo robot executes in the same way are read. Every other command is refused by its
number, because half of a plan is worse than none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import takewhile

from stopgo.mission.errors import InputError
from stopgo.mission.files.imports import track
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.items import NAMES, Command, Item, Placed
from stopgo.mission.mavlink.recognise import GLOBAL_FRAMES, PLACES, TRIGGERS, WAITS, recognise
from stopgo.mission.mavlink.recognised_tour import RecognisedStop, RecognisedTour, recognised_tour
from stopgo.mission.mavlink.writing import SCAN_MESSAGE

MOST = 65_535
"""Items a mission may have by the protocol."""
LONGEST = 1e6
"""Seconds; no wait is longer."""
BRAKING = 1.0
"""Seconds of hold by which ArduPilot is made to stop at a corner."""
FARTHEST = 10_000.0
"""Metres from the origin beyond which a position does not belong to this site."""


@dataclass(frozen=True)
class Listed:
    """An item as a file lists it; `number` counts from 1 and leaves out home."""

    number: int
    command: int
    frame: int
    params: tuple[float, ...]
    """param1 to param7; degrees if the command has a position, NaN if the file contains nothing."""
    id: str | None = None
    """Id of the stop, where the file names it."""

    def __str__(self) -> str:
        return f"item {self.number} ({NAMES.get(self.command, 'command')} {self.command})"


def track_of(items: Sequence[Listed], *, origin: SiteOrigin, autopilot: str, source: str) -> ImportedRoute:
    """The track of a list of items.

    Raises
    ------
    InputError
        Naming the item and its command, when it means something that a mission cannot say.
    """
    if len(items) > MOST:
        raise InputError(f"{source}: has {len(items)} items; a mission has at most {MOST}")
    _check_items(items, source)
    told = [_item(item) for item in items]
    try:
        placed = recognise(told)
        _check_pauses(placed, items)
        tour = recognised_tour(placed, origin, autopilot)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    for visit in tour.visits:
        if math.hypot(*visit.at) > FARTHEST:
            raise InputError(
                f"{source}: {items[visit.index]} is {math.hypot(*visit.at) / 1000:.0f} km from the site's "
                "origin; give the site's own with --origin"
            )
    names = _names(tour, items)
    visits = [_visit(visit, name, items, autopilot) for visit, name in zip(tour.visits, names, strict=True)]
    return ImportedRoute(tuple(visits), back=tour.back, origin=origin, speed=tour.speed)


def autopilot_for(given: str | None, firmware: int | None = None) -> str:
    """Return the autopilot whose rule the degrees follow: as given, else the plan's, else ArduPilot's."""
    if given is not None:
        return autopilot_named(given).name
    return "ardupilot" if firmware is None else {3: "ardupilot", 12: "px4"}.get(firmware, "generic")


def assumptions(given: ImportOptions, *, heading: bool, firmware: bool) -> tuple[str, ...]:
    """Return the assumptions, a line each; `heading` and `firmware` are those of the file itself."""
    lines = []
    if given.origin is None and not heading:
        lines.append("no --origin: the site's origin is the file's home, its +y axis north")
    if given.autopilot is None and not firmware:
        lines.append("no --autopilot: degrees are read by ArduPilot's rule; PX4's differs by mm per metre")
    return tuple(lines)


def _check_items(items: Sequence[Listed], source: str) -> None:
    driven = False
    for item in items:
        why = "changes the speed during the drive; a mission has one speed, set it before the first waypoint"
        if not (driven and item.command == Command.DO_CHANGE_SPEED):
            why = _CHECKS.get(item.command, _stranger)(item)
        if why:
            raise InputError(f"{source}: {item} {why}")
        driven = driven or item.command in PLACES


def _stranger(item: Listed) -> str:
    if item.command == 20:
        return "leaves the path back to the vehicle; draw it as waypoints"
    return "is nothing that a scanning robot does; only waypoints, delays and triggers are read"


def _place(item: Listed) -> str:
    lat, lon = item.params[4:6]
    if item.frame not in GLOBAL_FRAMES:
        return f"is in frame {item.frame}, which is no latitude and longitude"
    if not (abs(lat) <= 90 and abs(lon) <= 180) or lat == lon == 0:
        return f"is at latitude {lat:g}, longitude {lon:g}, which is no position"
    return _seconds(item)


def _seconds(item: Listed) -> str:
    held = item.params[0]
    return "" if 0 <= held < LONGEST else f"waits {held:g} s; it must be 0 or more, below {LONGEST:g}"


def _delay(item: Listed) -> str:
    """A delay of 0 or less counts until a time of day, if one is given."""
    if item.params[0] <= 0 and any(part >= 0 for part in item.params[1:4]):
        return "waits for a time of day; a mission waits for seconds"
    return _seconds(item)


def _speed(item: Listed) -> str:
    kind, speed = item.params[:2]
    if kind in (0.0, 1.0) and 0 < speed < 1e3:
        return ""
    return f"sets speed {speed:g} of kind {kind:g}; a mission needs metres per second"


def _capture(item: Listed) -> str:
    pictures = item.params[2]
    return "" if pictures == 1 else f"takes {pictures:g} pictures; a stop has one scan (param3 = 1)"


def _whatever(item: Listed) -> str:
    """A trigger is one, whatever its numbers are."""
    return ""


_CHECKS: dict[int, Callable[[Listed], str]] = {
    **dict.fromkeys(PLACES, _place),
    **dict.fromkeys(WAITS | TRIGGERS, _whatever),
    Command.NAV_DELAY: _delay,
    Command.IMAGE_START_CAPTURE: _capture,
    Command.DO_CHANGE_SPEED: _speed,
}
"""Checks of an item by its command; each returns the problem, or an empty text."""


def _check_pauses(placed: Sequence[Placed], items: Sequence[Listed]) -> None:
    """Refuse a wait at a corner, except a braking hold, as ArduPilot needs."""
    for one, item in zip(placed, items, strict=True):
        if one.role in ("corner", "return") and item.params[0] > BRAKING:
            raise InputError(
                f"{item} waits {item.params[0]:g} s and scans nothing there, while others do; "
                "take the wait out, or have it followed by a trigger"
            )


def _item(item: Listed) -> Item:
    """Return the item as it would be sent."""
    p1, p2, p3, p4, x, y, z = item.params
    steps = STEPS_PER_DEGREE if item.command in PLACES else 1
    whole = [round(value * steps) if abs(value) < 2**31 else 0 for value in (x, y)]  # NaN is not below it
    return Item(item.command, item.frame, params=(p1, p2, p3, p4), x=whole[0], y=whole[1], z=z)


def _names(tour: RecognisedTour, items: Sequence[Listed]) -> list[str]:
    """Ids that the file names, else those that stopgo gives to the numbers the triggers carry."""
    named = [name for visit in tour.visits if (name := items[visit.index].id) is not None]
    if len(set(named)) == len(tour.visits):
        return named
    numbers = [visit.number for visit in tour.visits if visit.number]
    if len(set(numbers)) < len(tour.visits):
        numbers = list(range(1, len(tour.visits) + 1))
    width = max(2, len(str(max(numbers))))
    return [f"s{number:0{width}d}" for number in numbers]


def _visit(visit: RecognisedStop, name: str, items: Sequence[Listed], autopilot: str) -> track.Visit:
    done = _done_at(visit, items)
    radius = items[visit.index].params[1]
    kept = autopilot_named(autopilot).keeps_arrival and 0 < radius < math.inf
    message = next((item.params for item in done if _is_ours(item)), None)
    return track.Visit(
        visit.at,
        via=visit.through,
        id=name,
        heading=visit.heading,
        settle_s=visit.settle_s if done else None,
        scan_s=visit.scan_s if visit.scan_s is not None or message is None else _seconds_in(message[2]),
        timeout_s=None if message is None else _seconds_in(message[3]),
        tolerance_m=radius if kept else None,
    )


def _done_at(visit: RecognisedStop, items: Sequence[Listed]) -> list[Listed]:
    """The items between a stop's waypoint and the next."""
    after = (items[index] for index in range(visit.index + 1, len(items)))
    return list(takewhile(lambda item: item.command not in PLACES, after))


def _is_ours(item: Listed) -> bool:
    """Return True for the message that makes a script scan: it carries duration and timeout."""
    return item.command == Command.DO_SEND_SCRIPT_MESSAGE and item.params[0] == SCAN_MESSAGE


def _seconds_in(value: float) -> float | None:
    return value if 0 < value < LONGEST else None
