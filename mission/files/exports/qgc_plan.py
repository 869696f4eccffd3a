"""QGroundControl's .plan: the items for an autopilot, with home at the site's origin."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import msgspec

from stopgo.mission.document import Mission, Point
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.imports import qgc_plan
from stopgo.mission.files.imports.track import ImportOptions
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE
from stopgo.mission.mavlink.fields import PLACED
from stopgo.mission.mavlink.items import Command, Item, ItemList, MavFrame
from stopgo.mission.mavlink.translate import translate

FIRMWARE = {"generic": 0, "ardupilot": 3, "px4": 12}
"""MAV_AUTOPILOT of each autopilot."""
GROUND_ROVER = 10
"""MAV_TYPE."""
RELATIVE = 1
"""QGroundControl's AltitudeMode: above home."""
ABOVE_HOME = (MavFrame.GLOBAL_RELATIVE_ALT, MavFrame.GLOBAL_RELATIVE_ALT_INT)

FILE_FRAMES = {
    MavFrame.GLOBAL_INT: MavFrame.GLOBAL,
    MavFrame.GLOBAL_RELATIVE_ALT_INT: MavFrame.GLOBAL_RELATIVE_ALT,
}
"""Files give positions in degrees, so their frames are those without INT."""


def write(mission: Mission, supplements: Supplements) -> bytes:
    """Return the plan; `stopgo` holds what items cannot: stop ids and the bearing of the site's +y axis."""
    items = items_of(mission, supplements)
    origin, speed = items.origin, mission.robot.speed
    own = {"heading_deg": origin.heading_deg, "stops": _ids(items)}
    home = (origin.lat, origin.lon, origin.alt)
    return listed(items.items, items.autopilot, home=home, speed=speed, own=own)


def listed(
    items: Sequence[Item],
    autopilot: str,
    *,
    home: tuple[float, float, float],
    speed: float,
    own: dict[str, Any] | None = None,
) -> bytes:
    """The plan of any items, home not among them; `own` is kept under `stopgo`."""
    plan = {
        **{"fileType": "Plan", "version": 1, "groundStation": "stopgo"},
        "mission": {
            **{"version": 2, "firmwareType": FIRMWARE[autopilot], "vehicleType": GROUND_ROVER},
            **{"cruiseSpeed": speed, "hoverSpeed": speed},
            **{"globalPlanAltitudeMode": RELATIVE},
            "plannedHomePosition": home,
            "items": [_simple(item, number) for number, item in enumerate(items, 1)],
        },
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "rallyPoints": {"points": [], "version": 2},
        **({} if own is None else {"stopgo": own}),
    }
    return msgspec.json.format(msgspec.json.encode(plan), indent=2) + b"\n"


def items_of(mission: Mission, supplements: Supplements) -> ItemList:
    """The items that `stopgo push --mavlink` sends with the same options."""
    return translate(
        mission,
        supplements.autopilot,
        trigger=supplements.trigger,
        scan_wait=supplements.scan_wait,
        settle=supplements.settle,
    )


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """The stops as `stopgo import` finds them."""
    return [visit.xy for visit in qgc_plan.read(data, "plan", ImportOptions(mission.georeference)).visits]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the notes on what the autopilot does not do by itself."""
    return items_of(mission, supplements).notes


def _simple(item: Item, number: int) -> dict[str, Any]:
    """Return an item in QGroundControl's form; null is NaN, "not given"."""
    numbers = [*item.params, *place(item), item.z]
    return {
        "type": "SimpleItem",
        **(_altitude(item) if item.command == Command.NAV_WAYPOINT and item.frame in ABOVE_HOME else {}),
        **{"autoContinue": item.autocontinue, "command": item.command, "doJumpId": number},
        "frame": FILE_FRAMES.get(item.frame, item.frame),
        "params": [None if math.isnan(value) else value for value in numbers],
    }


def place(item: Item) -> tuple[float, float]:
    """Return latitude and longitude in degrees, or the two plain numbers of a command without a position."""
    if item.command in PLACED:
        return item.x / STEPS_PER_DEGREE, item.y / STEPS_PER_DEGREE
    return float(item.x), float(item.y)


def _altitude(item: Item) -> dict[str, Any]:
    """QGroundControl wants all three keys or none."""
    return {"AMSLAltAboveTerrain": None, "Altitude": item.z, "AltitudeMode": RELATIVE}


def _ids(items: ItemList) -> dict[str, str]:
    """Id of each stop by the doJumpId of its waypoint."""
    return {
        str(number): placed.stop
        for number, placed in enumerate(items.placed, 1)
        if placed.role == "stop" and placed.stop is not None
    }
