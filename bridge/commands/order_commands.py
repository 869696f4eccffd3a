"""The commands that give one order (`start`, `pause`, ... `home`) or ask one question (`status`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    VEHICLES,
    Connect,
    Connection,
    Insecure,
    KeyFolder,
    MavlinkUrl,
    SigningKey,
    SiteName,
    StateFolder,
    Timeout,
    VehicleId,
    alone,
    connection_of,
    given_in,
    in_time,
    with_connection,
    with_presets,
)
from stopgo.bridge.console import carried_out, print_json, refusals_in, tell

if TYPE_CHECKING:
    from stopgo.bridge.station.fleet import FleetMember
    from stopgo.bridge.station.roster import LastSeen
    from stopgo.mission.run.events import StateReport
    from stopgo.mission.run.orders import Answer, Verb

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
TakeOver = Annotated[bool, typer.Option("--take-over", help="Command it though somebody else does.")]
StopId = Annotated[str | None, typer.Option("--stop", metavar="ID", help="The stop that is meant.")]
Arm = Annotated[bool, typer.Option("--arm", help="Arm a vehicle that is disarmed.")]
OtherOrigin = Annotated[
    bool, typer.Option("--any-origin", help="Do not compare origins: it has satellite positions.")
]
STATUS_KEYS = (
    "robot", "boot_id", "state", "run_id", "mission_id", "revision", "stop", "done", "skipped", "outside",
    "battery",
)  # fmt: skip


def add_orders(app: typer.Typer) -> None:
    """Add the verbs of this module to the front door."""
    app.command()(start)
    for verb in ABOUT:
        app.command(name=verb)(order_of(verb))
    app.command()(status)


@with_connection()
def start(
    connection: Connection,
    *,
    take_over: TakeOver = False,
    again: Annotated[bool, typer.Option("--again", help="Run a mission that was run before.")] = False,
    from_here: Annotated[
        bool, typer.Option("--from-here", help="Start at the nearest point of the route.")
    ] = False,
    arm: Arm = False,
    any_origin: OtherOrigin = False,
    json_: Json = False,
) -> None:
    """Start the mission that the robot holds.

    Example: stopgo start --robot r1 --connect tcp/127.0.0.1:7447

    Example: stopgo start --mavlink udpout:127.0.0.1:14550 --arm
    """
    driving = connection.to_drive(arm=arm, any_origin=any_origin)
    with refusals_in(json_), in_time(driving) as station:
        answer = station.command("start", again=again, from_here=from_here, take_over=take_over)
    report_answer(answer, station.keys.robot, json_)


ABOUT: dict[Verb, str] = {
    "pause": "Let the robot stand still; a scan under way is finished. Any station may.",
    "resume": "Let a paused robot go on, from where it stands.",
    "skip": "Leave out the stop that the robot works on; its way is still driven.",
    "retry": "Let a robot that is held try again.",
    "abort": "End the run where the robot stands. Any station may.",
    "home": "End the run and drive back along the legs that were driven.",
}


def order_of(verb: Verb) -> Callable[..., None]:
    """The command that gives the order `verb`."""

    def command(
        connection: Connection,
        *,
        stop: StopId = None,
        take_over: TakeOver = False,
        arm: Arm = False,
        any_origin: OtherOrigin = False,
        disarm: Annotated[bool, typer.Option("--disarm", help="Disarm a vehicle that stands.")] = False,
        json_: Json = False,
    ) -> None:
        driving = connection.to_drive(arm=arm, disarm=disarm, any_origin=any_origin)
        with refusals_in(json_), in_time(driving) as station:
            answer = station.command(verb, stop=stop, take_over=take_over)
        report_answer(answer, station.keys.robot, json_)

    command.__doc__ = f"{ABOUT[verb]}\n\nExample: stopgo {verb} --robot r1 --connect {DEFAULT_ENDPOINT}"
    without = () if verb in ("resume", "retry", "skip") else ("arm", "any_origin")
    return with_connection(without=without if verb == "abort" else (*without, "disarm"))(command)


def status(
    context: typer.Context,
    *,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="NAME", help="Name of the robot; all if not given.")
    ] = None,
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    mavlink: MavlinkUrl = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    state: StateFolder = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    all_: Annotated[bool, typer.Option("--all", help="All robots, though one is preset.")] = False,
    roster: Annotated[
        Path | None,
        typer.Option(metavar="FILE.toml", help="Who is missed: robots = [...]; else all ever seen."),
    ] = None,
    forget: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Miss a robot no more that was seen; repeatable.")
    ] = None,
    json_: Json = False,
) -> None:
    """Tell what the robot is doing, or what all robots of the site are; 1 if one of those is silent.

    Example: stopgo status --robot r1 --json

    Example: stopgo status --connect tls/router.site:7447 --keys ~/keys/alice --roster robots.toml

    Example: stopgo status --mavlink udpout:127.0.0.1:14550
    """
    given = given_in(context)
    told = with_presets(given, {
        "robot": robot, "mavlink": mavlink, "connect": connect, "site": site, "keys": keys,
    })  # fmt: skip
    if all_:
        alone(given, "--all", "--robot", "--mavlink")
        told |= {"robot": None, "mavlink": None}
    if told["robot"] is None and told["mavlink"] is None:
        alone(given, "all robots of a site", *VEHICLES)
        return fleet_status(
            told["connect"], told["site"], timeout_s=timeout, insecure=insecure, keys=told["keys"],
            roster=roster, leave_out=tuple(forget or ()), as_json=json_,
        )  # fmt: skip
    alone(given, "one robot", "--roster", "--forget")
    connection = connection_of(
        given, vehicle=vehicle, signing_key=signing_key, state=state, timeout=timeout, insecure=insecure,
        **told,
    )  # fmt: skip
    with in_time(connection.to_look()) as station:
        report = station.status()
    if json_:
        print_json(status_json(report))
    else:
        tell(state_line(report))


def fleet_status(
    endpoint: str,
    site: str | None,
    *,
    roster: Path | None,
    leave_out: tuple[str, ...],
    as_json: bool,
    **reaching: Any,
) -> None:
    """Tell of all robots of a site, those too that ought to be there; a silent one is an answer of no."""
    from stopgo.bridge.link.keys import now_utc
    from stopgo.bridge.station.fleet import fleet
    from stopgo.bridge.station.roster import LastSeen, forget, read_roster, remember, remembered, usual_roster

    path = usual_roster(endpoint, site)
    if leave_out:
        forget(path, leave_out)
    before = remembered(path)
    members = fleet(
        endpoint, site=site, known=tuple(before) if roster is None else read_roster(roster), **reaching
    )
    seen = {
        member.robot: LastSeen(at=now_utc(), state=member.state.state) for member in members if member.state
    }
    if seen:
        remember(path, seen)
    if as_json:
        print_json({"robots": [member_json(member, before.get(member.robot)) for member in members]})
    else:
        for member in members:
            tell(member_line(member, before.get(member.robot)))
    if len(seen) < len(members):
        raise typer.Exit(1)


def member_json(member: FleetMember, before: LastSeen | None) -> dict[str, Any]:
    """The same keys for every robot; a silent one has no values but its name and when it was last seen."""
    told = dict.fromkeys(STATUS_KEYS) if member.state is None else status_json(member.state)
    last = None if before is None or member.state else before.at.isoformat(timespec="seconds")
    return told | {
        "robot": member.robot,
        "silent": member.state is None,
        "trouble": member.trouble,
        "last_seen": last,
    }


def member_line(member: FleetMember, before: LastSeen | None) -> str:
    """One line of a fleet."""
    if member.state is not None:
        return state_line(member.state)
    last = (
        "never seen from here"
        if before is None
        else f"{before.state} when last seen, {before.at:%Y-%m-%d %H:%M} UTC"
    )
    return f"{member.robot}: SILENT; {last}; {member.trouble}"


def status_json(report: StateReport) -> dict[str, Any]:
    return {key: getattr(report, key) for key in STATUS_KEYS}


def report_answer(answer: Answer, robot: str, json_: bool) -> None:
    with carried_out(f"{robot}: {answer.verb} was carried out"):
        if json_:
            print_json({"robot": robot, "verb": answer.verb, "outcome": answer.outcome,
                        "run_id": answer.run_id, "state": answer.state})  # fmt: skip
        else:
            tell(f"{robot}: {answer.verb} ok; {answer.state}, run {answer.run_id}")


def state_line(report: StateReport) -> str:
    """The state as one line a person reads."""
    from stopgo.mission.run.tolerance import stops_outside_text

    mission = (
        f"mission {report.mission_id[:12]} revision {report.revision}" if report.mission_id else "no mission"
    )
    stop = f", {report.stop_state} at {report.stop}" if report.stop else ""
    outside = stops_outside_text(report.outside, report.outside_count)
    skipped = f", {report.skipped_count} skipped" if report.skipped_count else ""
    if report.next_revision is not None:
        mission += f" (revision {report.next_revision} from the next stop on)"
    return (
        f"{report.robot}: {report.state}{stop}; {mission}; {report.done_count} done{outside}{skipped};"
        f" battery {report.battery:.0%}"
    )
