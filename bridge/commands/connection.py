"""Connection of a command to a robot (zenoh, by name) or to a vehicle (MAVLink, by URL), from its options."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    AnyRobot,
    As,
    Connect,
    Insecure,
    KeyFolder,
    MavlinkUrl,
    SigningKey,
    SiteName,
    StateFolder,
    Timeout,
    VehicleId,
)
from stopgo.bridge.console import say
from stopgo.bridge.profile import Profile, effective, read_profile, read_valid_profile
from stopgo.mission.errors import InputError

if TYPE_CHECKING:
    from stopgo.bridge.station.session_socket import SessionOptions
    from stopgo.bridge.station.shown_stop import ShownStopFile
    from stopgo.bridge.station.station import Station
    from stopgo.mission.run.run_commands import Verb

VEHICLES = ("--vehicle", "--signing-key", "--state")
"""Options that only concern a vehicle."""
GivenOptions = frozenset[str]
"""Options on a command line, such as "--site"."""
LEAST_S = 0.5
"""Shortest time for a query or a command, even if finding the robot took nearly all of the timeout."""


@dataclass(frozen=True)
class Mavlink:
    """Connection to a vehicle, and what the command may do to it."""

    url: str
    vehicle: int | None = None
    signing_key: Path | None = None
    state: Path | None = None
    arm: bool = False
    """True if the vehicle may be armed."""
    disarm: bool = False
    any_origin: bool = False
    """True if the vehicle has satellite positions; its origin is not checked."""
    stop: Verb | None = None
    """The verb of a stop command, which goes before everything else."""
    read_only: bool = False
    compares: bool = False
    """True if the run is compared with its mission."""


@dataclass(frozen=True)
class Connection:
    """Connection to a robot, and the operator who uses it."""

    robot: str
    """Name of the robot; empty for a vehicle, which has a system id."""
    endpoint: str
    site: str | None
    who: str | None
    timeout_s: float
    insecure: bool
    keys: Path | None
    patience_s: float = 20.0
    """Longest wait for the answer to each chunk of a mission."""
    mavlink: Mavlink | None = field(default=None)
    given: GivenOptions = frozenset()

    def for_driving(self, *, arm: bool = False, disarm: bool = False, any_origin: bool = False) -> Connection:
        """Return this connection for a command that drives, with what the command may do to a vehicle."""
        if self.mavlink is None:
            refuse_options(self.given, "--robot", "--arm", "--disarm", "--skip-origin-check")
            return self
        consenting = replace(self.mavlink, arm=arm, disarm=disarm, any_origin=any_origin)
        return replace(self, mavlink=consenting)

    def for_stopping(self, verb: Verb) -> Connection:
        """Return this connection for a command that stops: a vehicle gets HOLD as its first frame."""
        return self if self.mavlink is None else replace(self, mavlink=replace(self.mavlink, stop=verb))

    def for_reading(self, *, compares: bool = False) -> Connection:
        """Return this connection for reading a state, or for following a run that is compared."""
        if self.mavlink is None:
            return self
        return replace(self, mavlink=replace(self.mavlink, read_only=not compares, compares=compares))


def shown_stop_of(connection: Connection) -> ShownStopFile:
    """Return the memory of the stop that was shown last of the robot or vehicle."""
    from stopgo.bridge.station.shown_stop import ShownStopFile

    vehicle = connection.mavlink
    if vehicle is None:
        return ShownStopFile(connection.endpoint, connection.site, connection.robot)
    return ShownStopFile(vehicle.url, None if vehicle.vehicle is None else str(vehicle.vehicle))


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
    """Return the connection that the options name; every command that reaches a robot has them."""
    if mavlink is None:
        refuse_options(given, "--robot", *VEHICLES)
        if robot is None:
            raise InputError(
                "no robot given; add --robot NAME, or --mavlink URL for a vehicle "
                "(or preset it in stopgo.toml or STOPGO_ROBOT)"
            )
        return Connection(robot, connect, site, who, timeout, insecure, keys, given=given)
    refuse_options(given, "--mavlink", "--robot", "--site", "--keys", "--connect")
    return Connection(
        "", connect, None, who, timeout, insecure, None,
        mavlink=Mavlink(mavlink, vehicle=vehicle, signing_key=signing_key, state=state), given=given,
    )  # fmt: skip


def given_options(context: typer.Context) -> GivenOptions:
    """Return the options on the command line, also those with their default values."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    typed = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    return frozenset(
        option for parameter in context.command.params if parameter.name in typed for option in parameter.opts
    )


def with_presets(given: GivenOptions, values: dict[str, Any], *, stopping: bool = False) -> dict[str, Any]:
    """Return the options' values; a preset replaces each that was not given.

    A command that stops a robot needs no valid stopgo.toml if the robot is named by an option, or by a source
    that takes precedence over that file: what is wrong is printed.
    """
    profile, faults = read_valid_profile() if stopping else (read_profile(), {})
    if faults and not _is_named(given, profile, min(faults)):
        raise InputError(faults[min(faults)])
    for fault in faults.values():
        say(f"{fault}; its presets do not apply to this command")
    presets = effective(profile, {option.removeprefix("--") for option in given})
    preset: dict[str, Any] = {PARAMETERS.get(name, name): one.value for name, one in presets.items()}
    if "keys" in preset:
        preset["keys"] = Path(preset["keys"])
    return {name: preset.get(name, value) for name, value in values.items()}


def _is_named(given: GivenOptions, profile: Profile, rank: int) -> bool:
    """True if a robot or vehicle is named, and no source of this rank or a later one could name another."""
    preset = [profile[name].rank for name in ("robot", "mavlink") if name in profile]
    return not given.isdisjoint({"--robot", "--mavlink"}) or min(preset, default=rank) < rank


PARAMETERS = {"as": "who"}
"""Parameters whose names differ from their options."""


def refuse_options(given: GivenOptions, what: str, *options: str) -> None:
    """Raise `InputError` if one of `options` was given; they have no meaning with `what`."""
    for option in options:
        if option in given:
            raise InputError(f"{option} has no meaning with {what}; leave it out")


CommandBody = Callable[..., Any]


def with_connection(
    *, without: tuple[str, ...] = (), stopping: bool = False
) -> Callable[[CommandBody], CommandBody]:
    """Decorate a command: the options of `connection_of`, except `without`, become its `connection`.

    `stopping` is True for a command that stops a robot.
    """
    return partial(_with_connection, without, stopping)


def _with_connection(without: tuple[str, ...], stopping: bool, command: CommandBody) -> CommandBody:
    (_, *options), (_, *own) = (
        [
            one
            for one in inspect.signature(which, eval_str=True).parameters.values()
            if one.name not in without
        ]
        for which in (connection_of, command)
    )

    def called(context: typer.Context, **values: Any) -> Any:
        given = given_options(context)
        named = {option.name: values.pop(option.name) for option in options}
        chosen = with_presets(given, named, stopping=stopping)
        if "mavlink" in without and chosen["robot"] is None:
            raise InputError("no robot given; add --robot NAME (or preset it in stopgo.toml or STOPGO_ROBOT)")
        return command(connection_of(given, **chosen), **values)

    context = inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)
    return with_parameters(called, command, [context, *options, *own])


def with_parameters(
    called: CommandBody, command: CommandBody, parameters: list[inspect.Parameter]
) -> CommandBody:
    """Give `called` the name and the help of `command`, and these parameters for its options."""
    called.__name__, called.__doc__ = command.__name__, command.__doc__
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in parameters}
    return called


def reached(connection: Connection, *, at_once: bool = False) -> AbstractContextManager[Station]:
    """Connect to the robot or the vehicle; raises the errors of `connect` of either.

    `at_once` does not wait until the robot is found, for a command that needs nothing from it.
    """
    if connection.mavlink is not None:
        return _vehicle(connection, connection.mavlink)
    from stopgo.bridge.station.station import connect

    return connect(
        connection.endpoint, robot=connection.robot, site=connection.site, commander=connection.who,
        timeout_s=connection.timeout_s, patience_s=connection.patience_s, insecure=connection.insecure,
        keys=connection.keys, at_once=at_once,
    )  # fmt: skip


def _vehicle(connection: Connection, mavlink: Mavlink) -> AbstractContextManager[Station]:
    from stopgo.bridge.mavlink.auto.vehicle_commands import Consent
    from stopgo.bridge.mavlink.auto.vehicle_station import Options, connect
    from stopgo.bridge.mavlink.vehicle_link.wire import read_link

    url, key = read_link(mavlink.url, mavlink.signing_key, insecure=connection.insecure)
    options = Options(
        vehicle=mavlink.vehicle, signing_key=key, state=mavlink.state, timeout_s=connection.timeout_s,
        commander=connection.who, consent=Consent(mavlink.arm, mavlink.disarm, mavlink.any_origin),
        looks_only=mavlink.read_only, stop=mavlink.stop, compares=mavlink.compares,
    )  # fmt: skip
    return connect(url, options)


def session_options(connection: Connection) -> SessionOptions:
    """Return the options that commands must have in common to share a session."""
    from stopgo.bridge.station.session_socket import SessionOptions

    return SessionOptions(
        endpoint=connection.endpoint, robot=connection.robot, site=connection.site, commander=connection.who,
        insecure=connection.insecure, keys=connection.keys,
    )  # fmt: skip


def _shared(connection: Connection, *, at_once: bool) -> AbstractContextManager[Station]:
    """Connect through the session that the user holds open, if there is one."""
    if connection.mavlink is not None:
        return reached(connection, at_once=at_once)
    from stopgo.bridge.station.session_link import connect_shared

    return connect_shared(
        session_options(connection), timeout_s=connection.timeout_s, at_once=at_once, say=say
    )


@contextmanager
def in_time(connection: Connection, *, at_once: bool = False) -> Iterator[Station]:
    """Connect to the robot; the time left of the timeout is for one query or command.

    The session that the user holds open is used if there is one (`stopgo session`).

    A vehicle that was commanded to stop stands by then: noting that has the whole timeout again.
    """
    began = time.monotonic()
    with _shared(connection, at_once=at_once) as station:
        if connection.mavlink is not None and connection.mavlink.stop is not None:
            began = time.monotonic()
        station.timeout_s = max(LEAST_S, connection.timeout_s - (time.monotonic() - began))
        yield station
