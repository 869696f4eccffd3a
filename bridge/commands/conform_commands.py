"""`stopgo conform`: puts somebody else's robot or station through its paces by the protocol."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    As,
    Connect,
    Insecure,
    KeyFolder,
    RobotName,
    SiteName,
    Timeout,
)
from stopgo.bridge.commands.order_commands import Json, TakeOver
from stopgo.bridge.console import Bar, print_json, say, tell, tell_lines
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.bridge.conform.requirements import ConformVerdict
    from stopgo.bridge.conform.robot_bench import RobotBench
    from stopgo.mission.run.events import Pose

TRIED = ("requirements", 1)


def conform_commands() -> typer.Typer:
    """`stopgo conform` with its two kinds of peers."""
    commands = typer.Typer(
        help="Put a robot or a station of another make through its paces, and tell which requirement of"
        " docs/reference/protocol.md it does not meet."
        f"\n\nExample: stopgo conform robot --robot r1 --connect {DEFAULT_ENDPOINT} --drive",
    )
    commands.command("robot")(conform_robot)
    commands.command("station")(conform_station)
    return commands


def conform_robot(
    *,
    robot: RobotName,
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    keys: KeyFolder = None,
    other_keys: Annotated[
        Path | None, typer.Option(metavar="DIR", help="A second station's keys, to see who may order what.")
    ] = None,
    who: As = None,
    drive: Annotated[
        bool, typer.Option("--drive", help="Let it drive, half a metre ahead of where it stands and back.")
    ] = False,
    restart: Annotated[
        str | None, typer.Option(metavar="COMMAND", help="Starts the robot's program anew, and returns.")
    ] = None,
    take_over: TakeOver = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Be a station that tries every requirement on a robot, and print what it meets and what it does not.

    The robot is given small missions of its own around the place where it stands; the one that lay there
    lies ready again at the end. It does not move without --drive. A robot on a run is not touched.

    Ends with 0 if nothing failed, 1 if something did, 2 if nothing was tried, and 3 if the robot stopped
    answering.

    Example: stopgo conform robot --robot r1 --connect tcp/127.0.0.1:7447

    Example: stopgo conform robot --robot r1 --keys ~/keys/alice --other-keys ~/keys/bob --drive
    """
    from stopgo.bridge.conform.conform_robot import REQUIREMENTS, ConformOptions, robot_bench, robot_verdicts

    options = ConformOptions(
        connect, robot, site, who, timeout, insecure, keys, other_keys, take_over, restart
    )
    with robot_bench(options) as bench, Bar("conform", TRIED) as bar:
        _say_what_it_will_do(bench, drive=drive)
        found: list[ConformVerdict] = []
        for verdict in robot_verdicts(bench, drive=drive):
            found.append(verdict)
            bar.show(len(found), len(REQUIREMENTS) + 1)
    report(robot, "robot", found, as_json=json_)


def _say_what_it_will_do(bench: RobotBench, *, drive: bool) -> None:
    robot = bench.keys.robot
    if not drive:
        say(f"{robot} will not drive; what needs that is left out (--drive)")
        return
    pose = _where_it_stands(bench)
    say(
        f"{robot} WILL DRIVE, up to half a metre ahead of {pose.x:.2f}, {pose.y:.2f} m heading"
        f" {math.degrees(pose.heading):.0f} degrees and back, several times; keep clear. Ctrl-C aborts"
    )


def _where_it_stands(bench: RobotBench) -> Pose:
    from stopgo.bridge.conform.requirements import NotTried

    try:
        return bench.pose()
    except NotTried as why:
        raise InputError(f"{bench.keys.robot} cannot be let drive: {why}; leave --drive out") from None


def conform_station(
    *,
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where the fake robot listens.")] = (
        DEFAULT_ENDPOINT
    ),
    name: Annotated[str, typer.Option("--name", help="Name of the fake robot.")] = "r1",
    site: SiteName = None,
    keys: KeyFolder = None,
    command: Annotated[
        str | None,
        typer.Option(
            metavar="COMMAND",
            help="Lets the station act; {what} stands for `push FILE`, `start`, … Else you are asked.",
        ),
    ] = None,
    patience: Annotated[
        float, typer.Option(metavar="S", min=1, help="How long you may take for each, without --command.")
    ] = 120.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Be a robot that tries every requirement on a station, and print what it meets and what it does not.

    The robot is simulated, and drives nothing. Its answers are lost, late, forged, of a newer version, and of
    two robots at once. The command ends with 0 where the station says done, 1 where it says that the robot
    refused, and 3 where it says that the outcome is unknown.

    Ends with 0 if nothing failed, 1 if something did, and 2 if nothing was tried.

    Example: stopgo conform station --listen tcp/127.0.0.1:7447 --command "my-station {what} --robot r1"
    """
    from stopgo.bridge.conform.conform_station import StationOptions, station_bench, station_verdicts
    from stopgo.bridge.conform.station_requirements import STATION_REQUIREMENTS

    options = StationOptions(listen, name, site, keys, insecure, command, patience, say)
    found: list[ConformVerdict] = []
    ready = partial(say, f"ready {name} listens on {listen}")
    with station_bench(options, ready) as bench, Bar("conform", TRIED) as bar:
        for verdict in station_verdicts(bench):
            found.append(verdict)
            bar.show(len(found), len(STATION_REQUIREMENTS))
    report(f"the station of {name}", "station", found, as_json=json_)


def report(peer: str, kind: str, found: Iterable[ConformVerdict], *, as_json: bool) -> None:
    """Tell every verdict, and end with the exit code that they come to."""
    from stopgo.bridge.conform.requirements import counted
    from stopgo.mission.console.table import table

    found = list(found)
    counts = counted(found)
    if as_json:
        told = [
            {"section": one.section, "requirement": one.text, "outcome": one.outcome, "reason": one.reason}
            for one in found
        ]
        print_json({kind: peer, "counts": counts, "requirements": told})
    else:
        rows = [(one.section, one.text, one.outcome, one.reason) for one in found]
        tell_lines(table(("protocol.md", "requirement", "outcome", "why"), rows))
        told_counts = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
        tell(f"{peer}: {told_counts}")
    if any(one.gone for one in found):
        raise typer.Exit(3)
    if counts["failed"]:
        raise typer.Exit(1)
    if not counts["passed"]:
        raise typer.Exit(2)
