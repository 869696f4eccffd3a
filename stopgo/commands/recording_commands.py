"""Commands of this folder: `review` reads a recording back, `replay` a robot's own log."""

from __future__ import annotations

import contextlib
import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import must_be_writable, must_not_replace

if TYPE_CHECKING:
    from stopgo.mission.comparing.measured import Measured
    from stopgo.mission.document import Mission
    from stopgo.planner.pipeline.follow_up_mission import PlannedFloor
    from stopgo.recordings.logs import FieldLog, Reading
    from stopgo.recordings.page.reviewed import RecordingReview, Review
    from stopgo.recordings.replay.log_placing import Align, Placing
    from stopgo.recordings.replay.replayed import Replay


IMPORTER = "rerun-importer"
"""The command behind the executable `rerun-importer-stopgo`."""


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command(epilog="Example: stopgo review plan.rrd field.rrd --html report.html")(review)
    app.command(epilog="Example: stopgo runs recordings")(runs)
    app.command(
        IMPORTER,
        hidden=True,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
        epilog="Example: rerun-importer-stopgo mission.json --recording-id r1 > mission.rrd",
    )(rerun_importer)
    app.command(
        epilog="Example: stopgo replay field.bag --mission plan/mission.json --align stops -o replay.rrd"
    )(replay)


def review(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING.rrd...", help="Plan or field recordings, or folders.")
    ],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Exit 1 where one is incomplete or contradicts its mission.")
    ] = False,
    html: Annotated[
        Path | None, typer.Option("--html", metavar="REPORT.html", help="Write a report, one file alone.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="MERGED.rrd", help="Write them as one recording.")
    ] = None,
    png: Annotated[
        Path | None,
        typer.Option("--png", metavar="DIR", help="Write a picture of every view, without a screen."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open them together in the Rerun viewer.")] = False,
) -> int:
    """Read recordings to their end, and tell what the plan was, and what the runs acquired.

    Given together, a run is set beside its plan: what its scans really saw is recomputed. Exit code 1: less
    was seen than the plan was asked for; 3: it is not known; 2: a file cannot be read.
    """
    from stopgo.mission.console.table import printable, printable_lines
    from stopgo.mission.files.atomic import must_not_replace
    from stopgo.recordings.page.reviewed import review as read

    must_not_replace(html, *recordings)
    found = read(recordings)
    if html is not None and found.recordings:
        from stopgo.mission.files.atomic import write_atomic
        from stopgo.recordings.page import report_html
        from stopgo.recordings.page.from_recordings import subject_of

        write_atomic(html, report_html(subject_of(found)))
    if out is not None and found.recordings:
        from stopgo.recordings.catalog.merging import merge

        merge([item.recording for item in found.recordings], out)
    if png is not None and found.recordings:
        from stopgo.recordings.viewing.headless import write_pictures

        write_pictures([item.recording.path for item in _of_one_mission(found, png)], png)
    if json_:
        told = [item.as_json() for item in found.recordings]
        alone = len(told) == 1 and not found.faults
        whole = told[0] if alone else {"recordings": told, "faults": list(found.faults)}
        typer.echo(json.dumps(whole, ensure_ascii=False))
    else:
        typer.echo(printable_lines("\n\n".join(item.as_text() for item in found.recordings)))
    for fault in found.faults:
        typer.echo(f"stopgo: {printable(fault)}", err=True)
    if view:
        from stopgo.recordings.viewing.viewer import open_viewer

        open_viewer([item.recording.path for item in found.recordings])
    return found.check_code if check else found.exit_code


def _of_one_mission(found: Review, folder: Path) -> tuple[RecordingReview, ...]:
    ids = sorted({item.recording.mission_id for item in found.recordings})
    if len(ids) > 1:
        raise InputError(
            f"{folder}: views show one mission; these are of {len(ids)}: {', '.join(ids)}; "
            "name the recordings of one"
        )
    return found.recordings


def runs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A folder; those below it count too.")],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Show them in a browser on this machine, until Ctrl-C.")
    ] = False,
    port: Annotated[int | None, typer.Option(help="With --web: where to listen; else on a free one.")] = None,
) -> None:
    """List plans and runs in a folder, the newest run first, with what each acquired.

    Keeps an index in the folder, and reads only recordings that have come or changed since.
    """
    if web:
        _serve_runs(folder, port)
        return
    if port is not None:
        raise InputError("--port is where --web listens; add --web, or leave it out")
    from stopgo.mission.console.table import printable, printable_lines
    from stopgo.recordings.catalog.run_index import index_json, index_of, index_text

    index = index_of(folder, say=lambda line: typer.echo(printable(line), err=True))
    told = json.dumps(index_json(index), ensure_ascii=False) if json_ else printable_lines(index_text(index))
    typer.echo(told)
    for fault in index.faults():
        typer.echo(f"stopgo: {printable(fault)}", err=True)


def _serve_runs(folder: Path, port: int | None) -> None:
    import threading

    from stopgo.mission.console.table import printable
    from stopgo.recordings.catalog.run_site import serving

    with serving(folder, port=port) as address:
        typer.echo(
            printable(f"{folder}: {address} shows its runs, with reports and Rerun's viewer; Ctrl-C ends")
        )
        threading.Event().wait()


def rerun_importer(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Whatever is opened in Rerun.")],
    recording_id: Annotated[str | None, typer.Option(help="Of a floor's recording.")] = None,
) -> int:
    """Write a mission or a floor to stdout as a recording, as Rerun asks of its importers.

    Exit code 66: the file is neither. Rerun's further options mean nothing here: how stopgo's recordings are
    named and timed is the same whoever opens them.
    """
    from stopgo.recordings.viewing.importer import NOT_OURS, is_ours, recording_of

    if not is_ours(path):
        return NOT_OURS
    with contextlib.redirect_stdout(sys.stderr):
        from stopgo.planner.floors import read_floor

        recording = recording_of(path, recording_id, read_floor)
    sys.stdout.buffer.write(recording)
    return 0


def replay(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help=".bag, rosbag2, .mcap, .db3, .tlog, .BIN, .ulg, TUM, CSV, journal"
        ),
    ],
    mission: Annotated[
        Path | None, typer.Option(help="What was to be driven; without it the MAVLink mission in the log.")
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Recording to write (.rrd).")] = None,
    list_: Annotated[bool, typer.Option("--list", help="Only tell what is in each log.")] = False,
    map_: Annotated[
        str | None, typer.Option("--map", help="X,Y,HEADING (m, degrees) of the site in the log's frame.")
    ] = None,
    align: Annotated[
        str | None, typer.Option(help="first: the log begins at the start; stops: by where it halts.")
    ] = None,
    time_offset: Annotated[float, typer.Option(help="Seconds to add to the log's times.")] = 0.0,
    poses: Annotated[str | None, typer.Option(help="Source of the poses, as --list names it.")] = None,
    robot_name: Annotated[str | None, typer.Option(help="Which robot, where a log has several.")] = None,
    stamps: Annotated[
        str, typer.Option(help="header: the messages' own stamps count; log: when they were logged.")
    ] = "header",
    frame: Annotated[
        str | None, typer.Option(help="Take the poses in this frame from transforms (tf).")
    ] = None,
    floor: Annotated[
        Path | None, typer.Option(help="The floor it was planned on: tells what the robot saw of it.")
    ] = None,
    clouds: Annotated[
        Path | None, typer.Option(help="With --floor: folder of clouds (.e57 .las .laz .ply) in its metres.")
    ] = None,
    top_up: Annotated[
        Path | None, typer.Option(help="With --floor: further mission to write that sees the rest (.json).")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Table of stops to write (.csv).")] = None,
    html: Annotated[
        Path | None, typer.Option(metavar="REPORT.html", help="Report to write, one file alone.")
    ] = None,
    plan: Annotated[
        Path | None, typer.Option(metavar="PLAN.rrd", help="The plan's recording: its floor, for the report.")
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """Lay a robot's own log beside the mission: which stops were done, how far off, and what was missed.

    How the log's frame lies in the mission's is never guessed: the georeference tells, or --map, or --align.

    Exit code 1: a stop was missed, or visited outside its tolerance; 2: the log cannot be read, or is of
    another mission.
    """
    read = [_read(path, stamps, frame) for path in logs]
    if list_:
        _tell_logs(read, as_json=json_)
        return 0
    from stopgo.recordings.replay.judged import judged
    from stopgo.recordings.replay.replaying import replay as laid

    if top_up is not None and floor is None:
        raise InputError(f"--top-up {top_up}: is planned on the floor; give its file with --floor")
    if clouds is not None and floor is None:
        raise InputError(f"--clouds {clouds}: are laid on the floor; give its file with --floor")
    for path in (out, csv, top_up, html):
        if path is not None:
            must_be_writable(path)
            must_not_replace(path, *logs, mission, floor)
    if csv is not None and len(read) > 1:
        raise InputError("--csv: is a table of one log; give one log")
    driven = _mission(mission, read)
    how = _placing(map_, align, time_offset, poses, robot_name)
    plans = None if plan is None else _plans(plan, driven)
    sights = (
        () if plans is None else tuple(sight for item in plans.recordings for sight in item.recording.sights)
    )
    replays = [laid(log, driven, how, sights) for log in read]
    if floor is not None:
        replays = _seen(replays, floor, clouds, top_up)
    _write_replays(replays, out, csv)
    if html is not None:
        from stopgo.mission.files.atomic import write_atomic
        from stopgo.recordings.page import report_html
        from stopgo.recordings.replay.replay_page import page_of

        write_atomic(html, report_html(page_of(replays, plans)))
    _tell_replays(replays, as_json=json_)
    return max(judged(item).exit_code for item in replays)


def _plans(path: Path, mission: Mission) -> Review:
    """A plan's recording, if it is of the mission."""
    from stopgo.recordings.page.reviewed import review as read

    found = read([path])
    for fault in found.faults:
        raise InputError(fault)
    held = found.recordings[0].recording
    if held.mission_id != mission.id:
        raise InputError(f"--plan {path}: is of mission {held.mission_id[:12]}, not {mission.id[:12]}")
    return found


def _seen(replays: list[Replay], floor: Path, clouds: Path | None, top_up: Path | None) -> list[Replay]:
    """With what was in sight from where the robot stood, in all runs together; and the further mission."""
    import numpy as np

    from stopgo.planner.pipeline.follow_up_mission import as_driven, planned_floor
    from stopgo.planner.pipeline.follow_up_mission import top_up as further

    planned = planned_floor(floor, replays[0].mission)
    told = [item.with_sight(as_driven(planned, item.scanned_from)) for item in replays]
    told = [item.with_measured(_measured(planned, item, clouds)) for item in told]
    if top_up is not None:
        places = np.concatenate([item.scanned_from for item in told])
        evidence = " ".join(item.log.digest for item in told)
        heaps = [
            heap.outline for item in told if item.measured is not None for heap in item.measured.unplanned
        ]
        _write_further(further(planned, places, obstacles=heaps, evidence=evidence), top_up)
    return told


def _measured(planned: PlannedFloor, replay: Replay, clouds: Path | None) -> Measured | None:
    """What the scanner's own clouds show, else the scans in the log; None where there is neither."""
    from stopgo.planner.pipeline.measuring import measured
    from stopgo.recordings.clouds import clouds_in, levels
    from stopgo.recordings.replay.placed_sweeps import placed_sweeps

    if clouds is not None:
        return measured(planned, levels(clouds_in(clouds)), least_sweeps=1)
    found = measured(planned, placed_sweeps(replay))
    return found if found.points else None


def _write_further(mission: Mission | None, path: Path) -> None:
    from stopgo.mission.files.mission_json import write

    if mission is None:
        typer.echo(f"{path}: not written: all that was asked for was in sight", err=True)
        return
    write(mission, path)
    typer.echo(f"{path}: {len(mission.stops)} further stops", err=True)


def _read(path: Path, stamps: str, frame: str | None) -> FieldLog:
    from stopgo.recordings.logs import read_log

    return read_log(path, _reading(stamps, frame, path))


def _tell_logs(logs: list[FieldLog], *, as_json: bool) -> None:
    from stopgo.mission.console.table import printable_lines
    from stopgo.recordings.logs import listing

    if as_json:
        _echo_json([listing.as_json(log) for log in logs], "logs")
    else:
        typer.echo(printable_lines("\n".join(map(listing.as_text, logs))))


def _echo_json(told: list[dict[str, Any]], name: str) -> None:
    """One object; of several, under a name."""
    typer.echo(json.dumps(told[0] if len(told) == 1 else {name: told}, ensure_ascii=False))


def _mission(path: Path | None, logs: list[FieldLog]) -> Mission:
    """What is named, else what the first log holds."""
    from stopgo.mission.document.problems import problems_of
    from stopgo.mission.files.mission_json import read
    from stopgo.recordings.replay.uploaded import mission_in

    if path is None:
        return mission_in(logs[0])
    document = read(path)
    for problem in problems_of(document)[:1]:
        raise InputError(f"{path}: {problem} (stopgo check {path} lists all)")
    return document


def _placing(
    map_: str | None, align: str | None, time_offset: float, poses: str | None, robot: str | None
) -> Placing:
    from stopgo.mission.files.exports.placing import map_transform
    from stopgo.recordings.replay.log_placing import Placing

    if align is not None and map_ is not None:
        raise InputError("--map and --align both say how the log lies; give one of them")
    if not math.isfinite(time_offset) or abs(time_offset) > 1e9:
        raise InputError(f"--time-offset {time_offset}: must be seconds")
    ways: dict[str | None, Align | None] = {None: None, "first": "first", "stops": "stops"}
    if align not in ways:
        raise InputError(f"--align {align}: must be first or stops")
    to_map = None if map_ is None else map_transform(map_)
    return Placing(to_map, ways[align], time_offset, poses, robot)


def _write_replays(replays: list[Replay], out: Path | None, csv: Path | None) -> None:
    from stopgo.mission.files.atomic import write_atomic
    from stopgo.recordings.replay.replay_text import as_csv

    if out is not None:
        from stopgo.recordings.replay.drawing import write_recording

        write_recording(replays, out)
    if csv is not None:
        write_atomic(csv, as_csv(replays[0]))


def _tell_replays(replays: list[Replay], *, as_json: bool) -> None:
    from stopgo.recordings.replay.replay_text import as_json as told_json
    from stopgo.recordings.replay.replay_text import as_text

    if as_json:
        _echo_json([told_json(item) for item in replays], "replays")
    else:
        typer.echo("\n\n".join(map(as_text, replays)))


def _reading(stamps: str, frame: str | None, path: Path) -> Reading:
    """How to read a log, with progress on a terminal."""
    from stopgo.recordings.logs import Reading

    if stamps not in ("header", "log"):
        raise InputError(f"--stamps {stamps}: must be header or log")

    def tick(share: float) -> None:
        if sys.stderr.isatty():
            typer.echo(f"\r\033[K{path.name} {share:.0%}", err=True, nl=share >= 1)

    return Reading(stamps="log" if stamps == "log" else "header", frame=frame, tick=tick)
