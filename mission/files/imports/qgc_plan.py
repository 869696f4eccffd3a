"""Reader of QGroundControl's .plan: its simple items, with home as the site's origin unless given."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.mission.files.imports.item_track import Listed, assumptions, autopilot_for, track_of
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions
from stopgo.mission.frames.transform import SiteOrigin

NAN = float("nan")
LARGEST_CODE = 65_535
"""Of a command or a frame."""
LARGEST = 1e15
"""No number in a plan is larger."""


def read(data: bytes, source: str, given: ImportOptions) -> ImportedRoute:
    """The track of a plan.

    Raises
    ------
    InputError
        Naming what is missing, of another version, or means something that a mission cannot say.
    """
    plan = _object(_parsed(data, source), "the file", source)
    if plan.get("fileType") != "Plan":
        raise InputError(f"{source}: fileType is {_shown(plan.get('fileType'))}, not 'Plan'; give a .plan")
    _check_version(plan, "version", 1, source)
    mission = _object(plan.get("mission"), "mission", source)
    _check_version(mission, "mission.version", 2, source)
    ours = plan.get("stopgo")
    origin = given.origin or _home(mission, ours, source)
    items = [_listed(item, number, source) for number, item in enumerate(_items(mission, source), 1)]
    named = [_named(item, ours) for item in items]
    firmware = mission.get("firmwareType")
    autopilot = autopilot_for(given.autopilot, firmware if isinstance(firmware, int) else 0)
    track = track_of(named, origin=origin, autopilot=autopilot, source=source)
    told = isinstance(ours, dict) and _is_number(ours.get("heading_deg"))
    return _noted(track, plan, assumptions(given, heading=told, firmware=True))


def _parsed(data: bytes, source: str) -> object:
    try:
        return json.loads(data.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        raise InputError(f"{source}: not UTF-8 text (byte {error.start}); give a .plan") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply; give a .plan") from None
    except ValueError as error:  # not JSON, or an integer with thousands of digits
        raise InputError(f"{source}: not JSON, or cut off ({error}); give a .plan") from None


def _object(value: object, name: str, source: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{source}: {name} is {_shown(value)}, not an object; save the plan again")
    return value


def _check_version(document: dict[str, Any], name: str, known: int, source: str) -> None:
    version = document.get("version")
    if version != known or isinstance(version, bool):
        raise InputError(
            f"{source}: {name} is {_shown(version)}, and only {known} is read; "
            "open it in QGroundControl and save it again"
        )


def _home(mission: dict[str, Any], ours: object, source: str) -> SiteOrigin:
    """Planned home as the origin; +y is north unless stopgo, which wrote the plan, says otherwise."""
    home = mission.get("plannedHomePosition")
    if not isinstance(home, list) or len(home) != 3 or not all(map(_is_number, home)):
        raise InputError(
            f"{source}: mission.plannedHomePosition is {_shown(home)}, not three numbers; "
            "give --origin LAT,LON,ALT,HEADING"
        )
    lat, lon, alt = map(float, home)
    if not (abs(lat) <= 90 and abs(lon) <= 180) or lat == lon == 0:
        raise InputError(
            f"{source}: home is at latitude {lat:g}, longitude {lon:g}, which is no position; "
            "give --origin LAT,LON,ALT,HEADING"
        )
    heading = ours.get("heading_deg", 0.0) if isinstance(ours, dict) else 0.0
    return SiteOrigin(lat=lat, lon=lon, alt=alt, heading_deg=float(heading) if _is_number(heading) else 0.0)


def _items(mission: dict[str, Any], source: str) -> list[Any]:
    items = mission.get("items")
    if not isinstance(items, list):
        raise InputError(f"{source}: mission.items is {_shown(items)}, not a list; save the plan again")
    return items


def _listed(value: object, number: int, source: str) -> Listed:
    item = _object(value, f"item {number}", source)
    if item.get("type") != "SimpleItem":
        kind = item.get("complexItemType", item.get("type"))
        raise InputError(
            f"{source}: item {number} is a {_shown(kind)}, which a scanning robot cannot drive; "
            "only simple waypoints, delays and triggers are read"
        )
    for key in ("command", "frame"):
        value = item.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= LARGEST_CODE:
            raise InputError(
                f"{source}: item {number}: {key} is {_shown(value)}, not a whole number up to 65535"
            )
    params = item.get("params")
    if not isinstance(params, list) or len(params) != 7:
        raise InputError(f"{source}: item {number}: params is {_shown(params)}, not a list of 7")
    if not all(value is None or _is_number(value) for value in params):
        raise InputError(f"{source}: item {number}: params holds something that is neither number nor null")
    numbers = tuple(NAN if value is None else float(value) for value in params)
    return Listed(number, item["command"], item["frame"], numbers)


def _named(item: Listed, ours: object) -> Listed:
    """Return the item with the id that stopgo wrote for its index."""
    stops = ours.get("stops") if isinstance(ours, dict) else None
    name = stops.get(str(item.number)) if isinstance(stops, dict) else None
    return Listed(item.number, item.command, item.frame, item.params, name if isinstance(name, str) else None)


def _noted(track: ImportedRoute, plan: dict[str, Any], assumed: tuple[str, ...]) -> ImportedRoute:
    left = [
        name for name, key in (("geofence", "geoFence"), ("rally points", "rallyPoints")) if _holds(plan, key)
    ]
    notes = tuple(f"the plan's {name} is not taken over: a mission has none" for name in left)
    return replace(track, notes=(*assumed, *notes))


def _holds(plan: dict[str, Any], key: str) -> bool:
    part = plan.get(key)
    return isinstance(part, dict) and any(isinstance(value, list) and value for value in part.values())


def _is_number(value: object) -> bool:
    """A finite number of a size that means something."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < LARGEST and math.isfinite(value)


def _shown(value: object) -> str:
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    text = "missing" if value is None else repr(value)
    return text if len(text) <= 40 else f"{text[:36]}…"
