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
        list[Path], typer.Argument(metavar="RECORDING.rrd...", help="Plan or field recordings.")
    ],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Open them together in the Rerun viewer.")] = False,
) -> None:
    """Read recordings to their end, and tell what they hold."""
    from recordings.review import review as read

    reviews = [read(path) for path in recordings]
    if json_:
        told = [item.as_json() for item in reviews]
        typer.echo(json.dumps(told[0] if len(told) == 1 else {"recordings": told}, ensure_ascii=False))
    else:
        from mission.table import printable_lines

        lines = (f"{path}: {item.as_text()}" for path, item in zip(recordings, reviews, strict=True))
        typer.echo(printable_lines("\n".join(lines)))
    if view:
        from recordings.viewer import open_viewer

        open_viewer(recordings)
