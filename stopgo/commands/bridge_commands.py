"""The bridge's commands for the CLI, and the recorder that `watch` writes and compares runs with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stopgo.bridge.commands.conform_commands import conform_commands
from stopgo.bridge.commands.doctor import doctor
from stopgo.bridge.commands.key_commands import key_commands
from stopgo.bridge.commands.mission_commands import clear, fetch_mission, push
from stopgo.bridge.commands.robot_commands import guard, robot
from stopgo.bridge.commands.run_control_commands import add_run_control
from stopgo.bridge.commands.session_command import session
from stopgo.bridge.commands.simulate_commands import simulate_commands
from stopgo.bridge.commands.tunnel_commands import tunnel_commands
from stopgo.bridge.commands.watch_commands import watch_command
from stopgo.bridge.console import say
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.mission.comparing.run_collector import RunCollector, RunSink
    from stopgo.recordings.embedded.reading import Recording


def add_commands(app: typer.Typer) -> None:
    """Add the bridge's commands to the CLI."""
    app.command()(robot)
    app.command()(guard)
    app.command()(push)
    app.command("fetch-mission")(fetch_mission)
    app.command()(clear)
    app.command()(doctor)
    add_run_control(app)
    app.command()(session)
    app.command()(watch_command(recording))
    app.add_typer(simulate_commands(), name="simulate")
    app.add_typer(key_commands(), name="keys")
    app.add_typer(conform_commands(), name="conform")
    app.add_typer(tunnel_commands(), name="tunnel")


@contextmanager
def recording(path: Path | None, plan: Path | None, *, view: bool) -> Iterator[RunCollector]:
    """Open the collector of a run; it records at `path`, for a viewer if wanted, and knows the plan.

    Rerun is loaded only for a recording or a plan.
    """
    from stopgo.mission.comparing.run_collector import RunCollector

    if path is None and view:
        raise InputError("--view: no recording to show; add one with --rrd FIELD.rrd")
    planned = None if plan is None else plan_recording(plan)
    with nullcontext() if path is None else _field(path, planned, view=view) as record:
        yield RunCollector(record, () if planned is None else planned.sights)


def _field(path: Path, plan: Recording | None, *, view: bool) -> AbstractContextManager[RunSink]:
    from stopgo.recordings.runs.field import FieldRecording

    record = FieldRecording(path, plan=plan, say=say)
    if not view:
        return record
    from stopgo.recordings.viewing.viewer import Viewed

    return Viewed(record)


def plan_recording(path: Path) -> Recording:
    """Read a plan's recording, which must contain the visibility of its stops."""
    from stopgo.recordings.embedded.reading import read_recording

    found = read_recording(path)
    if not found.sights:
        raise InputError(f"{path}: contains no visibility data; give a plan.rrd that this version wrote")
    return found
