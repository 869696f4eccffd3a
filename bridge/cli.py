"""The bridge's commands: each reads its options, calls one verb, and prints what it gave."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mission.errors import InputError

if TYPE_CHECKING:
    from bridge.mavlink.scanner import Trigger
    from bridge.protocol import Answer, Verb
    from bridge.revision import RevisionPolicy
    from bridge.station import Station
    from bridge.watch import Recording
    from mission.document import Mission, Transform
    from mission.events import Pose, StateReport

RobotName = Annotated[str, typer.Option("--robot", metavar="NAME", help="Name of the robot.")]
Connect = Annotated[
    str, typer.Option("--connect", metavar="ENDPOINT", help="Where it listens, such as tcp/127.0.0.1:7447.")
]
Site = Annotated[str | None, typer.Option("--site", metavar="NAME", help="Prefix of the site's keys.")]
As = Annotated[
    str | None, typer.Option("--as", metavar="WHO", help="Who gives the order; user@host if not given.")
]
Timeout = Annotated[
    float, typer.Option("--timeout", min=0.1, metavar="S", help="How long to wait, in seconds.")
]
PushTimeout = Annotated[
    float | None,
    typer.Option("--timeout", min=0.1, metavar="S", help="How long to go on without an answer, in seconds; "
                 "if not given, 5 to find the robot and 20 for each piece."),
]  # fmt: skip
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Allow addresses beyond this machine without keys.")
]
KeyFolder = Annotated[
    Path | None, typer.Option("--keys", metavar="DIR", help="Folder of the keys that stopgo keys issued.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout.")]
TakeOver = Annotated[bool, typer.Option("--take-over", help="Command it though somebody else does.")]
StopId = Annotated[str | None, typer.Option("--stop", metavar="ID", help="The stop that is meant.")]
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
LEAST_S = 0.5
"""Left for a question or an order, however long it took to find the robot."""


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    app.command()(robot)
    app.command()(push)
    app.command()(start)
    for verb in ABOUT:
        app.command(name=verb)(order_of(verb))
    app.command()(status)
    app.command()(watch)
    app.add_typer(key_commands(), name="keys")


def robot(
    *,
    name: Annotated[str | None, typer.Option("--name", help="Name of this robot.")] = None,
    state: Annotated[
        Path | None, typer.Option("--state", metavar="DIR", help="Its journal; one per robot.")
    ] = None,
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = DEFAULT_ENDPOINT,
    connect: Annotated[
        str | None, typer.Option(metavar="ENDPOINT", help="A router to connect to, instead of listening.")
    ] = None,
    site: Site = None,
    speed_up: Annotated[
        float, typer.Option("--speed-up", min=0.01, max=1000, help="How much faster simulated time runs.")
    ] = 1.0,
    at: Annotated[
        str | None,
        typer.Option("--at", metavar="X,Y,HEADING", help="Where it stands (m, degrees); else at the start."),
    ] = None,
    map_: Annotated[
        str | None,
        typer.Option("--map", metavar="X,Y,HEADING", help="Site to map: turn by HEADING, then shift."),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option("--fault", metavar="KIND@N[=AMOUNT]", help="Let something go wrong, as slip@2=0.2."),
    ] = None,
    endurance: Annotated[
        float,
        typer.Option(metavar="HOURS", min=0, help="How long a full battery lasts; 0: it does not run down."),
    ] = 6.0,
    revision: Annotated[
        str, typer.Option(metavar="next-stop|refuse", help="What becomes of a revision pushed during a run.")
    ] = "next-stop",
    insecure: Insecure = False,
    keys: KeyFolder = None,
    mavlink_vehicle: Annotated[
        str | None,
        typer.Option(
            "--mavlink-vehicle", metavar="URL", help="Be a MAVLink vehicle there, and nothing else."
        ),
    ] = None,
    profile: Annotated[
        str | None,
        typer.Option(metavar="strict|ardupilot|px4", help="The autopilot whose habits the vehicle has."),
    ] = None,
    origin: Annotated[
        str | None,
        typer.Option(metavar="LAT,LON,ALT[,HEADING]", help="The vehicle's global origin from the start."),
    ] = None,
    signing_key: Annotated[
        Path | None, typer.Option("--signing-key", metavar="FILE", help="Sign what is said over MAVLink.")
    ] = None,
    controller: Annotated[
        str, typer.Option(metavar="sim|mavlink:URL", help="What carries the scanner: an autopilot at URL.")
    ] = "sim",
    arm: Annotated[bool, typer.Option("--arm", help="Arm the autopilot when a run needs it.")] = False,
    trigger: Annotated[
        str, typer.Option(metavar="camera|script", help="What makes the autopilot's scanner scan.")
    ] = "camera",
    vehicle: Annotated[
        int | None, typer.Option(metavar="ID", help="The autopilot's system id, if several are heard.")
    ] = None,
) -> None:
    """Be a robot, with a simulated base and scanner or those of an autopilot, until SIGTERM.

    Example: stopgo robot --name r1 --listen tcp/127.0.0.1:7447 --state r1.state --speed-up 20

    Example: stopgo robot --name r1 --state r1.state --controller mavlink:serial:/dev/ttyAMA0:921600

    Example: stopgo robot --mavlink-vehicle udpin:127.0.0.1:14550 --profile ardupilot --origin 47.4,8.5,400
    """
    from bridge.bodies import AutopilotBody, Incarnate, SimulatedBody, autopilot_url
    from bridge.robot import RobotOptions, run_robot
    from bridge.simulator import Faults, read_fault

    driven = {"--arm": arm, "--trigger": trigger != "camera", "--vehicle": vehicle}
    if mavlink_vehicle is not None:
        alone("--mavlink-vehicle", {
            "--listen": listen != DEFAULT_ENDPOINT, "--connect": connect, "--site": site, "--map": map_,
            "--keys": keys, "--revision": revision != "next-stop", "--endurance": endurance != 6.0,
            "--controller": controller != "sim", **driven,
        })  # fmt: skip
        return be_vehicle(
            name, url=mavlink_vehicle, profile=profile or "strict", state=state, speed_up=speed_up,
            signing_key=signing_key, insecure=insecure, origin=origin,
            at=None if at is None else read_pose("--at", at), faults=tuple(fault or ()),
        )  # fmt: skip
    alone("a robot on zenoh", {"--profile": profile, "--origin": origin})
    if name is None or state is None:
        raise InputError("robot: give it a --name and a folder for its --state")
    faults, to_map = Faults(tuple(read_fault(text) for text in fault or ())), read_map(map_)
    url = autopilot_url(controller)
    if url is None:
        alone("a simulated robot", {"--signing-key": signing_key, **driven})
        body: Incarnate = SimulatedBody(
            state, None if at is None else read_pose("--at", at), to_map, 3600 * endurance, faults
        )
    else:
        alone("an autopilot", {
            "--at": at, "--map": map_, "--fault": fault, "--speed-up": speed_up != 1.0,
            "--endurance": endurance != 6.0,
        })  # fmt: skip
        body = AutopilotBody(url, arm, read_trigger(trigger), signing_key, vehicle, insecure)
    options = RobotOptions(
        name=name, listen=listen, connect=connect, state=state, body=body, site=site, speed_up=speed_up,
        to_map=to_map, insecure=insecure, revisions=read_revisions(revision), keys=keys, faults=faults,
    )  # fmt: skip
    where = f"listens on {listen}" if connect is None else f"connects to {connect}"
    run_robot(options, ready=lambda: say(f"ready {name} {where}"))


def be_vehicle(name: str | None, **options: Any) -> None:
    """Be a MAVLink vehicle until SIGTERM."""
    from bridge.mavlink.simulated.process import VehicleOptions, run_vehicle

    called = f"{name or 'vehicle'} ({options['profile']})"
    run_vehicle(VehicleOptions(**options), ready=lambda url: say(f"ready {called} at {url}"))


def alone(what: str, given: dict[str, object]) -> None:
    """Refuse options that have no meaning with `what`."""
    for option, value in given.items():
        if value:
            raise InputError(f"robot: {option} has no meaning with {what}; leave it out")


def read_revisions(text: str) -> RevisionPolicy:
    """What a robot does with a revision that is pushed during a run."""
    from bridge.revision import POLICIES

    if text not in POLICIES:
        raise InputError(f"--revision {text}: one of {', '.join(POLICIES)}")
    return POLICIES[text]


def read_trigger(text: str) -> Trigger:
    """What makes an autopilot's scanner scan."""
    from bridge.mavlink.scanner import TRIGGERS

    known = next((trigger for trigger in TRIGGERS if trigger == text), None)
    if known is None:
        raise InputError(f"--trigger {text}: one of {', '.join(TRIGGERS)}")
    return known


def push(
    mission: Annotated[Path, typer.Argument(metavar="MISSION.json", help="The mission to send.")],
    *,
    robot: RobotName,
    connect: Connect = DEFAULT_ENDPOINT,
    site: Site = None,
    who: As = None,
    take_over: TakeOver = False,
    timeout: PushTimeout = None,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    json_: Json = False,
) -> None:
    """Send a mission to a robot, and see it stored there whole, or rejected with the reasons.

    Example: stopgo push out/mission.json --robot r1 --connect tcp/127.0.0.1:7447
    """
    from mission.files.mission_json import read

    document = read(mission)
    with (
        reached(pushing(Way(robot, connect, site, who, 5.0, insecure, keys), timeout)) as station,
        Bar("pushing") as bar,
    ):
        told = turning(station.info().to_map, document)
        accepted = station.push(document, progress=bar.show, take_over=take_over)
    if told:
        say(told)
    if json_:
        print_json({"robot": robot, "mission_id": accepted.mission_id, "revision": accepted.revision,
                    "digest": accepted.digest, "already": accepted.already,
                    "waits": accepted.waits})  # fmt: skip
    else:
        how = "already held" if accepted.already else "accepted"
        when = "; followed from the next stop on" if accepted.waits else ""
        typer.echo(f"{robot} {how} {document.name} ({document.id[:12]} revision {document.revision}){when}")


def turning(own: Transform | None, mission: Mission) -> str:
    """How the robot turns the mission onto its map, in words; empty if it does not."""
    import math

    to_map, whose = (own, "robot --map") if own else (mission.frame.to_map, "the mission's frame")
    if to_map is None:
        return ""
    turned = f"{math.degrees(to_map.heading):.2f}°, then shifted by ({to_map.x:.3f}, {to_map.y:.3f}) m"
    return f"on the robot's map, places are turned by {turned} ({whose})"


def start(
    *,
    robot: RobotName,
    connect: Connect = DEFAULT_ENDPOINT,
    site: Site = None,
    who: As = None,
    take_over: TakeOver = False,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    again: Annotated[bool, typer.Option("--again", help="Run a mission that was run before.")] = False,
    from_here: Annotated[
        bool, typer.Option("--from-here", help="Start at the nearest point of the route.")
    ] = False,
    json_: Json = False,
) -> None:
    """Start the mission that the robot holds.

    Example: stopgo start --robot r1 --connect tcp/127.0.0.1:7447
    """
    with in_time(Way(robot, connect, site, who, timeout, insecure, keys)) as station:
        answer = station.command("start", again=again, from_here=from_here, take_over=take_over)
    report_answer(answer, robot, json_)


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
        *,
        robot: RobotName,
        stop: Annotated[
            str | None, typer.Option("--stop", metavar="ID", help="The stop that is meant.")
        ] = None,
        connect: Connect = DEFAULT_ENDPOINT,
        site: Site = None,
        who: As = None,
        take_over: TakeOver = False,
        timeout: Timeout = 5.0,
        insecure: Insecure = False,
        keys: KeyFolder = None,
        json_: Json = False,
    ) -> None:
        with in_time(Way(robot, connect, site, who, timeout, insecure, keys)) as station:
            answer = station.command(verb, stop=stop, take_over=take_over)
        report_answer(answer, robot, json_)

    command.__doc__ = f"{ABOUT[verb]}\n\nExample: stopgo {verb} --robot r1 --connect {DEFAULT_ENDPOINT}"
    return command


def status(
    *,
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="NAME", help="Name of the robot; all if not given.")
    ] = None,
    connect: Connect = DEFAULT_ENDPOINT,
    site: Site = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    json_: Json = False,
) -> None:
    """Tell what the robot is doing, or what all robots of the site are.

    Example: stopgo status --robot r1 --json
    """
    from bridge.station import fleet

    if robot is None:
        reports = fleet(connect, site=site, timeout_s=timeout, insecure=insecure, keys=keys)
        as_json: dict[str, Any] = {"robots": [status_json(report) for report in reports]}
    else:
        with in_time(Way(robot, connect, site, None, timeout, insecure, keys)) as station:
            reports = (station.status(),)
        as_json = status_json(reports[0])
    if json_:
        print_json(as_json)
    else:
        typer.echo("\n".join(state_line(report) for report in reports))


def status_json(report: StateReport) -> dict[str, Any]:
    return {key: getattr(report, key) for key in STATUS_KEYS}


def key_commands() -> typer.Typer:
    """`stopgo keys` with its verbs."""
    commands = typer.Typer(
        no_args_is_help=True,
        help="Make a site's keys: an authority, and a certificate for every station, viewer and robot."
        "\n\nExample: stopgo keys init site-keys && stopgo keys issue robot r1 --in site-keys",
    )
    commands.command("init")(keys_init)
    commands.command("issue")(keys_issue)
    commands.command("show")(keys_show)
    return commands


SiteFolder = Annotated[Path, typer.Option("--in", metavar="DIR", help="The site's folder of keys.")]


def keys_init(folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder.")]) -> None:
    """Make a site's authority; whoever has its folder can issue keys, so keep it off the robots.

    Example: stopgo keys init site-keys
    """
    from bridge.keys import AUTHORITY, init_site, now_utc

    init_site(folder, now=now_utc())
    typer.echo(f"{folder / AUTHORITY}: the site's authority; keep it away from robots and stations")


def keys_issue(
    role: Annotated[str, typer.Argument(help="station, viewer or robot.")],
    name: Annotated[str, typer.Argument(help="Who it is for; for a robot, its --name.")],
    *,
    folder: SiteFolder,
    days: Annotated[int, typer.Option(min=1, max=825, help="How long they are valid.")] = 90,
) -> None:
    """Issue keys to a station, a viewer or a robot.

    Example: stopgo keys issue station alice --in site-keys
    """
    from bridge.keys import ROLES, issue, now_utc

    if role not in ROLES:
        raise InputError(f"role {role!r}: one of {', '.join(ROLES)}")
    files = issue(folder, role, name, now=now_utc(), days=days)
    typer.echo(f"{files.folder}: keys of {role} {name} for {days} days; give it the folder as --keys")


def keys_show(
    site: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="The site's folder of keys.", show_default=False)
    ] = None,
    *,
    folder: Annotated[Path | None, typer.Option("--in", metavar="DIR", help="The same.")] = None,
    json_: Json = False,
) -> None:
    """List who holds keys, and until when.

    Example: stopgo keys show site-keys
    """
    from bridge.keys import holders, now_utc

    given = [path for path in (site, folder) if path is not None]
    if len(given) != 1:
        raise InputError("keys show: name the site's folder of keys once, as in: stopgo keys show site-keys")
    found = holders(given[0])
    if json_:
        keys = [{"role": who.role, "name": who.name, "not_after": who.not_after.isoformat()} for who in found]
        print_json({"keys": keys})
        return
    for who in found:
        left = (who.not_after - now_utc()).days
        until = f"until {who.not_after:%Y-%m-%d}, {left} days" if left >= 0 else "expired"
        typer.echo(f"{who.role:8} {who.name:20} {until}")


STATUS_KEYS = (
    "robot", "boot_id", "state", "run_id", "mission_id", "revision", "stop", "done", "skipped", "battery",
)  # fmt: skip


def watch(
    *,
    robot: RobotName,
    connect: Connect = DEFAULT_ENDPOINT,
    site: Site = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
    rrd: Annotated[
        Path | None, typer.Option("--rrd", metavar="FIELD.rrd", help="Record the run for Rerun.")
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Open the viewer on what is recorded.")] = False,
    json_: Json = False,
) -> None:
    """Follow the robot's run until it ends, gaps filled from its journal; never touches the robot.

    Ends with 0 when the run finished and 1 when it was aborted.

    Example: stopgo watch --robot r1 --rrd field.rrd
    """
    from bridge.watch import Lines, Table, watch_showing

    with (
        recording(rrd, view=view) as record,
        reached(Way(robot, connect, site, None, timeout, insecure, keys)) as station,
    ):
        state = watch_showing(station, record, Table() if sys.stderr.isatty() else Lines(say))
    if json_:
        print_json(status_json(state))
    raise typer.Exit(0 if state.state == "FINISHED" else 1)


def recording(path: Path | None, *, view: bool) -> AbstractContextManager[Recording | None]:
    """The field recording at `path`, looked at if wanted; nothing of Rerun is loaded without one."""
    if path is None and view:
        raise InputError("--view shows what is recorded: say where, with --rrd FIELD.rrd")
    if path is None:
        return nullcontext()
    from recordings.field import FieldRecording

    record = FieldRecording(path, None)
    if not view:
        return record
    from recordings.viewer import Viewed

    return Viewed(record)


@dataclass(frozen=True)
class Way:
    """How a robot is to be reached, and by whom."""

    robot: str
    endpoint: str
    site: str | None
    who: str | None
    timeout_s: float
    insecure: bool
    keys: Path | None
    patience_s: float = 20.0
    """For each piece of a mission that is pushed."""


def pushing(way: Way, timeout_s: float | None) -> Way:
    """The way for a push, which takes as long as it takes: its timeout is that without an answer."""
    return way if timeout_s is None else replace(way, timeout_s=timeout_s, patience_s=timeout_s)


def reached(way: Way) -> AbstractContextManager[Station]:
    from bridge.station import connect

    return connect(
        way.endpoint, robot=way.robot, site=way.site, commander=way.who, timeout_s=way.timeout_s,
        patience_s=way.patience_s, insecure=way.insecure, keys=way.keys,
    )  # fmt: skip


@contextmanager
def in_time(way: Way) -> Iterator[Station]:
    """A robot that has been reached, with what is left of the time for one question or order."""
    began = time.monotonic()
    with reached(way) as station:
        station.timeout_s = max(LEAST_S, way.timeout_s - (time.monotonic() - began))
        yield station


def report_answer(answer: Answer, robot: str, json_: bool) -> None:
    if json_:
        print_json({"robot": robot, "verb": answer.verb, "outcome": answer.outcome,
                    "run_id": answer.run_id, "state": answer.state})  # fmt: skip
    else:
        typer.echo(f"{robot}: {answer.verb} ok; {answer.state}, run {answer.run_id}")


def state_line(report: StateReport) -> str:
    """The state as one line a person reads."""
    mission = (
        f"mission {report.mission_id[:12]} revision {report.revision}" if report.mission_id else "no mission"
    )
    stop = f", {report.stop_state} at {report.stop}" if report.stop else ""
    skipped = f", {len(report.skipped)} skipped" if report.skipped else ""
    if report.next_revision is not None:
        mission += f" (revision {report.next_revision} from the next stop on)"
    return (
        f"{report.robot}: {report.state}{stop}; {mission}; {len(report.done)} done{skipped};"
        f" battery {report.battery:.0%}"
    )


def read_map(text: str | None) -> Transform | None:
    """Site to map, if it was told."""
    return None if text is None else read_transform("--map", text)


def read_transform(option: str, text: str) -> Transform:
    """A transform from X,Y,HEADING in metres and degrees."""
    from mission.document import Transform

    pose = read_pose(option, text)
    return Transform(x=pose.x, y=pose.y, heading=pose.heading)


def read_pose(option: str, text: str) -> Pose:
    """A pose from X,Y,HEADING in metres and degrees."""
    import math

    from mission.events import Pose

    try:
        x, y, heading = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: write X,Y,HEADING in metres and degrees, as 1.5,2,90") from None
    if not all(map(math.isfinite, (x, y, heading))):
        raise InputError(f"{option} {text}: must be finite numbers")
    return Pose(x=x, y=y, heading=math.radians(heading))


class Bar:
    """A progress bar on stderr, if that is a terminal."""

    def __init__(self, label: str) -> None:
        self._label = label
        self._shows = sys.stderr.isatty()

    def __enter__(self) -> Bar:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._shows:
            print(file=sys.stderr)  # noqa: T201

    def show(self, done: int, total: int) -> None:
        if self._shows:
            filled = 30 * done // max(1, total)
            bar = "█" * filled + "·" * (30 - filled)
            print(f"\r{self._label} {bar} {done / 1e3:.0f}/{total / 1e3:.0f} kB", end="", file=sys.stderr)  # noqa: T201


def say(line: str) -> None:
    """One line for the person, on stderr."""
    print(line, file=sys.stderr, flush=True)  # noqa: T201


def print_json(document: dict[str, Any]) -> None:
    print(json.dumps(document))  # noqa: T201
