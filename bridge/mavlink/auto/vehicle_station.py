"""A MAVLink vehicle as a station sees a robot: an agent in this process serves it, on a link in memory.

`Station`, `follow` and `watch` need not know that there is no robot of stopgo at the other end. While the
vehicle is silent, nobody answers for it.
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
from stopgo.bridge.mavlink.line.peer import found
from stopgo.bridge.mavlink.line.url import Url
from stopgo.bridge.mavlink.line.wire import GROUND_STATION, Who, wire
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.station.station import Station, whoami

COMPONENTS = range(25, 100)
"""Free for users (MAV_COMP_ID_USER1 to 75): by them a vehicle tells processes of one station apart."""


@dataclass(frozen=True)
class Options:
    """How a vehicle is spoken to."""

    vehicle: int | None = None
    signing_key: bytes | None = None
    state: Path | None = None
    timeout_s: float = 5.0
    commander: str | None = None
    consent: Consent = field(default_factory=Consent)
    looks_only: bool = False
    """Write nothing down and tell the vehicle nothing."""
    compares: bool = False
    """Find out first whether the vehicle still holds what it was sent."""


@contextmanager
def connect(url: Url, options: Options) -> Iterator[Station]:
    """The vehicle at `url`, as a station sees a robot.

    Raises
    ------
    RobotUnreachable
        If no vehicle is heard, or it does not tell what it does; nothing was sent but questions.
    InputError
        If several are heard and none was named, or the logbook's folder cannot be used.
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
