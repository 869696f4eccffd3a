"""Commands of this folder: `review` reads a recording back, `replay` a robot's own log."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mission.errors import InputError

if TYPE_CHECKING:
    from recordings.logs import Reading


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command(epilog="Example: stopgo review plan.rrd field.rrd --view")(review)
    app.command(epilog="Example: stopgo replay field.bag --list")(replay)


def review(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING.rrd...", help="Plan or field recordings, or folders.")
    ],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Exit 1 where one is incomplete or contradicts its mission.")
    ] = False,
    view: Annotated[bool, typer.Option("--view", help="Open them together in the Rerun viewer.")] = False,
) -> int:
    """Read recordings to their end, and tell what the plan was, and what the runs acquired.

    Given together, a run is set beside its plan: what its scans really saw is recomputed. Exit code 1: less
    was seen than the plan was asked for; 3: it is not known; 2: a file cannot be read.
    """
    from mission.table import printable, printable_lines
    from recordings.review import review as read

    found = read(recordings)
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
        from recordings.viewer import open_viewer

        open_viewer([item.recording.path for item in found.recordings])
    return found.check_code if check else found.exit_code


def replay(
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...", help=".bag, rosbag2, .mcap, .db3, .tlog, .BIN, .ulg, TUM, CSV, journal."
        ),
    ],
    list_: Annotated[bool, typer.Option("--list", help="Tell what is in each log.")] = False,
    stamps: Annotated[
        str, typer.Option(help="header: the messages' own stamps count; log: when they were logged.")
    ] = "header",
    frame: Annotated[
        str | None, typer.Option(help="Take the poses in this frame from transforms (tf).")
    ] = None,
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Tell what a robot's own log holds: messages, poses, missions, modes, and what of it is damaged."""
    from mission.table import printable_lines
    from recordings.logs import listing, read_log

    if not list_:
        raise InputError("replay: say what to do with the log; --list tells what is in it")
    read = [read_log(path, _reading(stamps, frame, path)) for path in logs]
    if json_:
        told = [listing.as_json(log) for log in read]
        typer.echo(json.dumps(told[0] if len(told) == 1 else {"logs": told}, ensure_ascii=False))
    else:
        typer.echo(printable_lines("\n".join(map(listing.as_text, read))))


def _reading(stamps: str, frame: str | None, path: Path) -> Reading:
    """How to read a log, with progress on a terminal."""
    from recordings.logs import Reading

    if stamps not in ("header", "log"):
        raise InputError(f"--stamps {stamps}: must be header or log")

    def tick(share: float) -> None:
        if sys.stderr.isatty():
            typer.echo(f"\r\033[K{path.name} {share:.0%}", err=True, nl=share >= 1)

    return Reading(stamps="log" if stamps == "log" else "header", frame=frame, tick=tick)
