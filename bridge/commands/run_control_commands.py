"""The commands that control a run (`start`, `pause`, ... `home`), and `status`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    Again,
    AllRobots,
    AnyOrigin,
    Arm,
    Connect,
    Disarm,
    Forget,
    FromHere,
    Insecure,
    Json,
    KeyFolder,
    MavlinkUrl,
    RobotOrAll,
    RosDomain,
    Roster,
    SigningKey,
    SiteName,
    StateFolder,
    StopId,
    TakeOver,
    Timeout,
    VehicleId,
)
from stopgo.bridge.commands.connection import (
    VEHICLES,
    Connection,
    GivenOptions,
    connection_of,
    given_options,
    in_time,
    refuse_options,
    shown_stop_of,
    with_connection,
    with_presets,
)
from stopgo.bridge.commands.ros_checks import ros_status, ros_status_text
from stopgo.bridge.console import print_json, print_line, refusals_printed, reporting_done, say
from stopgo.mission.errors import NegativeResult

if TYPE_CHECKING:
    from stopgo.bridge.station.fleet import FleetMember
    from stopgo.bridge.station.roster import LastSeen
    from stopgo.bridge.station.shown_stop import ShownStopFile
    from stopgo.bridge.station.station import Station
    from stopgo.mission.run.events import StateReport
    from stopgo.mission.run.run_commands import Answer, Verb

STATUS_KEYS = (
    "robot", "boot_id", "state", "run_id", "mission_id", "revision", "stop", "done", "skipped", "outside",
    "battery", "battery_ok", "position_ok", "fence_ok",
)  # fmt: skip


def add_run_control(app: typer.Typer) -> None:
    """Add the commands of this module to the front door."""
    app.command()(start)
    for verb in ABOUT:
        app.command(name=verb)(order_of(verb))
    app.command()(status)


@with_connection()
def start(
    connection: Connection,
    *,
    take_over: TakeOver = False,
    again: Again = False,
    from_here: FromHere = False,
    arm: Arm = False,
    any_origin: AnyOrigin = False,
    json_: Json = False,
) -> None:
    """Start the mission that is stored on the robot.

    Example: stopgo start --robot r1 --connect tcp/127.0.0.1:7447

    Example: stopgo start --mavlink udpout:127.0.0.1:14550 --arm
    """
    driving = connection.for_driving(arm=arm, any_origin=any_origin)
    with refusals_printed(as_json=json_), in_time(driving) as station:
        answer = station.command("start", again=again, from_here=from_here, take_over=take_over)
    report_answer(answer, station.keys.robot, json_)


ABOUT: dict[Verb, str] = {
    "pause": "Pause the robot at standstill; a scan in progress is finished. Any station may.",
    "resume": "Resume a paused robot, from its present position.",
    "skip": "Skip the stop that this station showed last, or --stop; the robot still drives its path.",
    "retry": "Let a robot that is held try again.",
    "abort": "End the run at the robot's present position. Any station may.",
    "home": "End the run and drive back along the legs that were driven.",
}
"""Help of each command."""
NO_EFFECT: dict[Verb, tuple[str, ...]] = {
    "pause": ("stop", "take_over", "arm", "any_origin", "disarm"),
    "resume": ("stop", "disarm"),
    "skip": ("disarm",),
    "retry": ("disarm",),
    "abort": ("stop", "take_over", "arm", "any_origin"),
    "home": ("stop", "arm", "any_origin", "disarm", "mavlink", "vehicle", "signing_key", "state"),
}
"""Options that have no effect on each command, and that it does not take."""


def stops(verb: Verb) -> bool:
    """Return True for a command that stops a robot in every state."""
    from stopgo.mission.run.run_commands import FREE_VERBS

    return verb in FREE_VERBS


def order_of(verb: Verb) -> Callable[..., None]:
    """Return the command of the CLI that sends `verb` to a robot."""

    def command(
        connection: Connection,
        *,
        stop: StopId = None,
        take_over: TakeOver = False,
        arm: Arm = False,
        any_origin: AnyOrigin = False,
        disarm: Disarm = False,
        json_: Json = False,
    ) -> None:
        driving = connection.for_driving(arm=arm, disarm=disarm, any_origin=any_origin)
        from stopgo.mission.run.run_commands import FREE_VERBS

        driving = driving.for_stopping(verb) if stops(verb) else driving
        at_once = verb in FREE_VERBS
        with refusals_printed(as_json=json_), in_time(driving, at_once=at_once) as station:
            if verb == "skip":
                answer = skip_stop(station, shown_stop_of(connection), stop, take_over=take_over)
            else:
                answer = station.command(verb, stop=stop, take_over=take_over)
            # before the link is closed, which may take a moment
            report_answer(answer, station.keys.robot, json_, stop=station.meant_stop)

    command.__doc__ = f"{ABOUT[verb]}\n\nExample: stopgo {verb} --robot r1 --connect {DEFAULT_ENDPOINT}"
    return with_connection(without=NO_EFFECT[verb], stopping=stops(verb))(command)


def skip_stop(station: Station, shown: ShownStopFile, stop: str | None, *, take_over: bool) -> Answer:
    """Skip a stop, else the one that this station showed last: the robot may be at another by now."""
    before = shown.read() if stop is None else None
    try:
        answer = station.command("skip", stop=stop, take_over=take_over, shown=before)
    except NegativeResult as no:
        if no.reason != "not_at_stop" or stop is not None:
            raise
        raise NegativeResult(
            f"{no}, which this station showed last; see stopgo status, or name the stop with --stop",
            reason=no.reason,
        ) from None
    shown.remember(answer.run_id, station.meant_stop)
    return answer


def status(
    context: typer.Context,
    *,
    robot: RobotOrAll = None,
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    mavlink: MavlinkUrl = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    state: StateFolder = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    all_: AllRobots = False,
    roster: Roster = None,
    forget: Forget = None,
    ros2: RosDomain = None,
    json_: Json = False,
) -> None:
    """Print the state of the robot, or of all robots of the site; 1 if one of those does not answer.

    Example: stopgo status --robot r1 --json

    Example: stopgo status --connect tls/router.site:7447 --keys ~/keys/alice --roster robots.toml

    Example: stopgo status --ros2 0/r1 --connect tcp/10.1.2.3:7447
    """
    given = given_options(context)
    if ros2 is not None:
        return print_ros_status(given, ros2, connect, as_json=json_)
    named: dict[str, Any] = {"robot": robot, "mavlink": mavlink, "connect": connect, "site": site}
    named = with_robots(given, named | {"keys": keys}, all_=all_)
    if named["robot"] is None and named["mavlink"] is None:
        refuse_options(given, "all robots of a site", *VEHICLES)
        return fleet_status(named, roster, forget or [], timeout, insecure=insecure, as_json=json_)
    refuse_options(given, "one robot", "--roster", "--forget")
    named |= {"vehicle": vehicle, "signing_key": signing_key, "state": state}
    print_status(connection_of(given, timeout=timeout, insecure=insecure, **named), as_json=json_)


def with_robots(given: GivenOptions, named: dict[str, Any], *, all_: bool) -> dict[str, Any]:
    """Return the options with their presets; with `--all` a preset robot or vehicle does not apply."""
    named = with_presets(given, named)
    if not all_:
        return named
    refuse_options(given, "--all", "--robot", "--mavlink")
    return named | {"robot": None, "mavlink": None}


def print_ros_status(given: GivenOptions, ros2: str, endpoint: str, *, as_json: bool) -> None:
    """Print the state of a robot that speaks ROS 2 over zenoh; exit code 1 if nothing of it is known."""
    refuse_options(
        given, "--ros2", "--robot", "--mavlink", "--site", "--keys", "--all", "--roster", "--forget"
    )
    found = ros_status(ros2, endpoint)
    for refused in found["refused"]:
        say(refused)
    if as_json:
        print_json(found)
    else:
        print_line(ros_status_text(found))
    if found["pose"] is None and found["state"] is None:
        raise typer.Exit(1)


def print_status(connection: Connection, *, as_json: bool) -> None:
    """Request the state of one robot, and print it."""
    with in_time(connection.for_reading()) as station:
        report = station.status()
        age_s = time.monotonic() - station.asked_at
    shown_stop_of(connection).remember(report.run_id, report.stop)
    if as_json:
        print_json(status_json(report) | {"age_s": round(age_s, 3)})
    else:
        print_line(f"{state_line(report)}; at most {math.ceil(age_s * 10) / 10:.1f} s old")


def fleet_status(
    named: dict[str, Any],
    roster: Path | None,
    forgotten: Sequence[str],
    timeout_s: float,
    *,
    insecure: bool,
    as_json: bool,
) -> None:
    """Print the state of all robots of a site, also of the expected ones; exit code 1 if one is silent."""
    from stopgo.bridge.link.keys import now_utc
    from stopgo.bridge.station.fleet import fleet
    from stopgo.bridge.station.roster import LastSeen, forget, read_sightings, remember
    from stopgo.bridge.station.shown_stop import ShownStopFile

    path = sightings_file(named)
    if forgotten:
        forget(path, forgotten)
    before = read_sightings(path)
    known = tuple(before) if roster is None else _expected_robots(roster)
    members = fleet(
        named["connect"], site=named["site"], known=known, timeout_s=timeout_s, insecure=insecure,
        keys=named["keys"],
    )  # fmt: skip
    seen = {
        member.robot: LastSeen(at=now_utc(), state=member.state.state) for member in members if member.state
    }
    if seen:
        remember(path, seen)
    for member in members:
        if member.state is not None:
            shown = ShownStopFile(named["connect"], named["site"], member.robot)
            shown.remember(member.state.run_id, member.state.stop)
    if as_json:
        print_json({"robots": [member_json(member, before.get(member.robot)) for member in members]})
    else:
        for member in members:
            print_line(member_line(member, before.get(member.robot)))
    if len(seen) < len(members):
        raise typer.Exit(1)


def _expected_robots(roster: Path) -> tuple[str, ...]:
    """Return the robots of a roster; its vehicles, which a status of robots does not query, are named."""
    from stopgo.bridge.station.roster import read_roster, read_roster_vehicles

    for name in read_roster_vehicles(roster):
        say(f"{roster}: vehicle {name} is not queried; use stopgo status --mavlink URL, or stopgo site")
    return read_roster(roster)


def sightings_file(named: dict[str, Any]) -> Path:
    """Return the file of the robots that were seen at an endpoint and a site."""
    from stopgo.bridge.station.roster import default_sightings_file

    return default_sightings_file(named["connect"], named["site"])


def member_json(member: FleetMember, before: LastSeen | None) -> dict[str, Any]:
    """Return a robot's state for JSON; the keys are the same for a robot that does not answer."""
    state = dict.fromkeys(STATUS_KEYS) if member.state is None else status_json(member.state)
    last = None if before is None or member.state else before.at.isoformat(timespec="seconds")
    return state | {
        "robot": member.robot,
        "silent": member.state is None,
        "trouble": member.trouble,
        "last_seen": last,
    }


def member_line(member: FleetMember, before: LastSeen | None) -> str:
    """Return the line of one robot of a fleet."""
    if member.state is not None:
        return state_line(member.state)
    last = (
        "never answered from here"
        if before is None
        else f"{before.state} at its last report, {before.at:%Y-%m-%d %H:%M} UTC"
    )
    return f"{member.robot}: NO DATA; {last}; {member.trouble}"


def status_json(report: StateReport) -> dict[str, Any]:
    """Return a state for JSON."""
    return {key: getattr(report, key) for key in STATUS_KEYS} | {"battery": report.charge}


def report_answer(answer: Answer, robot: str, json_: bool, *, stop: str | None = None) -> None:
    """Print the robot's answer to a command, and the stop that it was meant for."""
    with reporting_done(f"{robot}: {answer.verb} was carried out"):
        if json_:
            told = {key: getattr(answer, key) for key in ("verb", "outcome", "run_id", "state", "message")}
            print_json({"robot": robot} | told | ({} if stop is None else {"stop": stop}))
        else:
            noted = f"; {answer.message}" if answer.message else ""
            done = answer.verb if stop is None else f"{answer.verb} {stop}"
            print_line(f"{robot}: {done} ok; {answer.state}, run {answer.run_id}{noted}")


def state_line(report: StateReport) -> str:
    """Return the state as one line of text."""
    from stopgo.mission.run.health_text import health_text
    from stopgo.mission.run.tolerance import stops_outside_text

    mission = (
        f"mission {report.mission_id[:12]} revision {report.revision}" if report.mission_id else "no mission"
    )
    stop = f", {report.stop_state} at {report.stop}" if report.stop else ""
    outside = stops_outside_text(report.outside, report.outside_count)
    skipped = f", {report.skipped_count} skipped" if report.skipped_count else ""
    if report.skipped and report.state == "FINISHED":
        skipped += f" ({', '.join(report.skipped)}: stopgo start --again repeats the mission)"
    if report.next_revision is not None:
        mission += f" (revision {report.next_revision} from the next stop on)"
    return (
        f"{report.robot}: {report.state}{stop}; {mission}; {report.done_count} done{outside}{skipped};"
        f" {health_text(report)}"
    )
