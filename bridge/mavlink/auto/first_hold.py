"""HOLD as the first frame on a link, before heartbeats, telemetry and every check; repeated to standstill.

A vehicle is commanded at once if this station has a record of it on that link. Any other rover is commanded
as soon as its heartbeat shows the kind of its autopilot.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from stopgo.bridge.mavlink.auto.logbook import Logbook, logbook, recorded_vehicles
from stopgo.bridge.mavlink.auto.vehicle_commands import ORDERING_NS, ordered_by
from stopgo.bridge.mavlink.vehicle_link.messages import command_long, request
from stopgo.bridge.mavlink.vehicle_link.peer import AGAIN_S, is_of_autopilot
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who, Wire, sender
from stopgo.mission.errors import InputError, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots import autopilot_named, autopilot_of
from stopgo.mission.mavlink.autopilots.kind import ROVERS, Mode
from stopgo.mission.mavlink.enums import Component, MessageId
from stopgo.mission.mavlink.items import Command
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.run_commands import Verb


class FirstHold:
    """Sends HOLD to these vehicles, and to every rover of that system id that is found (`None`: to each)."""

    def __init__(self, wire: Wire, vehicle: int | None) -> None:
        self._wire = wire
        self._holds: dict[Who, Mode] = {}
        self._vehicle = vehicle
        self._met: set[Who] = set()
        """Vehicles whose heartbeat was heard."""
        self._recorded = False
        self._closing = threading.Event()

    def begin(self, holds: Iterable[tuple[int, Mode]]) -> None:
        """Send the first frame: HOLD to each vehicle of `holds`, or a request for a heartbeat."""
        for system, hold in holds:
            who = Who(system, Component.AUTOPILOT1)
            self._holds[who] = hold
            self._send(who)
        self._recorded = bool(self._holds)
        if not self._holds:
            self._wire.send(request(Who(self._vehicle or 0, Component.AUTOPILOT1), MessageId.HEARTBEAT))

    def repeat(self, heartbeats: MessageQueue) -> None:
        """Send HOLD again and again until closed, and to each further vehicle at its first heartbeat."""
        due_s = time.monotonic() + AGAIN_S
        while not self._closing.is_set():
            message = heartbeats.get(due_s - time.monotonic())
            if message is not None:
                self._meet(message)
            if time.monotonic() >= due_s:
                for who in self._holds:
                    self._send(who)
                due_s = time.monotonic() + AGAIN_S

    def _meet(self, heartbeat: Message) -> None:
        """Send HOLD at a vehicle's first heartbeat: on a port that listens, its address was unknown."""
        who = sender(heartbeat)
        if who not in self._holds and self._is_meant(heartbeat):
            self._holds[who] = autopilot_of(heartbeat.autopilot).modes.hold
        if who in self._holds and who not in self._met:
            self._met.add(who)
            self._send(who)

    def close(self) -> None:
        self._closing.set()

    @property
    def systems(self) -> tuple[int, ...]:
        """System ids of the vehicles that were commanded."""
        return tuple(sorted(who.system for who in list(self._holds)))

    @property
    def vehicle(self) -> int | None:
        """The one vehicle that is meant; `None` if that is not known."""
        recorded = self.systems if self._recorded else ()
        return recorded[0] if len(recorded) == 1 else self._vehicle

    @property
    def sent_to(self) -> str:
        """The vehicles that were commanded, in words; empty if there are none."""
        return " and ".join(f"vehicle {system}" for system in self.systems)

    def _is_meant(self, heartbeat: Message) -> bool:
        if not is_of_autopilot(heartbeat) or heartbeat.type not in ROVERS:
            return False
        return not self._recorded and self._vehicle in (None, heartbeat.get_srcSystem())

    def _send(self, who: Who) -> None:
        """Send HOLD to every address: if two vehicles have that system id, both are to stand."""
        self._wire.send(command_long(who, Command.DO_SET_MODE, *self._holds[who].params), everywhere=True)


@contextmanager
def held_first(wire: Wire, url: Url, *, vehicle: int | None, state: Path | None) -> Iterator[FirstHold]:
    """HOLD goes out now, and again until the block ends.

    Raises
    ------
    OutcomeUnknown
        In place of an error in the block that would say that nothing was sent.
    """
    hold = FirstHold(wire, vehicle)
    with wire.waiting("HEARTBEAT") as heartbeats:
        hold.begin(recorded_holds(url, vehicle, state))
        thread = threading.Thread(target=hold.repeat, args=(heartbeats,), daemon=True)
        thread.start()
        try:
            yield hold
        except (InputError, RobotUnreachable) as error:
            if not hold.sent_to:
                raise
            why = str(error).replace("; nothing was sent", "")
            raise OutcomeUnknown(
                f"{url}: HOLD was sent to {hold.sent_to}, and a standstill is not confirmed;"
                f" look at the vehicle ({why})"
            ) from None
        finally:
            hold.close()
            thread.join()


def recorded_holds(url: Url, vehicle: int | None, state: Path | None) -> Iterator[tuple[int, Mode]]:
    """Yield the mode HOLD of each vehicle to which this station has sent a mission, with its system id.

    Its logbook is open meanwhile: to close it may write.
    """
    for system in recorded_vehicles(url, state) if vehicle is None else [vehicle]:
        with suppress(InputError), logbook(url, system, state, make=False) as book:
            mode = _hold_of(book)
            if mode is not None:
                yield system, mode


def _hold_of(book: Logbook) -> Mode | None:
    listed = book.listed
    return None if listed is None else autopilot_named(listed.sent.autopilot).modes.hold


@contextmanager
def noted_order(
    url: Url, systems: tuple[int, ...], state: Path | None, verb: Verb, by: str
) -> Iterator[None]:
    """Note in the logbooks who has commanded HOLD, so that a watch does not take it for somebody else's.

    If the block fails, nobody carries the command out any more: what the vehicle then reports counts again.
    """

    def note(for_ns: int) -> None:
        for system in systems:
            with suppress(InputError), logbook(url, system, state, make=False) as book:
                until_ns = book.clock.now_ns() + for_ns
                book.journal.store_fact("ordered", ordered_by(verb, by, until_ns=until_ns))

    note(ORDERING_NS)
    try:
        yield
    except BaseException:
        note(0)
        raise
