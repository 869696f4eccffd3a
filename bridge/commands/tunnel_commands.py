"""`stopgo tunnel`: raw MAVLink frames over zenoh, so that a ground program on a station reaches a vehicle."""

from __future__ import annotations

import signal
import time
from typing import TYPE_CHECKING, Annotated

import typer

from stopgo.bridge.commands.connection import (
    DEFAULT_ENDPOINT,
    Connect,
    Insecure,
    KeyFolder,
    RobotName,
    SiteName,
    alone,
    given_in,
)
from stopgo.bridge.console import say

if TYPE_CHECKING:
    from stopgo.bridge.mavlink.tunnel.tunnel import Tunnel
    from stopgo.bridge.mavlink.vehicle_link.transport import Transport
    from stopgo.mission.mavlink.telemetry import Message

MOST_KINDS = 100
"""More are the sign of nonsense, which is not worth a line each."""
REFUSED = "tunnel refused "
"""So begins the STATUSTEXT that tells of it."""
SAY_EVERY_S = 1.0
"""A ground program that asks again and again need not be told each time."""


def tunnel_commands() -> typer.Typer:
    """`stopgo tunnel` with its two ends."""
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
    name: Annotated[str, typer.Option("--name", help="Name of this robot.")],
    mavlink: Annotated[str, typer.Option("--mavlink", metavar="URL", help="Where the vehicle is.")],
    listen: Annotated[str, typer.Option(metavar="ENDPOINT", help="Where to listen.")] = DEFAULT_ENDPOINT,
    connect: Annotated[
        str | None,
        typer.Option(metavar="ENDPOINT", help="The robot's own endpoint to join, instead of listening."),
    ] = None,
    raw_orders: Annotated[
        bool, typer.Option("--raw-orders", help="Let stations order anything, not only look and stop.")
    ] = False,
    site: SiteName = None,
    insecure: Insecure = False,
    keys: KeyFolder = None,
) -> None:
    """Be the tunnel's end at the robot, until SIGTERM.

    Without --raw-orders stations can look at the vehicle and stop it, and nothing else: the commander's
    lease does not count here.

    Example: stopgo tunnel robot --name r1 --mavlink serial:/dev/ttyAMA1:57600 --connect tcp/127.0.0.1:7447
    """
    from stopgo.bridge.link.access import access_control
    from stopgo.bridge.link.protocol import KeyExpressions
    from stopgo.bridge.link.zenoh_link import Guard, joining, listening
    from stopgo.bridge.mavlink.tunnel.message_filter import MessageFilter
    from stopgo.bridge.mavlink.tunnel.tunnel import answer_greetings, open_tunnel
    from stopgo.bridge.mavlink.vehicle_link.url import read_url
    from stopgo.bridge.robot.controller import new_boot_id
    from stopgo.bridge.robot.program import robots_keys

    if connect is not None:
        alone(given_in(context), "--connect", "--listen")
    _leave_on_sigterm()
    own, held = KeyExpressions(name, site), None if keys is None else robots_keys(keys, name)
    judge, refusals = MessageFilter(), Refusals()
    # One that joins is reached by nobody but the robot's own end, which decides who may what.
    access = None if held is None or connect else access_control(own)
    guard = Guard(held, insecure, access, new_boot_id())
    transport = _transport(mavlink, insecure)
    opened = joining(connect, guard) if connect else listening(listen, guard)
    with opened as link, open_tunnel(
        link, transport, publishes=own.mavlink("down"), receives=own.mavlink("up"), bulk=True,
        sees=judge.sees,
        passes=(lambda message: True) if raw_orders else judge.lets_through, refused=refusals.told,
        knocks=read_url(mavlink).kind == "udpout",
    ) as tunnel:  # fmt: skip
        answer_greetings(link, own.mavlink("hello"))
        link.announce(own.mavlink("alive"))
        say(f"ready {name} {'joins ' + connect if connect else 'listens on ' + listen}, vehicle at {mavlink}")
        _work(tunnel)


def tunnel_station(
    *,
    robot: RobotName,
    mavlink: Annotated[
        str, typer.Option("--mavlink", metavar="URL", help="Where the ground program is.")
    ] = "udpout:127.0.0.1:14550",
    connect: Connect = DEFAULT_ENDPOINT,
    site: SiteName = None,
    insecure: Insecure = False,
    keys: KeyFolder = None,
) -> None:
    """Be the tunnel's end at a station, until Ctrl-C; with a viewer's keys it only listens.

    Example: stopgo tunnel station --robot r1 --connect tcp/10.0.0.5:7447 --mavlink udpout:127.0.0.1:14550
    """
    from stopgo.bridge.link.keys import now_utc, read_keys
    from stopgo.bridge.link.protocol import KeyExpressions
    from stopgo.bridge.link.zenoh_link import Guard, connecting
    from stopgo.bridge.mavlink.tunnel.tunnel import greeting, open_tunnel

    _leave_on_sigterm()
    own, held = KeyExpressions(robot, site), None if keys is None else read_keys(keys, now=now_utc())
    speaks = held is None or held.holder.role == "station"
    transport = _transport(mavlink, insecure)
    end = f"the tunnel's end at {robot}"
    with connecting(connect, Guard(held, insecure)) as link, open_tunnel(
        link, transport, publishes=own.mavlink("up") if speaks else None, receives=own.mavlink("down"),
        wrote=RefusalsHeard(robot).hears,
    ) as tunnel, greeting(
        link, own.mavlink("hello"), own.mavlink("alive"),
        lambda key, alive: say(f"{end} is {'there' if alive else 'gone'}"),
    ):  # fmt: skip
        say(f"ready {robot} at {connect}, ground program at {mavlink}")
        _work(tunnel)


class Refusals:
    """Says what was refused, to the person at the robot and to whoever sent it."""

    def __init__(self) -> None:
        self._said: dict[str, float] = {}

    def told(self, message: Message) -> bytes:
        """A STATUSTEXT that tells of it, or nothing if that was told a moment ago."""
        from stopgo.bridge.mavlink.tunnel.message_filter import described
        from stopgo.bridge.mavlink.vehicle_link.messages import warning

        what, now = described(message), time.monotonic()
        if now - self._said.get(what, -SAY_EVERY_S) < SAY_EVERY_S:
            return b""
        if what not in self._said:
            say(f"refused {what}: only looking and stopping pass without --raw-orders")
        self._said[what] = now
        return warning(f"{REFUSED}{what}", system=getattr(message, "target_system", 0) or 1)


class RefusalsHeard:
    """Says at the station, once for each kind of message, what the tunnel's end at the robot refused."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._said: set[str] = set()

    def hears(self, message: Message) -> None:
        """Look at a message that came from the robot's end."""
        if message.get_type() != "STATUSTEXT" or not message.text.startswith(REFUSED):
            return
        what = message.text.removeprefix(REFUSED)
        if what not in self._said and len(self._said) < MOST_KINDS:
            self._said.add(what)
            say(
                f"the tunnel's end at {self._robot} refused {what}: "
                "only looking and stopping pass without --raw-orders there"
            )


def _transport(mavlink: str, insecure: bool) -> Transport:
    """The MAVLink side: on this machine, or elsewhere if that is wanted, for nothing is signed here."""
    from stopgo.bridge.mavlink.vehicle_link.transport import open_transport
    from stopgo.bridge.mavlink.vehicle_link.url import check_guarded, read_url

    url = read_url(mavlink)
    check_guarded(url, signed=False, insecure=insecure)
    return open_transport(url)


def _work(tunnel: Tunnel) -> None:
    """Until it is told to end; then say what was done."""
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
