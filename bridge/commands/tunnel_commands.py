"""`stopgo tunnel`: raw MAVLink frames over zenoh, from a vehicle to ground programs on stations."""

from __future__ import annotations

import signal
import time
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

import typer

from stopgo.bridge.commands.bridge_options import (
    DEFAULT_ENDPOINT,
    Connect,
    GroundProgram,
    Insecure,
    JoinedRobot,
    KeyFolder,
    Listen,
    OwnName,
    RawOrders,
    RobotName,
    SiteName,
    TunnelledVehicle,
)
from stopgo.bridge.commands.connection import given_options, refuse_options
from stopgo.bridge.console import say
from stopgo.bridge.mavlink.vehicle_link.transport import open_transport
from stopgo.bridge.mavlink.vehicle_link.url import check_guarded, read_url

if TYPE_CHECKING:
    from pathlib import Path

    from stopgo.bridge.link.link import Link
    from stopgo.bridge.link.protocol import KeyExpressions
    from stopgo.bridge.link.zenoh_link import Guard
    from stopgo.bridge.mavlink.tunnel.tunnel import Tunnel
    from stopgo.bridge.mavlink.vehicle_link.transport import Transport
    from stopgo.mission.mavlink.telemetry import Message

MOST_KINDS = 100
"""Kinds of messages that are reported; more kinds come from damaged or hostile data."""
REFUSED = "tunnel refused "
"""Prefix of the STATUSTEXT that reports a refusal."""
ONLY_STOPS = "blocked, only telemetry and stop commands are allowed; use --allow-commands to allow all"
SAY_EVERY_S = 1.0
"""Shortest time between two reports of the same kind; a ground program may repeat its request."""


def tunnel_commands() -> typer.Typer:
    """Return `stopgo tunnel` with its two endpoints."""
    commands = typer.Typer(
        help="Carry raw MAVLink frames over zenoh, between a vehicle and ground programs on stations."
        "\n\nExample: stopgo tunnel robot --name r1 --mavlink serial:/dev/ttyAMA1:57600 &&"
        " stopgo tunnel station --robot r1 --mavlink udpout:127.0.0.1:14550",
    )
    commands.command("robot")(tunnel_robot)
    commands.command("station")(tunnel_station)
    return commands


def tunnel_robot(
    context: typer.Context,
    *,
    name: OwnName,
    mavlink: TunnelledVehicle,
    listen: Listen = DEFAULT_ENDPOINT,
    connect: JoinedRobot = None,
    raw_orders: RawOrders = False,
    site: SiteName = None,
    insecure: Insecure = False,
    keys: KeyFolder = None,
) -> None:
    """Run the tunnel's endpoint at the robot, until SIGTERM.

    Without --allow-commands stations receive the vehicle's telemetry and can stop it, and nothing else. The
    commander's lease does not count here.

    Example: stopgo tunnel robot --name r1 --mavlink serial:/dev/ttyAMA1:57600 --connect tcp/127.0.0.1:7447
    """
    from stopgo.bridge.link.protocol import KeyExpressions
    from stopgo.bridge.link.zenoh_link import joining, listening
    from stopgo.bridge.mavlink.tunnel.tunnel import answer_greetings

    if connect is not None:
        refuse_options(given_options(context), "--connect", "--listen")
    _leave_on_sigterm()
    own = KeyExpressions(name, site)
    guard = _guard(own, keys, insecure=insecure, joins=connect is not None)
    transport = _transport(mavlink, insecure)
    opened = joining(connect, guard) if connect else listening(listen, guard)
    with opened as link, _robot_end(link, transport, own, mavlink, raw_orders=raw_orders) as tunnel:
        answer_greetings(link, own.mavlink("hello"))
        link.announce(own.mavlink("alive"))
        say(f"ready {name} {'joins ' + connect if connect else 'listens on ' + listen}, vehicle at {mavlink}")
        _run(tunnel)


def _guard(own: KeyExpressions, keys: Path | None, *, insecure: bool, joins: bool) -> Guard:
    """Return the guard of the robot's link; the robot agent controls the access to one that joins it."""
    from stopgo.bridge.link.access import access_control
    from stopgo.bridge.link.zenoh_link import Guard
    from stopgo.bridge.robot.controller import new_boot_id
    from stopgo.bridge.robot.program import robots_keys

    held = None if keys is None else robots_keys(keys, own.robot)
    access = None if held is None or joins else access_control(own)
    return Guard(held, insecure, access, new_boot_id())


def _robot_end(
    link: Link, transport: Transport, own: KeyExpressions, mavlink: str, *, raw_orders: bool
) -> AbstractContextManager[Tunnel]:
    from stopgo.bridge.mavlink.tunnel.message_filter import MessageFilter
    from stopgo.bridge.mavlink.tunnel.tunnel import open_tunnel

    messages = MessageFilter()
    return open_tunnel(
        link, transport, publishes=own.mavlink("down"), receives=own.mavlink("up"),
        bulk=True, sees=messages.sees,
        passes=(lambda message: True) if raw_orders else messages.lets_through,
        refused=RefusalSender().text_of, knocks=read_url(mavlink).kind == "udpout",
    )  # fmt: skip


def tunnel_station(
    *,
    robot: RobotName,
    mavlink: GroundProgram = "udpout:127.0.0.1:14550",
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    insecure: Insecure = False,
    keys: KeyFolder = None,
) -> None:
    """Run the tunnel's endpoint at a station, until Ctrl-C; with a viewer's keys it only receives.

    Example: stopgo tunnel station --robot r1 --connect tcp/10.0.0.5:7447 --mavlink udpout:127.0.0.1:14550
    """
    from stopgo.bridge.link.keys import now_utc, read_keys
    from stopgo.bridge.link.protocol import KeyExpressions
    from stopgo.bridge.link.zenoh_link import Guard, connecting
    from stopgo.bridge.mavlink.tunnel.tunnel import greeting, open_tunnel

    _leave_on_sigterm()
    own, held = KeyExpressions(robot, site), None if keys is None else read_keys(keys, now=now_utc())
    sends = held is None or held.holder.role == "station"
    transport = _transport(mavlink, insecure)
    end = f"the tunnel's endpoint at {robot}"
    with connecting(connect, Guard(held, insecure)) as link, open_tunnel(
        link, transport, publishes=own.mavlink("up") if sends else None, receives=own.mavlink("down"),
        wrote=RefusalListener(robot).take,
    ) as tunnel, greeting(
        link, own.mavlink("hello"), own.mavlink("alive"),
        lambda key, alive: say(f"{end} is {'connected' if alive else 'disconnected'}"),
    ):  # fmt: skip
        say(f"ready {robot} at {connect}, ground program at {mavlink}")
        _run(tunnel)


class RefusalSender:
    """Reports blocked messages: on stderr at the robot, and to the sender as a STATUSTEXT."""

    def __init__(self) -> None:
        self._reported_s: dict[str, float] = {}

    def text_of(self, message: Message) -> bytes:
        """Return the STATUSTEXT for a blocked message; empty if one was sent less than a second ago."""
        from stopgo.bridge.mavlink.tunnel.message_filter import described
        from stopgo.bridge.mavlink.vehicle_link.messages import warning

        what, now = described(message), time.monotonic()
        if now - self._reported_s.get(what, -SAY_EVERY_S) < SAY_EVERY_S:
            return b""
        if what not in self._reported_s:
            say(f"refused {what}: {ONLY_STOPS}")
        self._reported_s[what] = now
        return warning(f"{REFUSED}{what}", system=getattr(message, "target_system", 0) or 1)


class RefusalListener:
    """Reports at the station, once for each kind, messages that the robot's endpoint blocked."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._reported: set[str] = set()

    def take(self, message: Message) -> None:
        """Read a message from the robot's endpoint, and report it if it is a refusal."""
        if message.get_type() != "STATUSTEXT" or not message.text.startswith(REFUSED):
            return
        what = message.text.removeprefix(REFUSED)
        if what not in self._reported and len(self._reported) < MOST_KINDS:
            self._reported.add(what)
            say(f"the tunnel's endpoint at {self._robot} refused {what}: {ONLY_STOPS} there")


def _transport(mavlink: str, insecure: bool) -> Transport:
    """Open the MAVLink side; beyond this machine it needs --insecure, because nothing is signed here."""

    url = read_url(mavlink)
    check_guarded(url, signed=False, insecure=insecure)
    return open_transport(url)


def _run(tunnel: Tunnel) -> None:
    """Run the tunnel until a signal ends it, then print its statistics."""
    from stopgo.bridge.mavlink.tunnel.tunnel import summary

    try:
        tunnel.wait()
    finally:
        for line in summary(tunnel.carried, tunnel.dropped):
            say(line)


def _leave_on_sigterm() -> None:
    signal.signal(signal.SIGTERM, _leave)


def _leave(signum: int, frame: object) -> None:
    raise SystemExit(0)
