"""QGC WPL 110, the table that Mission Planner, MAVProxy and QGroundControl read; row 0 is home."""

from __future__ import annotations

import math
from collections.abc import Sequence

from stopgo.mission.document import Mission, Point
from stopgo.mission.files.exports.format import Supplements
from stopgo.mission.files.exports.qgc_plan import FILE_FRAMES, items_of, place
from stopgo.mission.files.imports import qgc_waypoints
from stopgo.mission.files.imports.qgc_waypoints import HEAD
from stopgo.mission.files.imports.track import ImportOptions
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.read_back import home_item


def write(mission: Mission, supplements: Supplements) -> bytes:
    """The table: tabs, twelve columns, ten decimals of degrees, the site's origin as home."""
    items = items_of(mission, supplements)
    return listed([home_item(items.origin), *items.items])


def listed(rows: Sequence[Item]) -> bytes:
    """The table of any items, home first."""
    return "".join(f"{line}\n" for line in (HEAD, *map(_row, range(len(rows)), rows))).encode()


def read_back(data: bytes, mission: Mission, supplements: Supplements) -> list[Point]:
    """The stops as `stopgo import` finds them."""
    given = ImportOptions(mission.georeference, supplements.autopilot)
    return [visit.xy for visit in qgc_waypoints.read(data, "waypoints", given).visits]


def notes(mission: Mission, supplements: Supplements) -> tuple[str, ...]:
    """Return the notes on the autopilot's limits, and on values that the table has no column for."""
    heading = "the bearing of the site's +y axis and the stops' ids are not in this table"
    return (heading, *items_of(mission, supplements).notes)


def _row(number: int, item: Item) -> str:
    """Sequence, current, frame, command, param1 to param4, latitude, longitude, height, autocontinue."""
    lat, lon = place(item)
    numbers = [*map(_number, item.params), f"{lat:.10f}", f"{lon:.10f}", f"{item.z:.6f}"]
    frame = FILE_FRAMES.get(item.frame, item.frame)
    head = [str(number), str(int(number == 0)), str(frame), str(item.command)]
    return "\t".join((*head, *numbers, str(int(item.autocontinue))))


def _number(value: float) -> str:
    return "nan" if math.isnan(value) else f"{value:.8f}"
