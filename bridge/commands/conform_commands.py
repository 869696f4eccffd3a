"""`stopgo conform`: tests a third-party robot or station against the protocol."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    ActionTime,
    As,
    Connect,
    Insecure,
    Json,
    KeyFolder,
    Listen,
    MayDrive,
    OtherKeyFolder,
    OwnName,
    RestartCommand,
    RobotName,
    SiteName,
    SlowDiskCommand,
    StationCommand,
    TakeOver,
    Timeout,
)
from stopgo.bridge.conform.requirements import NotTried, count_outcomes, untested
from stopgo.bridge.console import Bar, print_json, print_line, print_text, say
from stopgo.mission.console.table import table
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.bridge.conform.requirements import ConformVerdict
    from stopgo.bridge.conform.robot_bench import RobotBench
    from stopgo.mission.run.events import Pose

REQUIREMENTS_UNIT = ("requirements", 1)
"""Unit of the progress bars."""


def conform_commands() -> typer.Typer:
    """Return `stopgo conform` with its two kinds of peers."""
    commands = typer.Typer(
        help="Test a third-party robot or station, and print which requirements of"
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
    other_keys: OtherKeyFolder = None,
    who: As = None,
    drive: MayDrive = False,
    restart: RestartCommand = None,
    slow_disk: SlowDiskCommand = None,
    take_over: TakeOver = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Test every requirement on a robot, as a station, and print which it meets and which it does not.

    The robot receives small missions around its present position; its own is stored again at the end. It
    does not move without --drive, and is not tested on a run. Durability is tested by a restart.
    Ends with 0 if nothing failed, 1 if something did, 2 if nothing was tested, and 3 if the robot stopped
    answering or its durability was not tested.

    Example: stopgo conform robot --robot r1 --keys ~/keys/alice --other-keys ~/keys/bob --drive
    """
    from stopgo.bridge.conform.conform_robot import REQUIREMENTS, ConformOptions, robot_bench, robot_verdicts

    options = ConformOptions(
        connect, robot, site, who, timeout, insecure, keys, other_keys, take_over, restart, slow_disk,
        asked=partial(ask_for_restart, robot) if sys.stdin.isatty() else None,
    )  # fmt: skip
    with robot_bench(options) as bench, Bar("conform", REQUIREMENTS_UNIT) as bar:
        _announce(bench, drive=drive)
        verdicts: list[ConformVerdict] = []
        for verdict in robot_verdicts(bench, drive=drive):
            verdicts.append(verdict)
            bar.show(len(verdicts), len(REQUIREMENTS) + 1)
    report(robot, "robot", verdicts, as_json=json_)


def ask_for_restart(robot: str) -> None:
    """Ask the person to cut the robot's power; raises `NotTried` if the answer is no."""
    say(f"{robot}: cut its power or kill its program, start it again, then press Enter (n: do not test)")
    if sys.stdin.readline().strip().lower().startswith("n"):
        raise NotTried("the robot was not restarted")


def _announce(bench: RobotBench, *, drive: bool) -> None:
    """Warn people near the robot if it will drive."""
    robot = bench.keys.robot
    if not drive:
        say(f"{robot}: will not drive, requirements that need it are not tested; add --drive")
        return
    pose = _present_pose(bench)
    say(
        f"{robot} WILL DRIVE, up to half a metre ahead of {pose.x:.2f}, {pose.y:.2f} m heading"
        f" {math.degrees(pose.heading):.0f} degrees and back, several times; keep clear. Ctrl-C aborts"
    )


def _present_pose(bench: RobotBench) -> Pose:

    try:
        return bench.pose()
    except NotTried as why:
        raise InputError(f"{bench.keys.robot}: must not drive: {why}; leave --drive out") from None


def conform_station(
    *,
    listen: Listen = DEFAULT_ENDPOINT,
    name: OwnName = "r1",
    site: SiteName = None,
    keys: KeyFolder = None,
    command: StationCommand = None,
    patience: ActionTime = 120.0,
    insecure: Insecure = False,
    json_: Json = False,
) -> None:
    """Test every requirement on a station, as a robot, and print which it meets and which it does not.

    The robot is simulated, and drives nothing. Its answers are lost, late, forged, of a newer version, and of
    two robots at once. COMMAND must end with 0 where the station reports success, 1 where it reports that the
    robot refused, and 3 where it reports an unknown outcome.

    Ends with 0 if nothing failed, 1 if something did, and 2 if nothing was tested.

    Example: stopgo conform station --listen tcp/127.0.0.1:7447 --command "my-station {what} --robot r1"
    """
    from stopgo.bridge.conform.conform_station import StationOptions, station_bench, station_verdicts
    from stopgo.bridge.conform.station_requirements import STATION_REQUIREMENTS

    options = StationOptions(listen, name, site, keys, insecure, command, patience, say)
    verdicts: list[ConformVerdict] = []
    ready = partial(say, f"ready {name} listens on {listen}")
    with station_bench(options, ready) as bench, Bar("conform", REQUIREMENTS_UNIT) as bar:
        for verdict in station_verdicts(bench):
            verdicts.append(verdict)
            bar.show(len(verdicts), len(STATION_REQUIREMENTS))
    report(f"the station of {name}", "station", verdicts, as_json=json_)


def report(peer: str, kind: str, verdicts: Iterable[ConformVerdict], *, as_json: bool) -> None:
    """Print every verdict, and exit with the code that follows from them."""

    verdicts = list(verdicts)
    counts = count_outcomes(verdicts)
    if as_json:
        requirements = [
            {"section": one.section, "requirement": one.text, "outcome": one.outcome, "reason": one.reason}
            for one in verdicts
        ]
        print_json({kind: peer, "counts": counts, "requirements": requirements})
    else:
        rows = [(one.section, one.text, one.outcome, one.reason) for one in verdicts]
        print_text(table(("protocol.md", "requirement", "outcome", "why"), rows))
        summary = ", ".join(f"{count} {outcome}" for outcome, count in counts.items())
        print_line(f"{peer}: {summary}")
    not_tested = untested(verdicts)
    if not_tested:
        say(f"{peer}: not a pass, durability was not tested: {'; '.join(not_tested)}; add --restart COMMAND")
    if any(one.lost for one in verdicts):
        raise typer.Exit(3)
    if counts["failed"]:
        raise typer.Exit(1)
    if not counts["passed"]:
        raise typer.Exit(2)
    if not_tested:
        raise typer.Exit(3)
