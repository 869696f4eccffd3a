"""HOLD is sent before a stop is decided, read or stored: no journal delays it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.auto.logbook import Logbook, PendingCommand
from stopgo.bridge.mavlink.auto.pending_commands import PendingCommands
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent, VehicleCommands
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.wire import Who
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.following.vehicle_health import VehicleHealth
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run import states as runs
from stopgo.mission.run.run_commands import FREE_VERBS, RunCommand, Verb
from tests.bridge.mavlink.auto.site import Site

NET_S = 60.0
"""Longest wait of a test that has failed."""
CUSTOM = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
HOLD = 4


class Vehicle:
    """A peer that stands in HOLD as soon as it is commanded."""

    who, autopilot, silent_s = Who(1, 1), autopilot_named("ardupilot"), 0.0

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.held, self.asked = threading.Event(), threading.Event()

    def send(self, message: Message) -> None:
        if message.get_type() == "COMMAND_LONG" and message.command == dialect.MAV_CMD_DO_SET_MODE:
            self.calls.append("HOLD")
            self.held.set()

    @contextmanager
    def waiting(self, *types: str) -> Iterator[Vehicle]:
        self._reports = iter((
            dialect.MAVLink_heartbeat_message(10, 3, CUSTOM, HOLD, 4, 3),
            dialect.MAVLink_local_position_ned_message(0, 0, 0, 0, 0.0, 0, 0),
        ))  # fmt: skip
        yield self

    def get(self, timeout_s: float) -> Message | None:
        return next(self._reports, None)


class SlowDisk:
    """A commit that waits until the test lets it go on."""

    def __init__(self) -> None:
        self.entered, self.goes_on = threading.Event(), threading.Event()

    def __call__(self, moment: str) -> None:
        self.entered.set()
        assert self.goes_on.wait(NET_S)


class Still:
    """An observer of a vehicle without a pose: also its status, position and poses."""

    items, health = None, VehicleHealth()

    def __init__(self) -> None:
        self.status = self.position = self.poses = self

    def pose(self, now_ns: int) -> None:
        return None


def stop_order(verb: Verb, cmd_id: str = "first") -> RunCommand:
    return RunCommand(cmd_id=cmd_id, verb=verb, commander="test", issued_ns=0, valid_for_s=5.0)


def orders_for(book: Logbook, vehicle: Any) -> VehicleCommands:
    observer: Any = Still()
    no_commands: Any = None
    return VehicleCommands(book, vehicle, observer, no_commands, book.clock, Consent())


def started(book: Logbook) -> None:
    book.move(lambda run: (runs.started(run, run_id="run", now_ns=0, by="test"),))


@pytest.mark.parametrize(("verb", "state"), [("pause", "PAUSED"), ("abort", "ABORTED")])
def test_a_disk_that_does_not_answer_delays_no_hold(verb: Verb, state: str, tmp_path: Path) -> None:
    """Another process's write has the disk; HOLD is sent, and the vehicle stands, meanwhile."""
    vehicle, disk = Vehicle(), SlowDisk()
    with Site(tmp_path).book() as book:
        started(book)
        orders = orders_for(book, vehicle)
        book.journal.rows.commit_hook = disk
        storing = threading.Thread(target=book.use, args=(1, 1))
        storing.start()
        assert disk.entered.wait(NET_S)
        stopping = threading.Thread(target=orders.execute, args=(stop_order(verb),))
        stopping.start()
        assert vehicle.held.wait(NET_S)
        assert not disk.goes_on.is_set()
        disk.goes_on.set()
        storing.join(NET_S)
        stopping.join(NET_S)
        assert (book.run.state, book.ordered) == (state, None)


def noted(calls: list[str], call: Callable[..., object]) -> Callable[..., object]:
    return lambda *arguments: (calls.append("journal"), call(*arguments))[1]


@pytest.mark.parametrize("verb", FREE_VERBS)
def test_hold_is_sent_before_all_access_to_the_journal(verb: Verb, tmp_path: Path) -> None:
    vehicle = Vehicle()
    with Site(tmp_path).book() as book:
        started(book)
        orders, rows = orders_for(book, vehicle), book.journal.rows
        for name in ("read", "select", "commit_hook"):
            setattr(rows, name, noted(vehicle.calls, getattr(rows, name)))
        orders.execute(stop_order(verb))
    assert (vehicle.calls[0], vehicle.calls.count("HOLD"), "journal" in vehicle.calls) == ("HOLD", 1, True)


def test_while_the_note_of_a_stop_is_not_stored_its_process_knows_it(tmp_path: Path) -> None:
    """Else the process would take the HOLD for somebody else's."""
    vehicle, seen = Vehicle(), list[str]()
    with Site(tmp_path).book() as book:
        started(book)
        send = vehicle.send
        vehicle.send = lambda message: (send(message), seen.append(book.ordered.by))  # type: ignore[method-assign, assignment, union-attr, func-returns-value]
        orders_for(book, vehicle).execute(stop_order("pause"))
    assert seen[0] == "test"


def test_a_stop_that_comes_again_does_not_stop_a_resumed_vehicle(tmp_path: Path) -> None:
    vehicle = Vehicle()
    with Site(tmp_path).book() as book:
        started(book)
        orders, pause = orders_for(book, vehicle), stop_order("pause")
        first = orders.execute(pause)
        book.move(lambda run: (runs.resumed(run, "test"),))
        assert orders.execute(pause) == first
        assert (vehicle.calls, book.run.state) == (["HOLD"], "RUNNING")


@pytest.mark.parametrize(("command", "sent"), [("hold", ["HOLD"]), ("jump", [])])
def test_a_hold_that_the_run_requires_is_sent_before_it_is_stored(command: Any, sent: list[str]) -> None:
    calls: list[str] = []

    class Commands:
        def send_hold(self) -> None:
            calls.append("HOLD")

    commands: Any = Commands()
    nothing: Any = None
    pending = PendingCommands(nothing, nothing, nothing, commands, nothing)
    pending.hold_before_storing(PendingCommand(command=command, place=0, since_ns=0))
    pending.hold_before_storing(None)
    assert calls == sent
