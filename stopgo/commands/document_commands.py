"""Commands on mission files: show, check, export, import."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.bridge.commands.bridge_options import ItemTrigger, ScanWaiting, Settling
from stopgo.commands.align_command import align
from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import counted, printable, printable_lines
from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError, NegativeResult, OtherFloor
from stopgo.mission.files.atomic import must_not_replace, write_checked
from stopgo.mission.files.own_floor import must_be_own_floor
from stopgo.mission.files.plan_toml import read_settings, recorded_settings
from stopgo.mission.settings import PARAMETERS

if TYPE_CHECKING:
    from stopgo.mission.document import Mission
    from stopgo.mission.document.problems import Problem
    from stopgo.mission.files.exports.format import FloorDrawing, Supplements

MissionFile = Annotated[Path, typer.Argument(metavar="MISSION", help="A mission.json.")]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON object on stdout and nothing else.")]
Floor = Annotated[
    Path | None, typer.Option(help="The floor it was planned on, to check digest, clearances and coverage.")
]


def add_commands(app: typer.Typer) -> None:
    """Add the commands of this module to the front door."""
    app.command()(show)
    app.command()(check)
    app.command()(export)
    app.command(name="import")(import_command)
    app.command()(align)


def show(mission: MissionFile, as_json: AsJson = False) -> None:
    """Show a mission as a table.

    It lists the stops in the order of driving, each with the planned time of arrival.

    Example: stopgo show out/mission.json
    """
    from stopgo.mission.document.schedule import schedule
    from stopgo.mission.files.mission_json import read
    from stopgo.mission.files.mission_text import json_text, mission_report, mission_text

    document = read(mission)
    _check_problems(mission, document)
    times = schedule(document)
    typer.echo(json_text(mission_report(document, times)) if as_json else mission_text(document, times))


def check(
    mission: MissionFile,
    floor: Floor = None,
    coverage: Annotated[
        Path | None,
        typer.Option("--coverage-file", help="With --floor: the coverage.json that was written with it."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check that a mission is valid.

    It checks schema, digest, numbers, and that the legs join. With --floor it also checks that the mission
    was planned on that floor with its parameters, that stops and legs keep every clearance, and that the
    stops see the targets that the mission claims. All of it is computed again, each line of sight against
    every wall. With --coverage-file it checks the claims of that file.

    Exit code 0: valid; 1: readable but invalid, without clearance, or with more coverage claimed than its
    stops have; 2: not readable, or planned on another floor.

    Example: stopgo check out/mission.json --floor office.dxf
    """
    from stopgo.mission.files.mission_json import read
    from stopgo.mission.files.mission_text import identity, json_text

    document = read(mission)
    found = _checked(document, floor, coverage)
    _print_notes(found.notes)
    if as_json:
        typer.echo(json_text(_verdict(mission, document, found)))
    elif found.problems:
        typer.echo(printable_lines("\n".join(map(str, found.problems))))
    else:
        typer.echo(f"{mission}: valid; {identity(document)}, {counted(len(document.stops), 'stop')}")
    if found.coverage_text is not None and not as_json:
        typer.echo(f"coverage {found.coverage_text}")
    if found.problems:
        raise NegativeResult(f"{mission}: {counted(len(found.problems), 'problem')}")


@dataclass(frozen=True)
class _Checked:
    """Result of a check: problems, recomputed coverage, and notes on parts that were not checked."""

    problems: tuple[Problem, ...]
    coverage: dict[str, Any] | None = None
    coverage_text: str | None = None
    notes: tuple[str, ...] = ()


def _checked(mission: Mission, floor: Path | None, coverage: Path | None) -> _Checked:
    from stopgo.mission.document.problems import problems_of
    from stopgo.mission.files.coverage_json import read_coverage

    problems = problems_of(mission)
    if floor is None:
        if coverage is not None:
            raise InputError(f"--coverage-file {coverage}: needs the floor; give it with --floor")
        return _Checked(problems)
    claims = None if coverage is None else read_coverage(coverage, mission)
    try:
        must_be_own_floor(floor, mission)
    except OtherFloor as other:
        raise OtherFloor(f"{other}{_fit_on_other_floor(mission, floor)}") from None
    try:
        from stopgo.planner.checking.verdict import verdict

        with running(f"checking the mission against {floor}"):
            found = verdict(mission, floor, claims)
    except ModuleNotFoundError as error:
        if not _is_library(error):
            raise
        unchecked = "neither clearances nor coverage were checked"
        note = f'{error.name} is not installed, so {unchecked}; pip install "stopgo[plan]"'
        return _Checked(problems, notes=(note,))
    counted = found.counted
    return _Checked(
        (*problems, *found.problems),
        coverage=None if counted is None else counted.as_json(),
        coverage_text=None if counted is None else counted.in_words(),
        notes=found.notes,
    )


def _fit_on_other_floor(mission: Mission, floor: Path) -> str:
    """Return in words if the mission fits a floor that it was not planned on; empty if unknown."""
    try:
        from stopgo.planner.checking.verdict import verdict

        found = verdict(mission, floor, None).problems
    except (ModuleNotFoundError, InputError):
        return ""
    if not found:
        return "; its stops and legs fit there too"
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"; there, {found[0]}{more}"


def _is_library(error: ModuleNotFoundError) -> bool:
    """Return True if the missing module is a library of the extra, not a part of this program."""
    return (error.name or "").partition(".")[0] not in ("", "stopgo")


def _verdict(path: Path, mission: Mission, found: _Checked) -> dict[str, Any]:
    return {
        "file": str(path),
        "ok": not found.problems,
        "id": mission.id,
        "revision": mission.revision,
        "digest": mission.digest,
        "stops": len(mission.stops),
        "problems": [{"path": problem.path, "message": problem.message} for problem in found.problems],
        "coverage": found.coverage,
        "notes": found.notes,
    }


OriginOption = Annotated[
    str | None, typer.Option(metavar="LAT,LON,ALT,HEADING", help="Position of the drawing's origin on Earth.")
]
FORMAT_NAMES = (
    "plan, waypoints, dxf, csv, geojson, nav2, nav2-route, mcap, vda5050 or vda5050-2.1, whatever the suffix."
)
AutopilotOption = Annotated[
    str | None,
    typer.Option(
        metavar="ardupilot|px4|generic", rich_help_panel="MAVLink vehicle", help="Kind of autopilot."
    ),
]


FormatOption = Annotated[str | None, typer.Option(metavar="FORMAT", help=FORMAT_NAMES)]
MapOption = Annotated[
    str | None,
    typer.Option("--map", metavar="X,Y,HEADING", help="Site to map: rotate by HEADING, then shift."),
]


def export(
    mission: MissionFile,
    out: Annotated[Path, typer.Option("-o", "--out", help="The file; its suffix names the format.")],
    to: FormatOption = None,
    floor: Annotated[Path | None, typer.Option(help="The floor's .dxf, to draw over.")] = None,
    coverage: Annotated[
        Path | None, typer.Option("--coverage-file", help="coverage.json, to draw covered targets.")
    ] = None,
    autopilot: AutopilotOption = None,
    trigger: ItemTrigger = None,
    scan_wait: ScanWaiting = None,
    settle: Settling = None,
    origin: OriginOption = None,
    map_: MapOption = None,
    as_json: AsJson = False,
) -> None:
    """Write a mission in a format of other programs.

    .plan (QGroundControl), .waypoints (QGC WPL 110), .dxf, .csv, .geojson, .nav2.yaml, .mcap (nav_msgs/Path),
    .route.geojson (Nav2's Route Server), .vda5050.json (3.0), .vda5050-2.1.json; docs/how-to/exports.md lists
    the programs that open each.

    Example: stopgo export plan/mission.json --floor floor.dxf --coverage-file plan/coverage.json -o site.dxf
    """
    from stopgo.mission.files.exports import check_uses, format_named
    from stopgo.mission.files.exports.placing import moved, placed
    from stopgo.mission.files.mission_json import read

    document = read(mission)
    there = placed(document, origin=origin, to_map=map_)
    _check_problems(mission, there)
    name = format_named(to, out)
    writing = {"autopilot": autopilot, "trigger": trigger, "scan-wait": scan_wait, "settle": settle}
    drawn = {"floor": floor, "coverage": coverage}
    check_uses(name, {**drawn, **writing, "origin": origin, "map": map_})
    must_not_replace(out, mission, floor, coverage)
    supplements = _supplements(document, floor, coverage, writing)
    report = _write_export(out, there, name, supplements)
    notes = (*moved(document, there), *report.pop("notes"))
    _print_export({"mission": str(mission), **report, "notes": notes}, as_json)


def _write_export(out: Path, mission: Mission, name: str, supplements: Supplements) -> dict[str, Any]:
    """Write the file; return the report on it."""
    from stopgo.mission.files.exports import exported, form_of

    data = exported(mission, name, supplements)
    write_checked(out, data)
    report = {"file": str(out), "format": name, "stops": len(mission.stops), "bytes": len(data)}
    return {**report, "notes": form_of(name).notes(mission, supplements)}


def _check_problems(path: Path, mission: Mission) -> None:
    """Refuse an invalid mission, with its first problem."""
    from stopgo.mission.document.problems import problems_of

    for problem in problems_of(mission)[:1]:
        raise NegativeResult(f"{path}: {problem} (stopgo check {path} lists all)")


def _supplements(
    mission: Mission, floor: Path | None, coverage: Path | None, writing: dict[str, str | None]
) -> Supplements:

    from stopgo.mission.files.exports.format import written_as
    from stopgo.mission.files.exports.stretches import read_stretches

    return replace(
        written_as(writing),
        floor=None if floor is None else _floor_drawing(floor, mission),
        coverage=None if coverage is None else read_stretches(coverage, mission),
        written=datetime.now(UTC),
    )


def _floor_drawing(path: Path, mission: Mission) -> FloorDrawing:
    """Return the drawing the mission was planned on, in the unit it was planned in."""
    from stopgo.mission.files.exports.format import FloorDrawing
    from stopgo.planner.floors import options_of
    from stopgo.planner.floors.drawing import open_drawing
    from stopgo.planner.floors.dxf import metres_in

    if path.suffix.lower() != ".dxf":
        raise InputError(
            f"--floor {path}: layers can be drawn only over a .dxf; leave --floor out to write them alone"
        )
    must_be_own_floor(path, mission)
    data = whole_file(path)
    drawing, _ = open_drawing(data, source=path)
    options = options_of(recorded_settings(mission.origin.parameters))
    metres = metres_in(drawing, source=path, options=options)
    return FloorDrawing(lambda: open_drawing(data, source=path)[0], metres)


def _print_notes(notes: Iterable[str]) -> None:

    for note in notes:
        typer.echo(f"stopgo: {printable(note)}", err=True)


def _print_export(report: dict[str, Any], as_json: bool) -> None:
    from stopgo.mission.files.exports import form_of
    from stopgo.mission.files.mission_text import json_text

    _print_notes(report["notes"])
    line = f"{report['file']}: {form_of(report['format']).title}, {report['stops']} stops, read back"
    typer.echo(json_text(report) if as_json else line)


def import_command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .plan, a .waypoints or a .csv of stops.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The mission.json to write.")],
    parameters: Annotated[
        Path | None, typer.Option("-p", "--parameters", help="plan.toml: robot, scanner and policy.")
    ] = None,
    origin: OriginOption = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,HEADING", help="Start pose of the robot, m and degrees.")
    ] = None,
    autopilot: AutopilotOption = None,
    kind: Annotated[
        str | None,
        typer.Option("--from", metavar="plan|waypoints|csv", help="Format of the file, whatever its suffix."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make a mission from another program's waypoints or stops.

    Waypoints with a wait or a trigger become stops, others become corners of the legs between. A file with an
    item that a scanning robot cannot execute is refused, with the item's number.

    Example: stopgo import site.plan -o mission.json --origin 47.3769,8.5417,408,0
    """
    from msgspec.structs import replace

    from stopgo.mission.document import with_digest
    from stopgo.mission.files.imports import read_mission
    from stopgo.mission.files.mission_json import encode, next_revision, read

    given = {"origin": origin, "start": start}
    settings = read_settings(parameters, {key: PARAMETERS[key].given(text) for key, text in given.items()})
    made, track = read_mission(file, settings, kind=kind, autopilot=autopilot)
    mission = with_digest(replace(made, revision=next_revision(out, made)))
    write_checked(out, encode(mission))
    _print_import(read(out), out, (*track.notes, LEGS_UNCHECKED), as_json)


LEGS_UNCHECKED = (
    "legs are straight between the file's positions; stopgo check --floor FLOOR.dxf tests if they are free"
)


def _print_import(mission: Mission, out: Path, notes: tuple[str, ...], as_json: bool) -> None:
    from stopgo.mission.files.mission_text import identity, json_text, route_length

    _print_notes(notes)
    report = {
        **{"mission": str(out), "id": mission.id, "revision": mission.revision, "digest": mission.digest},
        **{"imported": mission.origin.floor, "stops": len(mission.stops), "route_m": route_length(mission)},
        **{"georeference": mission.georeference, "notes": notes},
    }
    line = f"{out}: {len(mission.stops)} stops, route {route_length(mission):.2f} m, {identity(mission)}"
    typer.echo(json_text(report) if as_json else line)
