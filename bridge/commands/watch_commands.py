"""`stopgo watch`: follows a run, and records it if that is wanted."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from bridge.commands.connection import Connection, reached, with_connection
from bridge.commands.order_commands import Json, status_json
from bridge.console import print_json, say

if TYPE_CHECKING:
    from bridge.station.watch import Recording


class Recorder(Protocol):
    """Opens a recording at a path, looked at if wanted; `None` without one."""

    def __call__(self, path: Path | None, *, view: bool) -> AbstractContextManager[Recording | None]: ...


def watch_by(recording: Recorder) -> Callable[..., None]:
    """The command that follows a run, and records it by `recording`."""

    @with_connection(without=("who",))
    def watch(
        connection: Connection,
        *,
        rrd: Annotated[
            Path | None, typer.Option("--rrd", metavar="FIELD.rrd", help="Record the run for Rerun.")
        ] = None,
        view: Annotated[bool, typer.Option("--view", help="Open the viewer on what is recorded.")] = False,
        json_: Json = False,
    ) -> None:
        """Follow the robot's run until it ends, gaps filled from its journal; Ctrl-C never touches the robot.

        Ends with 0 when the run finished, 1 when it was aborted, and 2 when it finished and its recording is
        incomplete, as on a full disk. While a vehicle is watched over MAVLink, what
        its mission says of a stop that failed is done by this command.

        Example: stopgo watch --robot r1 --rrd field.rrd

        Example: stopgo watch --mavlink udpout:127.0.0.1:14550 --rrd field.rrd
        """
        from bridge.station.watch import Lines, Table, watch_showing

        with (
            recording(rrd, view=view) as record,
            reached(connection.to_look(compares=True)) as station,
        ):
            state = watch_showing(station, record, Table() if sys.stderr.isatty() else Lines(say))
            if json_:
                print_json(status_json(state))
            if state.state != "FINISHED":  # which weighs more than what became of the recording
                raise typer.Exit(1)

    return watch
