"""How a command reaches a robot, over zenoh by its name or over MAVLink by a URL, and the options for it."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.bridge.profile import counting, read_profile
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.bridge.station.station import Station

RobotName = Annotated[str, typer.Option("--robot", metavar="NAME", help="Name of the robot.")]
AnyRobot = Annotated[str | None, typer.Option("--robot", metavar="NAME", help="Name of the robot.")]
Connect = Annotated[
    str,
    typer.Option(
        "--connect", metavar="ENDPOINT", help="Where it listens, as tcp/127.0.0.1:7447; several: A,B."
    ),
]
SiteName = Annotated[str | None, typer.Option("--site", metavar="NAME", help="Prefix of the site's keys.")]
As = Annotated[
    str | None, typer.Option("--as", metavar="WHO", help="Who gives the order; user@host if not given.")
]
Timeout = Annotated[
    float, typer.Option("--timeout", min=0.1, metavar="S", help="How long to wait, in seconds.")
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Allow addresses beyond this machine without keys.")
]
KeyFolder = Annotated[
    Path | None, typer.Option("--keys", metavar="DIR", help="Folder of the keys that stopgo keys issued.")
]
MavlinkUrl = Annotated[
    str | None,
    typer.Option("--mavlink", metavar="URL", help="A vehicle instead, such as udpout:127.0.0.1:14550."),
]
VehicleId = Annotated[
    int | None,
    typer.Option("--vehicle", metavar="ID", min=1, max=255, help="Its system id, if several are heard."),
]
SigningKey = Annotated[
    Path | None,
    typer.Option(
        "--signing-key",
        metavar="FILE",
        help="Sign what is said over MAVLink; FILE: 64 hex digits or a passphrase of at least 8 characters.",
    ),
]
StateFolder = Annotated[
    Path | None,
    typer.Option("--state", metavar="DIR", help="What is remembered of the vehicle; one folder for each."),
]
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
VEHICLES = ("--vehicle", "--signing-key", "--state")
"""Options that reach a vehicle."""
GivenOptions = frozenset[str]
"""The options on a command line, such as "--site"."""
LEAST_S = 0.5
"""Left for a question or an order, however long it took to find the robot."""


@dataclass(frozen=True)
class Mavlink:
    """How a vehicle is to be reached."""

    url: str
    vehicle: int | None = None
    signing_key: Path | None = None
    state: Path | None = None
    arm: bool = False
    """It may be armed."""
    disarm: bool = False
    any_origin: bool = False
    """It finds its place by satellites."""
    looks_only: bool = False
    compares: bool = False


@dataclass(frozen=True)
class Connection:
    """How a robot is to be reached, and by whom."""

    robot: str
    """Its name; empty for a vehicle, which has a number."""
    endpoint: str
    site: str | None
    who: str | None
    timeout_s: float
    insecure: bool
    keys: Path | None
    patience_s: float = 20.0
    """For each piece of a mission that is pushed."""
    mavlink: Mavlink | None = field(default=None)
    given: GivenOptions = frozenset()

    def to_drive(self, *, arm: bool = False, disarm: bool = False, any_origin: bool = False) -> Connection:
        """The same connection, for an order and what it may do to a vehicle, or overlook."""
        if self.mavlink is None:
            alone(self.given, "--robot", "--arm", "--disarm", "--any-origin")
            return self
        given = replace(self.mavlink, arm=arm, disarm=disarm, any_origin=any_origin)
        return replace(self, mavlink=given)

    def to_look(self, *, compares: bool = False) -> Connection:
        """The same connection, to look at a vehicle, or to follow one whose mission is compared."""
        if self.mavlink is None:
            return self
        return replace(self, mavlink=replace(self.mavlink, looks_only=not compares, compares=compares))


def connection_of(
    given: GivenOptions,
    *,
    robot: AnyRobot = None,
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    who: As = None,
    mavlink: MavlinkUrl = None,
    vehicle: VehicleId = None,
    signing_key: SigningKey = None,
    state: StateFolder = None,
    timeout: Timeout = 5.0,
    insecure: Insecure = False,
    keys: KeyFolder = None,
) -> Connection:
    """What the options mean; those after `given` are the options of every command that reaches a robot."""
    if mavlink is None:
        alone(given, "--robot", *VEHICLES)
        if robot is None:
            raise InputError(
                "say which robot: --robot NAME, or --mavlink URL for a vehicle "
                "(or preset it in stopgo.toml or as STOPGO_ROBOT)"
            )
        return Connection(robot, connect, site, who, timeout, insecure, keys, given=given)
    alone(given, "--mavlink", "--robot", "--site", "--keys", "--connect")
    return Connection(
        "", connect, None, who, timeout, insecure, None,
        mavlink=Mavlink(mavlink, vehicle=vehicle, signing_key=signing_key, state=state), given=given,
    )  # fmt: skip


def given_in(context: typer.Context) -> GivenOptions:
    """The options on the command line, whatever their values."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    typed = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    return frozenset(
        option for parameter in context.command.params if parameter.name in typed for option in parameter.opts
    )


def with_presets(given: GivenOptions, values: dict[str, Any]) -> dict[str, Any]:
    """The values of options, with what is preset in place of those that were not given."""
    presets = counting(read_profile(), {option.removeprefix("--") for option in given})
    told: dict[str, Any] = {PARAMETERS.get(name, name): preset.value for name, preset in presets.items()}
    if "keys" in told:
        told["keys"] = Path(told["keys"])
    return {name: told.get(name, value) for name, value in values.items()}


PARAMETERS = {"as": "who"}
"""What options are called inside, where it is otherwise."""


def alone(given: GivenOptions, what: str, *options: str) -> None:
    """Refuse options that were given and have no meaning with `what`."""
    for option in options:
        if option in given:
            raise InputError(f"{option} has no meaning with {what}; leave it out")


CommandBody = Callable[..., Any]


def with_connection(*, without: tuple[str, ...] = ()) -> Callable[[CommandBody], CommandBody]:
    """Gives a command its `connection` by the options of `connection_of`, but those `without`."""
    return partial(_with_connection, without)


def _with_connection(without: tuple[str, ...], command: CommandBody) -> CommandBody:
    (_, *options), (_, *own) = (
        [
            one
            for one in inspect.signature(which, eval_str=True).parameters.values()
            if one.name not in without
        ]
        for which in (connection_of, command)
    )

    def called(context: typer.Context, **values: Any) -> Any:
        given = given_in(context)
        chosen = with_presets(given, {option.name: values.pop(option.name) for option in options})
        return command(connection_of(given, **chosen), **values)

    context = inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)
    everything = [context, *options, *own]
    called.__name__, called.__doc__ = command.__name__, command.__doc__
    called.__signature__ = inspect.Signature(everything)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in everything}
    return called


def reached(connection: Connection) -> AbstractContextManager[Station]:
    """The robot or vehicle at the other end; raises as both `connect` do."""
    if connection.mavlink is not None:
        return _vehicle(connection, connection.mavlink)
    from stopgo.bridge.station.station import connect

    return connect(
        connection.endpoint, robot=connection.robot, site=connection.site, commander=connection.who,
        timeout_s=connection.timeout_s, patience_s=connection.patience_s, insecure=connection.insecure,
        keys=connection.keys,
    )  # fmt: skip


def _vehicle(connection: Connection, mavlink: Mavlink) -> AbstractContextManager[Station]:
    from stopgo.bridge.mavlink.auto.vehicle_orders import Consent
    from stopgo.bridge.mavlink.auto.vehicle_station import Options, connect
    from stopgo.bridge.mavlink.vehicle_link.wire import read_link

    url, key = read_link(mavlink.url, mavlink.signing_key, insecure=connection.insecure)
    options = Options(
        vehicle=mavlink.vehicle, signing_key=key, state=mavlink.state, timeout_s=connection.timeout_s,
        commander=connection.who, consent=Consent(mavlink.arm, mavlink.disarm, mavlink.any_origin),
        looks_only=mavlink.looks_only, compares=mavlink.compares,
    )  # fmt: skip
    return connect(url, options)


@contextmanager
def in_time(connection: Connection) -> Iterator[Station]:
    """A robot that has been reached, with what is left of the time for one question or order."""
    began = time.monotonic()
    with reached(connection) as station:
        station.timeout_s = max(LEAST_S, connection.timeout_s - (time.monotonic() - began))
        yield station
