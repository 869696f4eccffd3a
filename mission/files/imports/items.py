"""Mission items -> track: waypoints at which something is waited for or triggered are stops, others corners.

Only what a robot of stopgo would do in the same way is read; every other command is refused by its number,
for a mission that leaves out half of a plan is worse than none.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

from mission.document import Point, SiteOrigin
from mission.errors import InputError
from mission.files.imports.track import Track, Visit
from mission.geodesy import Geodetic, from_geodetic, heading_of
from mission.mavlink.autopilots import Autopilot, autopilot_named
from mission.mavlink.items import NAMES, Command
from mission.mavlink.writing import SCAN_MESSAGE

MOST = 65_535
"""Items a mission may have by the protocol."""
FARTHEST = 10_000.0
"""Metres from the origin beyond which a place is not of this site."""
GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)
"""MAV_FRAMEs in which a waypoint is a latitude and a longitude; heights are not used."""

TRIGGERS = (Command.DO_SET_RELAY, Command.DO_SET_SERVO, 203, Command.DO_SEND_SCRIPT_MESSAGE, 2000)
"""Commands that start a scan: relay, servo, DO_DIGICAM_CONTROL, message to a script, IMAGE_START_CAPTURE."""


@dataclass(frozen=True)
class Listed:
    """An item as a file lists it; `number` counts from 1 and leaves out home."""

    number: int
    command: int
    frame: int
    params: tuple[float, ...]
    """param1 to param7; degrees where the command has a place, NaN where the file says nothing."""
    id: str | None = None
    """Id of the stop, where the file names it."""

    def __str__(self) -> str:
        return f"item {self.number} ({NAMES.get(self.command, 'command')} {self.command})"


@dataclass
class _Place:
    """A waypoint and what follows it until the next."""

    waypoint: Listed
    xy: Point
    followers: list[Listed] = field(default_factory=list)


@dataclass(frozen=True)
class _Reading:
    source: str
    origin: SiteOrigin
    autopilot: Autopilot

    def refused(self, item: Listed, why: str) -> InputError:
        return InputError(f"{self.source}: {item} {why}")


def track_of(items: Sequence[Listed], *, origin: SiteOrigin, autopilot: str, source: str) -> Track:
    """The track of a list of items.

    Raises
    ------
    InputError
        Naming the item and its command, when it means something that a mission cannot say.
    """
    reading = _Reading(source, origin, autopilot_named(autopilot))
    if len(items) > MOST:
        raise InputError(f"{source}: has {len(items)} items; a mission has at most {MOST}")
    speed, places = _places(items, reading)
    visited = _are_visited(places)
    if not any(visited):
        raise InputError(
            f"{source}: no waypoint has a hold, a delay or a trigger, so nothing says where to scan; "
            "give the waypoints to scan from a hold in seconds"
        )
    last = max(number for number, is_visit in enumerate(visited) if is_visit)
    visits = _numbered(list(_visits(places[: last + 1], visited, reading)))
    back = tuple(place.xy for place in places[last + 1 :])
    return Track(visits, back=back, origin=origin, speed=speed)


def autopilot_for(given: str | None, firmware: int | None = None) -> str:
    """By whose rule to read degrees: as given, or by the MAV_AUTOPILOT a plan was made for."""
    if given is not None:
        return autopilot_named(given).name
    return {3: "ardupilot", 12: "px4"}.get(firmware, "generic") if firmware is not None else "ardupilot"


def _places(items: Sequence[Listed], reading: _Reading) -> tuple[float | None, list[_Place]]:
    """Speed and waypoints; each waypoint with the waits and triggers after it."""
    speed, places = None, list[_Place]()
    for item in items:
        if item.command == Command.NAV_WAYPOINT:
            places.append(_Place(item, _xy(item, reading)))
        elif item.command == Command.DO_CHANGE_SPEED and not places:
            speed = _speed(item, reading)
        elif item.command in _FOLLOWERS:
            if not places:
                raise reading.refused(item, "stands before any waypoint; there is no place to do it at")
            _FOLLOWERS[item.command](item, reading)
            places[-1].followers.append(item)
        else:
            raise reading.refused(item, _why(item))
    if not places:
        raise InputError(f"{reading.source}: has no waypoint (NAV_WAYPOINT {Command.NAV_WAYPOINT})")
    return speed, places


def _why(item: Listed) -> str:
    if item.command == Command.DO_CHANGE_SPEED:
        return "changes the speed on the way; a mission has one speed, set it before the first waypoint"
    if item.command == 20:
        return "leaves the way back to the vehicle; draw it as waypoints"
    return "is nothing that a robot with a scanner does here; only waypoints, delays and triggers are read"


def _xy(item: Listed, reading: _Reading) -> Point:
    if item.frame not in GLOBAL_FRAMES:
        raise reading.refused(item, f"is in frame {item.frame}, which is no latitude and longitude")
    lat, lon = item.params[4:6]
    if not (abs(lat) <= 90 and abs(lon) <= 180):
        raise reading.refused(item, f"is at latitude {lat:g}, longitude {lon:g}, which is no place")
    if lat == lon == 0:
        raise reading.refused(item, "is at latitude 0, longitude 0, which autopilots take for no place")
    point = from_geodetic(reading.origin, Geodetic(lat=lat, lon=lon), reading.autopilot.rule)
    if not math.hypot(*point) <= FARTHEST:
        raise reading.refused(
            item, f"is more than {FARTHEST / 1000:g} km from the origin; give the site's with --origin"
        )
    _seconds(item, reading, "a hold")
    return point


def _seconds(item: Listed, reading: _Reading, what: str) -> None:
    if not 0 <= item.params[0] < 1e6:
        raise reading.refused(item, f"is {what} of {item.params[0]:g} s; it must be 0 or more, below 1e6")


def _speed(item: Listed, reading: _Reading) -> float:
    if item.params[0] not in (0.0, 1.0) or not 0 < item.params[1] < 1e3:
        raise reading.refused(
            item, f"sets speed {item.params[1]:g} of kind {item.params[0]:g}; need one in m/s"
        )
    return item.params[1]


def _check_delay(item: Listed, reading: _Reading) -> None:
    if item.params[0] <= 0 and any(part >= 0 for part in item.params[1:4]):
        raise reading.refused(item, "waits for a time of day; a mission waits for seconds")
    _seconds(item, reading, "a delay")


def _check_script(item: Listed, reading: _Reading) -> None:
    if not 0 <= item.params[1] < 1e6:
        raise reading.refused(item, f"waits at most {item.params[1]:g} s; it must be 0 or more, below 1e6")


def _check_capture(item: Listed, reading: _Reading) -> None:
    if item.params[2] != 1:
        raise reading.refused(item, f"takes {item.params[2]:g} pictures; a stop has one scan (param3 = 1)")


def _anything(item: Listed, reading: _Reading) -> None:
    """Whatever a trigger's numbers are, it is a trigger."""


_FOLLOWERS: dict[int, Callable[[Listed, _Reading], None]] = {
    **dict.fromkeys(TRIGGERS, _anything),
    Command.IMAGE_START_CAPTURE: _check_capture,
    Command.NAV_DELAY: _check_delay,
    Command.NAV_SCRIPT_TIME: _check_script,
}
"""What may follow a waypoint, and what is asked of it."""


def _are_visited(places: Sequence[_Place]) -> list[bool]:
    """Stops are where something follows; where nothing does in the whole list, where the vehicle holds.

    Beside waits and triggers a hold means only that the vehicle brakes, as at the corners for ArduPilot.
    """
    followed = [bool(place.followers) for place in places]
    return followed if any(followed) else [place.waypoint.params[0] > 0 for place in places]


def _visits(
    places: Sequence[_Place], visited: Sequence[bool], reading: _Reading
) -> Iterator[tuple[Visit, int]]:
    """Each visit with the number that its trigger carries, or 0."""
    via: list[Point] = []
    for place, is_visit in zip(places, visited, strict=False):
        if is_visit:
            yield replace(_visit(place, reading), via=tuple(via)), _carried(place)
            via = []
        else:
            via.append(place.xy)


def _visit(place: _Place, reading: _Reading) -> Visit:
    hold, radius, _, yaw = place.waypoint.params[:4]
    settle, scan = _waits(place, reading)
    known = reading.autopilot.keeps_arrival  # elsewhere the vehicle has neither radius nor yaw
    message = next((item for item in place.followers if _is_ours(item)), None)
    return Visit(
        place.xy,
        id=place.waypoint.id,
        heading=heading_of(reading.origin, yaw) if known and math.isfinite(yaw) else None,
        tolerance_m=radius if known and 0 < radius < math.inf else None,
        settle_s=settle if settle is not None else hold or None,
        scan_s=scan if scan is not None else (None if place.followers else hold),
        timeout_s=None if message is None else _positive(message.params[3]),
    )


def _waits(place: _Place, reading: _Reading) -> tuple[float | None, float | None]:
    """Seconds before and after the trigger; without one the last wait is the scan."""
    started = [number for number, item in enumerate(place.followers) if item.command in TRIGGERS]
    if len(started) > 1:
        raise reading.refused(
            place.followers[started[1]], "is a second trigger at one waypoint; a stop has one scan"
        )
    split = started[0] if started else len(place.followers) - 1
    before, after = place.followers[:split], place.followers[split:]
    message = next((item for item in after if _is_ours(item)), None)
    told = None if message is None else _positive(message.params[2])
    return _delays(before), told if told is not None else _delays(after)


def _delays(items: Sequence[Listed]) -> float | None:
    waits = [item.params[0] for item in items if item.command == Command.NAV_DELAY]
    return sum(waits) if waits else None


def _is_ours(item: Listed) -> bool:
    return item.command == Command.DO_SEND_SCRIPT_MESSAGE and item.params[0] == SCAN_MESSAGE


def _positive(value: float) -> float | None:
    return value if 0 < value < 1e6 else None


def _carried(place: _Place) -> int:
    """The stop's number that stopgo writes into what starts a scan."""
    for item in place.followers:
        number = item.params[1] if _is_ours(item) else item.params[3] if item.command == 2000 else 0.0
        if 0 < number < MOST and number == round(number):
            return int(number)
    return 0


def _numbered(visits: Sequence[tuple[Visit, int]]) -> tuple[Visit, ...]:
    """Visits with the ids that the file names, else by the numbers it carries, else by their places."""
    numbers = [number for _, number in visits]
    if 0 in numbers or len(set(numbers)) < len(numbers):
        numbers = list(range(1, len(visits) + 1))
    width = max(2, len(str(max(numbers))))
    named = [visit.id for visit, _ in visits]
    if None in named or len(set(named)) < len(named):
        named = [f"s{number:0{width}d}" for number in numbers]
    return tuple(replace(visit, id=name) for (visit, _), name in zip(visits, named, strict=True))
