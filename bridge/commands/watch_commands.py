"""`stopgo watch`: follows a run, and records it if that is wanted."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer

from stopgo.bridge.commands.connection import Connection, reached, with_connection
from stopgo.bridge.commands.order_commands import Json, status_json
from stopgo.bridge.console import print_json, say, tell, tell_lines

if TYPE_CHECKING:
    from stopgo.bridge.station.watch import Showing
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.mission.run.events import StateReport


class Recorder(Protocol):
    """Opens what hears a run: records it at a path, looked at if wanted, and knows its plan."""

    def __call__(
        self, path: Path | None, plan: Path | None, *, view: bool
    ) -> AbstractContextManager[RunCollector]: ...


def watch_by(recording: Recorder) -> Callable[..., None]:
    """The command that follows a run, and records it by `recording`."""

    @with_connection()
    def watch(
        connection: Connection,
        *,
        rrd: Annotated[
            Path | None, typer.Option("--rrd", metavar="FIELD.rrd", help="Record the run for Rerun.")
        ] = None,
        plan: Annotated[
            Path | None,
            typer.Option("--plan", metavar="PLAN.rrd", help="Its plan: what the stops see, and the floor."),
        ] = None,
        run: Annotated[
            str | None,
            typer.Option("--run", metavar="RUN_ID", help="One that is over, from the robot's own record."),
        ] = None,
        view: Annotated[bool, typer.Option("--view", help="Open the viewer on what is recorded.")] = False,
        json_: Json = False,
    ) -> None:
        """Follow the robot's run until it ends, gaps filled from its journal; Ctrl-C never touches the robot.

        Then tells every stop as planned and as driven and, with the plan, what the scans really saw.
        Ends with 0 when the run finished and brought what was asked, 1 when it was aborted or brought less
        (without the plan: when a stop was left out), 3 when nobody says that stops were scanned, as of some
        autopilots, and 2 when it brought it and its recording is incomplete, as on a full disk. While a
        vehicle is watched over MAVLink, what its mission says of a stop that failed is done by this command.

        With --run a line that is cut in between is waited for, and reading goes on where it
        was. A command that was ended and is given again reads the run from its beginning, and writes --rrd
        anew.

        The timeline goes to stdout. With --json that is one object a line for every event, and for the state
        and the comparison at the end.

        Example: stopgo watch --robot r1 --plan plan.rrd --rrd field.rrd

        Example: stopgo watch --robot r1 --run 424b529f524b --rrd field.rrd

        Example: stopgo watch --mavlink udpout:127.0.0.1:14550 --rrd field.rrd
        """
        from stopgo.bridge.station.watch import EventObjects, Lines, Table, watch_showing

        showing: Showing = Lines(lambda line: tell(line, at_once=True))
        if json_:
            showing = EventObjects(print_json)
        elif sys.stdout.isatty():
            showing = Table(sys.stdout.write)
        with (
            recording(rrd, plan, view=view) as heard,
            reached(connection.to_look(compares=True)) as station,
        ):
            state = watch_showing(station, heard, showing, run_id=run)
            code = tell_compared(heard, state, json_=json_)
            if code:  # which weighs more than what became of the recording
                raise typer.Exit(code)

    return watch


def tell_compared(heard: RunCollector, state: StateReport, *, json_: bool) -> int:
    """Tell the run beside its mission; the exit code that it comes to."""
    from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
    from stopgo.mission.comparing.run_verdict import judge

    compared = heard.compared()
    if json_:
        beside = {} if compared is None else {"comparison": comparison_json(compared)}
        print_json(status_json(state) | beside)
    elif compared is not None:
        tell_lines(comparison_text(compared))
    if compared is None or state.state != "FINISHED":
        return 0 if state.state == "FINISHED" else 1
    if heard.sights and compared.acquired is None:
        say("--plan: is the plan of another mission than was run; what the scans saw is not known")
    return judge(compared).exit_code
