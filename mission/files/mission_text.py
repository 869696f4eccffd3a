"""Text and JSON of a mission: the output of `show`."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from stopgo.mission.console.table import duration, printable, table
from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.limits import limits_in_words
from stopgo.mission.document.schedule import Schedule
from stopgo.mission.geometry import frozen, polyline_length


def mission_report(mission: Mission, times: Schedule) -> dict[str, Any]:
    """Return the output of `show` for a program."""
    stops = [
        {
            **{"number": number, "id": stop.id, "x": stop.x, "y": stop.y},
            **{"heading_deg": math.degrees(stop.heading), "doorway": stop.doorway},
            **{"approach_m": _length(stop.approach), "units": stop.sees.units},
            **{"new_units": stop.sees.new_units, "arrival_s": float(arrival)},
        }
        for number, (stop, arrival) in enumerate(zip(mission.stops, times.arrival_s, strict=True), 1)
    ]
    return {
        **{"id": mission.id, "revision": mission.revision, "digest": mission.digest, "name": mission.name},
        **{"floor": mission.origin.floor, "robot": mission.robot, "scanner": mission.scanner},
        **{"start": mission.start, "stops": stops},
        **{"route": {"length_m": route_length(mission), "returns": mission.return_ is not None}},
        "schedule": {
            **{"drive_s": times.drive_s, "turn_s": times.turn_s, "settle_s": times.settle_s},
            **{"scan_s": times.scan_s, "total_s": times.total_s},
        },
    }


def mission_text(mission: Mission, times: Schedule) -> str:
    """Return the mission as text: its head, the table of stops, and the totals."""
    header = ("no", "stop", "x m", "y m", "heading °", "doorway", "approach m", "units", "new", "arrives")
    rows = [
        _row(number, stop, arrival)
        for number, (stop, arrival) in enumerate(zip(mission.stops, times.arrival_s, strict=True), 1)
    ]
    return "\n\n".join((_head(mission), table(header, rows), _totals(mission, times)))


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


def _row(number: int, stop: Stop, arrival: float) -> tuple[str, ...]:
    return (
        *(str(number), stop.id, f"{stop.x:.3f}", f"{stop.y:.3f}", f"{math.degrees(stop.heading):.1f}"),
        *("yes" if stop.doorway else "", f"{_length(stop.approach):.2f}"),
        *(str(stop.sees.units), str(stop.sees.new_units), duration(arrival)),
    )


def _totals(mission: Mission, times: Schedule) -> str:
    doorways = sum(stop.doorway for stop in mission.stops)
    units = sum(stop.sees.new_units for stop in mission.stops)
    ends = "and back to the start" if mission.return_ is not None else "ending at the last stop"
    return (
        f"{len(mission.stops)} stops, {doorways} of them in doorways; {units} units seen; "
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
