"""Commands of this folder: `review` reads a recording back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command(epilog="Example: stopgo review plan.rrd field.rrd --view")(review)


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
