"""`stopgo watch`: follows a run until it ends, and records it if `--rrd` is given."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import typer

from stopgo.bridge.commands.bridge_options import (
    FinishedRun,
    Json,
    PlanRecordingFile,
    RosDomain,
    RunRecordingFile,
    View,
)
from stopgo.bridge.commands.connection import (
    Connection,
    given_options,
    reached,
    refuse_options,
    shown_stop_of,
    with_connection,
    with_parameters,
)
from stopgo.bridge.commands.ros_checks import ros_status_text
from stopgo.bridge.commands.ros_watch import watch_ros
from stopgo.bridge.commands.run_control_commands import status_json
from stopgo.bridge.console import print_json, print_line, print_text, say

if TYPE_CHECKING:
    from stopgo.bridge.station.follow import Followed
    from stopgo.bridge.station.shown_stop import ShownStopFile
    from stopgo.bridge.station.watch import RunDisplay
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.mission.document import Mission
    from stopgo.mission.run.events import StateReport


class Recorder(Protocol):
    """Opens the collector of a run, which writes a recording at a path and knows the run's plan."""

    def __call__(
        self, path: Path | None, plan: Path | None, *, view: bool
    ) -> AbstractContextManager[RunCollector]: ...


WATCH_HELP = """\
Follow the robot's run until it ends, gaps filled from its journal; Ctrl-C leaves the robot alone.

Then print every stop as planned and as driven and, with the plan, the coverage of the scans.
Ends with 0 when the scans have the required coverage, also of an aborted run, 1 when they covered less
(without the plan: when a stop was left out), 3 when it is undecided, as without confirmed
scans, and 2 when the run is complete and its recording is not, as on a full disk. While a
vehicle is watched over MAVLink, this command does what the mission says for a stop that failed.

With --run a link loss is waited out, and reading continues at the same entry. A command
that was ended and is given again reads the run from its beginning, and overwrites --rrd.

The timeline goes to stdout. With --json that is one object a line for every event, and for the state
and the comparison at the end.

Example: stopgo watch --robot r1 --plan plan.rrd --rrd field.rrd

Example: stopgo watch --robot r1 --run 424b529f524b --rrd field.rrd

Example: stopgo watch --mavlink udpout:127.0.0.1:14550 --rrd field.rrd

Example: stopgo watch --ros2 0/r1 --connect tcp/10.1.2.3:7447
"""

WITHOUT_ROS2 = ("--robot", "--mavlink", "--site", "--keys", "--rrd", "--plan", "--run", "--view")
"""Options that have no meaning with `--ros2`."""


def watch_command(recorder: Recorder) -> Callable[..., None]:
    """Return the command that follows a run, and records it by `recorder`."""

    def watch(
        connection: Connection,
        *,
        rrd: RunRecordingFile = None,
        plan: PlanRecordingFile = None,
        run: FinishedRun = None,
        view: View = False,
        json_: Json = False,
    ) -> None:
        with recorder(rrd, plan, view=view) as collector:
            follow_and_judge(connection, collector, run, as_json=json_)

    watch.__doc__ = WATCH_HELP
    return _or_ros2(with_connection()(watch))


def _or_ros2(watch: Callable[..., None]) -> Callable[..., None]:
    """Add `--ros2` to the command, with which it follows a robot's topics instead."""

    def chosen(context: typer.Context, *, ros2: RosDomain = None, **values: Any) -> None:
        if ros2 is None:
            return watch(context, **values)
        refuse_options(given_options(context), "--ros2", *WITHOUT_ROS2)
        return watch_topics(ros2, values["connect"], as_json=values["json_"])

    added = inspect.Parameter("ros2", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=RosDomain)
    return with_parameters(chosen, watch, [*inspect.signature(watch).parameters.values(), added])


def watch_topics(ros2: str, endpoint: str, *, as_json: bool) -> None:
    """Print a robot's state at each change of its topics; its scans are not proved by them."""
    from stopgo.mission.comparing.run_verdict import EXIT_CODES

    refused: list[str] = []

    def show(found: dict[str, Any]) -> None:
        if as_json:
            print_json(found)
            return
        for line in found["refused"]:
            if line not in refused:
                say(line)
        refused[:] = found["refused"]
        print_line(ros_status_text(found), flush=True)

    state = watch_ros(ros2, endpoint, show)
    say(f"the robot reports {state}; its topics do not prove its scans: review its recording")
    raise typer.Exit(EXIT_CODES["unknown"])


def follow_and_judge(
    connection: Connection, collector: RunCollector, run_id: str | None, *, as_json: bool
) -> None:
    """Follow a run to its end, print its comparison with the mission, and exit with the verdict's code."""
    from stopgo.bridge.station.watch import watch_with

    with reached(connection.for_reading(compares=True)) as station:
        display = RememberingDisplay(_display(as_json=as_json), shown_stop_of(connection))
        state = watch_with(station, collector, display, run_id=run_id)
        code = print_comparison(collector, state, as_json=as_json)
        if code:  # takes precedence over a failure to close the recording
            raise typer.Exit(code)


class RememberingDisplay:
    """A display that remembers the stop which it shows: a skip is meant for that one."""

    def __init__(self, display: RunDisplay, shown: ShownStopFile) -> None:
        self._display = display
        self._shown = shown

    def mission(self, mission: Mission) -> None:
        self._display.mission(mission)

    def show(self, report: Followed) -> None:
        from stopgo.mission.run.events import Arrived, StateReport

        if isinstance(report, Arrived | StateReport):
            self._shown.remember(report.run_id, report.stop)
        self._display.show(report)


def _display(*, as_json: bool) -> RunDisplay:
    from stopgo.bridge.station.watch import EventLines, EventObjects, RunTable

    if as_json:
        return EventObjects(print_json)
    if sys.stdout.isatty():
        return RunTable(sys.stdout.write)
    return EventLines(lambda line: print_line(line, flush=True))


def print_comparison(collector: RunCollector, state: StateReport, *, as_json: bool) -> int:
    """Print the run's comparison with its mission; return the exit code."""
    from stopgo.mission.comparing.comparison_text import comparison_json, comparison_text
    from stopgo.mission.comparing.run_verdict import EXIT_CODES, judge

    comparison = collector.compared()
    if as_json:
        compared = {} if comparison is None else {"comparison": comparison_json(comparison)}
        print_json(status_json(state) | compared)
    elif comparison is not None:
        print_text(comparison_text(comparison))
    if comparison is None:
        say("the run is over, but no event or no mission of it was received: its scans are unknown")
        return EXIT_CODES["unknown"]
    if collector.sights and comparison.acquired is None:
        say("--plan: belongs to another mission than the run; the coverage of the scans is not known")
    return judge(comparison).exit_code
