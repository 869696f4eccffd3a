"""Text and JSON of a mission: the output of `show`."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from stopgo.mission.console.table import counted, duration, printable, table
from stopgo.mission.document import Mission
from stopgo.mission.document.limits import limits_in_words
from stopgo.mission.document.schedule import Schedule
from stopgo.mission.files.stop_list import COLUMNS, stop_list
from stopgo.mission.geometry import frozen, polyline_length


def mission_report(mission: Mission, times: Schedule) -> dict[str, Any]:
    """Return the output of `show` for a program."""
    return {
        **{"id": mission.id, "revision": mission.revision, "digest": mission.digest, "name": mission.name},
        **{"floor": mission.origin.floor, "robot": mission.robot, "scanner": mission.scanner},
        **{"start": mission.start, "stops": [stop.as_json() for stop in stop_list(mission, times)]},
        **{"route": {"length_m": route_length(mission), "returns": mission.return_ is not None}},
        "schedule": {
            **{"drive_s": times.drive_s, "turn_s": times.turn_s, "settle_s": times.settle_s},
            **{"scan_s": times.scan_s, "total_s": times.total_s},
        },
    }


def mission_text(mission: Mission, times: Schedule) -> str:
    """Return the mission as text: its head, the table of stops, and the totals."""
    stops = table(COLUMNS, [list(stop.cells.values()) for stop in stop_list(mission, times)])
    return "\n\n".join((_head(mission), stops, _totals(mission, times)))


def _head(mission: Mission) -> str:
    robot, scanner, start = mission.robot, mission.scanner, mission.start
    lines = {
        "mission": f"{mission.name}, {identity(mission)}",
        "digest": mission.digest,
        "floor": f"{mission.origin.floor}, sha256 {mission.origin.floor_digest[:12]}…",
        "robot": f"radius {robot.radius:g} m, {robot.speed:g} m/s, {robot.acceleration:g} m/s², "
        f"turns {math.degrees(robot.turn_rate):g} °/s",
        "scanner": f"profile {scanner.profile}, range {scanner.range:g} m, {scanner.fov_deg:g}°",
        **({"seen": limits} if (limits := ", ".join(limits_in_words(mission.limits).values())) else {}),
        "start": f"({start.x:.3f}, {start.y:.3f}) facing {math.degrees(start.heading):.1f}° ({start.reason})",
        "made by": f"stopgo {mission.origin.stopgo}",
    }
    return "\n".join(f"{name:8} {printable(value)}" for name, value in lines.items())


def identity(mission: Mission) -> str:
    return f"id {mission.id} revision {mission.revision}"


def _totals(mission: Mission, times: Schedule) -> str:
    doorways = sum(stop.doorway for stop in mission.stops)
    units = sum(stop.sees.new_units for stop in mission.stops)
    ends = "and back to the start" if mission.return_ is not None else "ending at the last stop"
    return (
        f"{counted(len(mission.stops), 'stop')}, {doorways} of them in doorways; {units} units covered; "
        f"route {route_length(mission):.2f} m {ends}\n"
        f"driving {duration(times.drive_s)}, turning {duration(times.turn_s)}, "
        f"settling {duration(times.settle_s)}, scanning {duration(times.scan_s)}: "
        f"in all {duration(times.total_s)}"
    )


def route_length(mission: Mission) -> float:
    return sum(map(_length, (*(stop.approach for stop in mission.stops), mission.return_ or ())))


def _length(leg: tuple[tuple[float, float], ...]) -> float:
    return polyline_length(frozen(leg).reshape(-1, 2))


def json_text(document: dict[str, Any]) -> str:
    return msgspec.json.format(msgspec.json.encode(document), indent=2).decode()
