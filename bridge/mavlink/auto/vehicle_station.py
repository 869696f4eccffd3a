"""A MAVLink vehicle as a robot for a station: an agent in this process serves it, on a link in memory.

`Station`, `follow` and `watch` need not know that no robot of stopgo is at the other end. While no data come
from the vehicle, nothing answers for it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.mavlink.auto.auto_runner import AutoRunner
from stopgo.bridge.mavlink.auto.logbook import logbook
from stopgo.bridge.mavlink.auto.vehicle_orders import Consent
from stopgo.bridge.mavlink.vehicle_link.peer import found
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Who, wire
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.station.station import Station, whoami

COMPONENTS = range(25, 100)
"""Free for users (MAV_COMP_ID_USER1 to 75): by them a vehicle distinguishes processes of one station."""


@dataclass(frozen=True)
class Options:
    """Options for the connection to a vehicle."""

    vehicle: int | None = None
    signing_key: bytes | None = None
    state: Path | None = None
    timeout_s: float = 5.0
    commander: str | None = None
    consent: Consent = field(default_factory=Consent)
    looks_only: bool = False
    """Store nothing, and send the vehicle no command."""
    compares: bool = False
    """Compare first the vehicle's list with the one that was sent."""


@contextmanager
def connect(url: Url, options: Options) -> Iterator[Station]:
    """The vehicle at `url`, as a robot for a station.

    Raises
    ------
    RobotUnreachable
        If no vehicle is found, or it does not report its state; only queries were sent.
    InputError
        If several are found and none was named, or the logbook's folder cannot be used.
    """
    me = Who(GROUND_STATION.system, COMPONENTS[os.getpid() % len(COMPONENTS)])
    board, wall = Switchboard(), WallClock()
    with (
        wire(url, me=me, signing_key=options.signing_key) as opened,
        found(opened, options.vehicle, timeout_s=options.timeout_s) as peer,
        logbook(url, peer.who.system, options.state) as book,
    ):
        keys = KeyExpressions(book.robot)
        runner = AutoRunner(peer, book, wall, options.consent, board, looks_only=options.looks_only)
        agent = Agent(
            keys=keys, link=board.link(), journal=book.journal, runner=runner, clock=book.clock,
            command_clock=wall, failed=board.fail,
        )  # fmt: skip
        with on_link(agent):
            runner.await_news(options.timeout_s, compares=options.compares)
            who = options.commander or whoami()
            yield Station(board.link(), keys, commander=who, timeout_s=options.timeout_s)
