"""Commands on a mission as it stands in its file: show it, check it."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from mission.document import Mission, Stop
from mission.errors import AnswerIsNo, InputError
from mission.files.mission_json import read
from mission.geometry import frozen, polyline_length
from mission.planning import Schedule
from mission.schedule import schedule
from mission.sense import Problem, problems_of
from mission.table import duration, printable, table

MissionFile = Annotated[Path, typer.Argument(metavar="MISSION", help="A mission.json.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout and nothing else.")]
Floor = Annotated[Path | None, typer.Option(help="The floor it was planned on; its digest is compared.")]


def add_commands(app: typer.Typer) -> None:
    """Add `show` and `check` to the front door."""
    app.command()(show)
    app.command()(check)


def show(mission: MissionFile, as_json: AsJson = False) -> None:
    """Show a mission as a table.

    Its stops stand in the order of driving, each with the planned time of arrival.

    Example: stopgo show out/mission.json
    """
    document = read(mission)
    for problem in problems_of(document)[:1]:
        raise AnswerIsNo(f"{mission}: {problem} (stopgo check {mission} lists all)")
    times = schedule(document)
    typer.echo(_json(_report(document, times)) if as_json else _page(document, times))


def check(mission: MissionFile, floor: Floor = None, as_json: AsJson = False) -> None:
    """Check that a mission makes sense.

    Schema, digest, numbers, legs that join up; and with --floor, that it was planned on that floor.

    Exit code 0: in order; 1: readable but senseless, or of another floor; 2: not readable.

    Example: stopgo check out/mission.json --floor office.dxf
    """
    document = read(mission)
    problems = (*problems_of(document), *(() if floor is None else _floor_problems(document, floor)))
    if as_json:
        typer.echo(_json(_verdict(mission, document, problems)))
    elif problems:
        typer.echo("\n".join(map(str, problems)))
    else:
        typer.echo(f"{mission}: in order; {_identity(document)}, {len(document.stops)} stops")
    if problems:
        raise AnswerIsNo(f"{mission}: {len(problems)} problem{'s' * (len(problems) > 1)}")


def _floor_problems(mission: Mission, floor: Path) -> tuple[Problem, ...]:
    try:
        digest = hashlib.sha256(floor.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{floor}: cannot be read ({error.strerror}); give the floor's file") from None
    if digest == mission.origin.floor_digest:
        return ()
    planned = mission.origin
    message = f"is {planned.floor_digest[:12]}… ({planned.floor}), but {floor} has {digest[:12]}…; plan again"
    return (Problem("$.origin.floor_digest", message),)


def _verdict(path: Path, mission: Mission, problems: tuple[Problem, ...]) -> dict[str, Any]:
    return {
        "file": str(path),
        "ok": not problems,
        "id": mission.id,
        "revision": mission.revision,
        "digest": mission.digest,
        "stops": len(mission.stops),
        "problems": [{"path": problem.path, "message": problem.message} for problem in problems],
    }


def _report(mission: Mission, times: Schedule) -> dict[str, Any]:
    """What `show` prints, for a program."""
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
        **{"route": {"length_m": _route_length(mission), "returns": mission.return_ is not None}},
        "schedule": {
            **{"drive_s": times.drive_s, "turn_s": times.turn_s, "settle_s": times.settle_s},
            **{"scan_s": times.scan_s, "total_s": times.total_s},
        },
    }


def _page(mission: Mission, times: Schedule) -> str:
    header = ("no", "stop", "x m", "y m", "heading °", "doorway", "approach m", "units", "new", "arrives")
    rows = [
        _row(number, stop, arrival)
        for number, (stop, arrival) in enumerate(zip(mission.stops, times.arrival_s, strict=True), 1)
    ]
    return "\n\n".join((_head(mission), table(header, rows), _totals(mission, times)))


def _head(mission: Mission) -> str:
    robot, scanner, start = mission.robot, mission.scanner, mission.start
    lines = {
        "mission": f"{mission.name}, {_identity(mission)}",
        "digest": mission.digest,
        "floor": f"{mission.origin.floor}, sha256 {mission.origin.floor_digest[:12]}…",
        "robot": f"radius {robot.radius:g} m, {robot.speed:g} m/s, {robot.acceleration:g} m/s², "
        f"turns {math.degrees(robot.turn_rate):g} °/s",
        "scanner": f"profile {scanner.profile}, range {scanner.range:g} m, {scanner.fov_deg:g}°",
        "start": f"({start.x:.3f}, {start.y:.3f}) facing {math.degrees(start.heading):.1f}° ({start.reason})",
        "made by": f"stopgo {mission.origin.stopgo}",
    }
    return "\n".join(f"{name:8} {printable(value)}" for name, value in lines.items())


def _identity(mission: Mission) -> str:
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
        f"route {_route_length(mission):.2f} m {ends}\n"
        f"driving {duration(times.drive_s)}, turning {duration(times.turn_s)}, "
        f"settling {duration(times.settle_s)}, scanning {duration(times.scan_s)}: "
        f"in all {duration(times.total_s)}"
    )


def _route_length(mission: Mission) -> float:
    return sum(map(_length, (*(stop.approach for stop in mission.stops), mission.return_ or ())))


def _length(leg: tuple[tuple[float, float], ...]) -> float:
    return polyline_length(frozen(leg).reshape(-1, 2))


def _json(document: dict[str, Any]) -> str:
    return msgspec.json.format(msgspec.json.encode(document), indent=2).decode()
