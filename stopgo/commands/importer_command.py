"""`rerun-importer-stopgo`: shows a mission or a floor that a user opens in Rerun's viewer."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import Annotated

import typer

IMPORTER = "rerun-importer"
"""Hidden command behind the executable `rerun-importer-stopgo`."""
EXAMPLE = "Example: rerun-importer-stopgo mission.json --recording-id r1 > mission.rrd"


def add_commands(app: typer.Typer) -> None:
    """Add the command to `stopgo`."""
    app.command(
        IMPORTER,
        hidden=True,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
        epilog=EXAMPLE,
    )(rerun_importer)


def rerun_importer(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="File opened in Rerun.")],
    recording_id: Annotated[str | None, typer.Option(help="Id of a floor's recording.")] = None,
) -> int:
    """Write a mission or a floor to stdout as a recording, as Rerun requires of its importers.

    Exit code 66: the file is neither. Rerun's other options have no effect: stopgo names and times its
    recordings the same for every viewer.
    """
    from stopgo.recordings.viewing.importer import NOT_OURS, is_ours, recording_of

    if not is_ours(path):
        return NOT_OURS
    with contextlib.redirect_stdout(sys.stderr):
        from stopgo.planner.floors import read_floor

        recording = recording_of(path, recording_id, read_floor)
    sys.stdout.buffer.write(recording)
    return 0
