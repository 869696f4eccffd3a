"""`stopgo runs`: lists the plans and runs in a folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import printable, printable_lines


def add_commands(app: typer.Typer) -> None:
    """Add the command to `stopgo`."""
    app.command(epilog="Example: stopgo runs recordings")(runs)


def runs(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder; those below it count too, but no hidden ones.")
    ],
    json_: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """List plans and runs in a folder, the newest run first, with what each acquired.

    Keeps an index in the folder, and reads only recordings that are new or have changed. stopgo site shows
    them in a browser.
    """
    from stopgo.recordings.catalog.run_index import index_json, index_of, index_text

    with running(f"reading {folder}"):
        index = index_of(folder, say=lambda line: typer.echo(printable(line), err=True))
    text = json.dumps(index_json(index), ensure_ascii=False) if json_ else printable_lines(index_text(index))
    typer.echo(text)
    for fault in index.faults():
        typer.echo(f"stopgo: {printable(fault)}", err=True)
