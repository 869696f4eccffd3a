"""`stopgo replay`: compares robots' own logs with the mission, and writes recording, table and report."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.commands.replay_on_floor import on_floor, write_follow_up
from stopgo.mission.console.notice import notice
from stopgo.mission.console.running_step import RunningStep, running
from stopgo.mission.console.table import printable_lines
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_be_writable, must_not_replace, write_atomic

if TYPE_CHECKING:
    from stopgo.mission.document import Mission
    from stopgo.recordings.logs import FieldLog, Reading
    from stopgo.recordings.page.reviewed import Review
    from stopgo.recordings.replay.log_placing import Align, Placing
    from stopgo.recordings.replay.replayed import Replay

EXAMPLE_REPLAY = "Example: stopgo replay field.bag --mission plan/mission.json --align stops -o replay.rrd"

ReplayLogs = Annotated[
    list[Path],
    typer.Argument(metavar="LOG...", help=".bag, rosbag2, .mcap, .db3, .tlog, .BIN, .ulg, TUM, CSV, journal"),
]
ReplayMission = Annotated[
    list[Path] | None,
    typer.Option(
        help="Planned mission, else the MAVLink mission in the log; repeat for the robots of one plan."
    ),
]
ReplayOut = Annotated[
    Path | None, typer.Option("-o", "--out", rich_help_panel="Output", help="Recording to write (.rrd).")
]
ReplayOneRun = Annotated[
    bool,
    typer.Option("--one-run", help="The logs are parts of one run, as after a reboot: judge them together."),
]
ReplayList = Annotated[bool, typer.Option("--list", help="Only list the content of each log.")]
ReplayMap = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="X,Y,HEADING",
        rich_help_panel="Position of the log",
        help="Site to the log's map: rotate by HEADING, then shift.",
    ),
]
ReplayAlign = Annotated[
    str | None,
    typer.Option(
        metavar="first|stops",
        rich_help_panel="Position of the log",
        help="first: the log begins at the start; stops: fit standstills to stops.",
    ),
]
ReplayHeight = Annotated[
    float | None,
    typer.Option(
        rich_help_panel="Position of the log",
        metavar="METRES",
        help="Height of the mission's floor in the log's frame.",
    ),
]
ReplayTimeOffset = Annotated[
    float, typer.Option(rich_help_panel="Position of the log", help="Seconds to add to the log's times.")
]
ReplayPoses = Annotated[
    str | None,
    typer.Option(rich_help_panel="Poses in the log", help="Source of the poses, as --list names it."),
]
ReplayRobot = Annotated[
    str | None,
    typer.Option(rich_help_panel="Poses in the log", help="Robot to replay, where a log has several."),
]
ReplayStamps = Annotated[
    str,
    typer.Option(
        metavar="header|log",
        rich_help_panel="Poses in the log",
        help="header: time stamps in the messages; log: times of logging.",
    ),
]
ReplayFrame = Annotated[
    str | None,
    typer.Option(
        rich_help_panel="Poses in the log", help="Take the poses in this frame from transforms (tf)."
    ),
]
ReplayFloor = Annotated[
    Path | None, typer.Option(help="Floor file of the plan; reports what the robot saw of it.")
]
ReplayClouds = Annotated[
    Path | None, typer.Option(help="With --floor: folder of clouds (.e57 .las .laz .ply) in its metres.")
]
ReplayTopUp = Annotated[
    Path | None,
    typer.Option(
        rich_help_panel="Output",
        help="With --floor: follow-up mission to write that covers the rest (.json).",
    ),
]
ReplayCsv = Annotated[
    Path | None, typer.Option(rich_help_panel="Output", help="Table of stops to write (.csv).")
]
ReplayHtml = Annotated[
    Path | None,
    typer.Option(metavar="REPORT.html", rich_help_panel="Output", help="Report to write, as one HTML file."),
]
ReplayPlan = Annotated[
    Path | None, typer.Option(metavar="PLAN.rrd", help="The plan's recording, with floor and visibility.")
]
ReplayAsJson = Annotated[
    bool, typer.Option("--json", rich_help_panel="Output", help="One JSON object on stdout.")
]


def add_commands(app: typer.Typer) -> None:
    """Add the command to `stopgo`."""
    app.command(epilog=EXAMPLE_REPLAY)(replay)


def replay(
    logs: ReplayLogs,
    mission: ReplayMission = None,
    one_run: ReplayOneRun = False,
    out: ReplayOut = None,
    list_: ReplayList = False,
    map_: ReplayMap = None,
    align: ReplayAlign = None,
    time_offset: ReplayTimeOffset = 0.0,
    floor_height: ReplayHeight = None,
    poses: ReplayPoses = None,
    robot_name: ReplayRobot = None,
    stamps: ReplayStamps = "header",
    frame: ReplayFrame = None,
    floor: ReplayFloor = None,
    clouds: ReplayClouds = None,
    top_up: ReplayTopUp = None,
    csv: ReplayCsv = None,
    html: ReplayHtml = None,
    plan: ReplayPlan = None,
    json_: ReplayAsJson = False,
) -> int:
    """Compare a robot's own log with the mission: stops visited, deviations, and what was missed.

    The log's frame is never guessed: its transform comes from the georeference, --map or --align.

    Exit code 1: a stop was missed, or visited outside its tolerance, or a mission has no log; 2: the log is
    unreadable or another's.
    """
    read = _read(logs, stamps, frame)
    if list_:
        _print_logs(read, as_json=json_)
        return 0
    files = _ReplayFiles(logs, mission or [], floor, clouds, out, csv, top_up, html, plan)
    files.check()
    driven = _missions(mission or [], read)
    placing = replace(_placing(map_, align, time_offset, poses, robot_name), level_m=_height(floor_height))
    plans = _plans(plan, driven[0])
    replays = files.compare_and_write(_replays(read, driven, placing, plans, one_run=one_run), plans, driven)
    return _print_replays(replays, driven, as_json=json_)


@dataclass(frozen=True)
class _ReplayFiles:
    """Files that `replay` reads, and files that it writes; None where the user gave no path."""

    logs: list[Path]
    missions: list[Path]
    floor: Path | None
    clouds: Path | None
    out: Path | None
    csv: Path | None
    follow_up: Path | None
    html: Path | None
    plan: Path | None

    def check(self) -> None:
        """Raise InputError where an option needs another one, or a file cannot be written."""
        if self.follow_up is not None and self.floor is None:
            raise InputError(f"--top-up {self.follow_up}: needs the floor; give its file with --floor")
        if self.clouds is not None and self.floor is None:
            raise InputError(f"--clouds {self.clouds}: needs the floor; give its file with --floor")
        for path in (self.out, self.csv, self.follow_up, self.html):
            if path is not None:
                must_be_writable(path)
                must_not_replace(path, *self.logs, *self.missions, self.floor)
        if self.csv is not None and len(self.logs) > 1:
            raise InputError(f"--csv {self.csv}: is a table of one log, not {len(self.logs)}; give one log")
        self._check_of_one_mission()

    def _check_of_one_mission(self) -> None:
        """Raise InputError where a file shows one mission, and several were given."""
        of_one = {"--out": self.out, "--html": self.html, "--plan": self.plan, "--clouds": self.clouds}
        for option, path in of_one.items():
            if path is not None and len(self.missions) > 1:
                raise InputError(
                    f"{option} {path}: is of one mission, not {len(self.missions)}; give one --mission"
                )

    def compare_and_write(
        self, replays: list[Replay], plans: Review | None, missions: list[Mission]
    ) -> list[Replay]:
        """Return the replays with what was visible on the floor, and write every file."""
        with running("comparing with the floor") as step:
            found = self.with_floor(replays, missions)
            step.begin("writing the results")
            self.write(found, plans)
        return found

    def with_floor(self, replays: list[Replay], missions: list[Mission]) -> list[Replay]:
        """Return the replays with what was visible on the floor, and write the follow-up mission."""
        if self.floor is None:
            return replays
        from stopgo.planner.pipeline.follow_up_mission import planned_floor

        planned = {item.digest: planned_floor(self.floor, item) for item in missions}
        found = [
            one for item in replays for one in on_floor([item], planned[item.mission.digest], self.clouds)
        ]
        if self.follow_up is not None:
            first, *others = missions
            write_follow_up(found, planned[first.digest], others, self.follow_up)
        return found

    def write(self, replays: list[Replay], plans: Review | None) -> None:
        """Write recording, table and report."""
        from stopgo.recordings.replay.replay_text import as_csv

        if self.out is not None:
            from stopgo.recordings.replay.drawing import write_recording

            write_recording(replays, self.out, None if plans is None else plans.recordings[0].recording)
        if self.csv is not None:
            write_atomic(self.csv, as_csv(replays[0]))
        if self.html is not None:
            from stopgo.recordings.page import report_html
            from stopgo.recordings.replay.replay_page import page_of

            write_atomic(self.html, report_html(page_of(replays, plans)))


def _read(paths: list[Path], stamps: str, frame: str | None) -> list[FieldLog]:
    from stopgo.recordings.logs import read_log

    logs = []
    for path in paths:
        with running(f"reading {path.name}") as step:
            logs.append(read_log(path, _reading(stamps, frame, path, step)))
    return logs


def _reading(stamps: str, frame: str | None, path: Path, step: RunningStep) -> Reading:
    """Return the options for reading a log, with its progress."""
    from stopgo.recordings.logs import Reading

    if stamps not in ("header", "log"):
        raise InputError(f"--stamps {stamps}: must be header or log")

    def tick(fraction: float) -> None:
        step.progress(f"reading {path.name}, {fraction:.0%}")

    return Reading(stamps="log" if stamps == "log" else "header", frame=frame, tick=tick)


def _missions(paths: list[Path], logs: list[FieldLog]) -> list[Mission]:
    """Return the missions in the given files, else the one in the first log."""
    from stopgo.mission.document.problems import problems_of
    from stopgo.mission.files.mission_json import read
    from stopgo.recordings.replay.uploaded import mission_in

    if not paths:
        return [mission_in(logs[0])]
    documents = [read(path) for path in paths]
    for path, document in zip(paths, documents, strict=True):
        for problem in problems_of(document)[:1]:
            raise InputError(f"{path}: {problem} (stopgo check {path} lists all)")
    return documents


def _mission_of(log: FieldLog, number: int, missions: list[Mission], logs: int) -> Mission:
    """Return the mission that a log names, else the one given in the same order as the log."""
    if len(missions) == 1:
        return missions[0]
    ids = {event.mission_id for event in log.events}
    for mission in missions:
        if mission.id in ids:
            return mission
    if ids or logs > len(missions):
        raise InputError(
            f"{log.path}: belongs to none of the {len(missions)} missions by its own events; "
            "give each log's mission with --mission, in the order of the logs"
        )
    return missions[number]


def _placing(
    map_: str | None, align: str | None, time_offset: float, poses: str | None, robot: str | None
) -> Placing:
    from stopgo.mission.files.exports.placing import map_transform
    from stopgo.recordings.replay.log_placing import Placing

    if align is not None and map_ is not None:
        raise InputError("--map, --align: both give the log's transform; give one of them")
    if not math.isfinite(time_offset) or abs(time_offset) > 1e9:
        raise InputError(f"--time-offset {time_offset}: must be seconds")
    known: dict[str | None, Align | None] = {None: None, "first": "first", "stops": "stops"}
    if align not in known:
        raise InputError(f"--align {align}: must be first or stops")
    to_map = None if map_ is None else map_transform(map_)
    return Placing(to_map, known[align], time_offset, poses, robot)


def _height(level: float | None) -> float | None:
    if level is not None and not (math.isfinite(level) and abs(level) < 1e5):
        raise InputError(f"--floor-height {level}: must be a height in metres")
    return level


def _plans(path: Path | None, mission: Mission) -> Review | None:
    """Return a plan's recording, if it is of the mission; None without one."""
    if path is None:
        return None
    from stopgo.recordings.page.reviewed import review as read

    found = read([path])
    for fault in found.faults:
        raise InputError(fault)
    recording = found.recordings[0].recording
    if recording.mission_id != mission.id:
        raise InputError(f"--plan {path}: is of mission {recording.mission_id[:12]}, not {mission.id[:12]}")
    return found


def _replays(
    logs: list[FieldLog], missions: list[Mission], placing: Placing, plans: Review | None, *, one_run: bool
) -> list[Replay]:
    """Compare each log with its mission, with the coverage that the plan's recording contains."""
    from stopgo.recordings.replay.replaying import replay as replay_of
    from stopgo.recordings.replay.replaying import replay_parts

    items = () if plans is None else plans.recordings
    sights = tuple(sight for item in items for sight in item.recording.sights)
    if one_run and len(missions) > 1:
        raise InputError(f"--one-run: is of one mission, not {len(missions)}; give one --mission")
    with running("comparing with the mission"):
        if one_run:
            return [replay_parts(logs, missions[0], placing, sights)]
        own = [_mission_of(log, number, missions, len(logs)) for number, log in enumerate(logs)]
        return [replay_of(log, mission, placing, sights) for log, mission in zip(logs, own, strict=True)]


def _print_logs(logs: list[FieldLog], *, as_json: bool) -> None:
    from stopgo.recordings.logs import listing

    if as_json:
        _print_json([listing.as_json(log) for log in logs], "logs")
    else:
        typer.echo(printable_lines("\n".join(map(listing.as_text, logs))))


def _print_replays(replays: list[Replay], missions: list[Mission], *, as_json: bool) -> int:
    """Print the comparisons; return the exit code of all."""
    from stopgo.recordings.replay import replay_text

    if as_json:
        _print_json([replay_text.as_json(item) for item in replays], "replays")
    else:
        typer.echo("\n\n".join(map(replay_text.as_text, replays)))
    return 1 if _print_not_driven(missions, replays) else _exit_code(replays)


def _print_not_driven(missions: list[Mission], replays: list[Replay]) -> bool:
    """Name the missions of which no log was given; return True if there are any."""
    compared = {item.mission.digest for item in replays}
    missing = [mission for mission in missions if mission.digest not in compared]
    for mission in missing:
        notice(f"{mission.name} ({mission.id[:12]}): no log of it is given; it counts as not driven")
    return bool(missing)


def _print_json(items: list[dict[str, Any]], name: str) -> None:
    """Print one object; several as a list under a name."""
    typer.echo(json.dumps(items[0] if len(items) == 1 else {name: items}, ensure_ascii=False))


def _exit_code(replays: list[Replay]) -> int:
    """Return the exit code of all replays."""
    from stopgo.mission.comparing.run_verdict import exit_code_of
    from stopgo.recordings.replay.drive_verdict import drive_verdict

    return exit_code_of(map(drive_verdict, replays))
