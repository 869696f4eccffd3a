"""A MAVLink vehicle as a robot for a station: an agent in this process serves it, on a link in memory.

`Station`, `follow` and `watch` need not know that no robot of stopgo is at the other end. While no data come
from the vehicle, nothing answers for it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from stopgo.bridge.console import say
from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.mavlink.auto.auto_runner import AutoRunner
from stopgo.bridge.mavlink.auto.commanded_standstill import stand
from stopgo.bridge.mavlink.auto.confirmed_commands import Denied
from stopgo.bridge.mavlink.auto.first_hold import held_first, noted_order
from stopgo.bridge.mavlink.auto.logbook import logbook, name_of
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, found
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import GROUND_STATION, Who, Wire, wire
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.station.station import Station, whoami
from stopgo.mission.errors import NegativeResult
from stopgo.mission.run.run_commands import Verb

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
    stop: Verb | None = None
    """The verb of a stop command: the vehicle must stand before anything else is sent or checked."""
    compares: bool = False
    """Compare first the vehicle's list with the one that was sent."""


@contextmanager
def connect(url: Url, options: Options) -> Iterator[Station]:
    """The vehicle at `url`, as a robot for a station.

    Raises
    ------
    RobotUnreachable
        If no vehicle is found, or it does not report its state; only queries were sent.
    NegativeResult, OutcomeUnknown
        If `options.stop` is given, and the vehicle refuses HOLD or does not report a standstill.
    InputError
        If several are found and none was named, or the logbook's folder cannot be used.
    """
    me = Who(GROUND_STATION.system, COMPONENTS[os.getpid() % len(COMPONENTS)])
    with wire(url, me=me, signing_key=options.signing_key) as opened:
        if options.stop is not None:
            with _stopped(opened, url, options, options.stop) as peer, _served(url, peer, options) as station:
                yield station
            return
        with (
            found(opened, options.vehicle, timeout_s=options.timeout_s) as peer,
            _served(url, peer, options) as station,
        ):
            yield station


@contextmanager
def _stopped(opened: Wire, url: Url, options: Options, verb: Verb) -> Iterator[Peer]:
    """The vehicle once it stands; HOLD goes out before anything else is sent or checked.

    Raises
    ------
    NegativeResult
        If it refuses the mode.
    OutcomeUnknown
        If HOLD was sent and a standstill is not confirmed.
    """
    by = options.commander or whoami()
    with (
        held_first(opened, url, vehicle=options.vehicle, state=options.state) as hold,
        noted_order(url, hold.systems, options.state, verb, by),
        found(opened, hold.vehicle, timeout_s=options.timeout_s) as peer,
    ):
        try:
            stand(peer, patience_s=options.timeout_s, report=say)
        except Denied as denied:
            raise NegativeResult(f"{peer}: denied: {denied}", reason="denied") from None
        say(f"{peer}: stationary, in mode HOLD, as it reports")
        hold.close()
        yield peer


@contextmanager
def _served(url: Url, peer: Peer, options: Options) -> Iterator[Station]:
    """A station on a link in memory to the agent that serves the vehicle."""
    board, keys = Switchboard(), KeyExpressions(name_of(peer.who.system))
    with served_on(board, keys, url, peer, options):
        yield Station(
            board.link(), keys, commander=options.commander or whoami(), timeout_s=options.timeout_s
        )


@contextmanager
def served_on(
    board: Switchboard, keys: KeyExpressions, url: Url, peer: Peer, options: Options
) -> Iterator[None]:
    """An agent that serves the vehicle on the board until the block ends.

    Raises
    ------
    RobotUnreachable
        If the vehicle does not report its state.
    """
    wall, stops = WallClock(), options.stop is not None
    with logbook(url, peer.who.system, options.state) as book, closing(board.link()) as link:
        runner = AutoRunner(
            peer, book, wall, options.consent, board, looks_only=options.looks_only, stands=stops
        )
        agent = Agent(
            keys=keys, link=link, journal=book.journal, runner=runner, clock=book.clock,
            command_clock=wall, failed=board.fail,
        )  # fmt: skip
        with on_link(agent):
            if not stops:
                runner.await_news(options.timeout_s, compares=options.compares)
            yield
