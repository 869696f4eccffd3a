"""The bridge's commands, each added to the front door; what `watch` records by is named here."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from bridge.commands.key_commands import key_commands
from bridge.commands.mission_commands import clear, fetch_mission, push
from bridge.commands.order_commands import add_orders
from bridge.commands.robot_commands import robot
from bridge.commands.simulate_commands import simulate_commands
from bridge.commands.tunnel_commands import tunnel_commands
from bridge.commands.watch_commands import watch_by
from bridge.console import say
from mission.errors import InputError

if TYPE_CHECKING:
    from bridge.station.watch import Recording


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command()(robot)
    app.command()(push)
    app.command("fetch-mission")(fetch_mission)
    app.command()(clear)
    add_orders(app)
    app.command()(watch_by(recording))
    app.add_typer(simulate_commands(), name="simulate")
    app.add_typer(key_commands(), name="keys")
    app.add_typer(tunnel_commands(), name="tunnel")


def recording(path: Path | None, *, view: bool) -> AbstractContextManager[Recording | None]:
    """The field recording at `path`, looked at if wanted; nothing of Rerun is loaded without one."""
    if path is None and view:
        raise InputError("--view shows what is recorded: say where, with --rrd FIELD.rrd")
    if path is None:
        return nullcontext()
    from recordings.field import FieldRecording

    record = FieldRecording(path, say=say)
    if not view:
        return record
    from recordings.viewer import Viewed

    return Viewed(record)
