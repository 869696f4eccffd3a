"""A run that an autopilot drives by itself in AUTO, for an agent to serve.

The vehicle's telemetry moves the run on in the logbook; its autopilot carries out the commands.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from stopgo.bridge.console import say
from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.mavlink.auto.auto_follower import AutoFollower
from stopgo.bridge.mavlink.auto.confirmed_commands import ConfirmedCommands
from stopgo.bridge.mavlink.auto.list_guard import UPLOAD_MESSAGES
from stopgo.bridge.mavlink.auto.logbook import Logbook
from stopgo.bridge.mavlink.auto.vehicle_commands import Consent, VehicleCommands
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.robot.runner import Position
from stopgo.mission.document import Mission
from stopgo.mission.errors import RobotUnreachable
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.following.observer import USED_MESSAGES, Observer
from stopgo.mission.mavlink.following.steps import run_on_vehicle
from stopgo.mission.mavlink.telemetry import Message, is_lost
from stopgo.mission.run.run_commands import Answer, RunCommand
from stopgo.mission.run.states import Run

TICK_S = 0.2
ASK_AGAIN_S = 2.0


class Telemetry(MessageQueue):
    """Telemetry of a vehicle's run; its scanner may be a component of its own and report the scans.

    Uploads by other stations are overheard.
    """

    overhears = True

    def wants(self, message: Message) -> bool:
        assert self.of is not None
        if message.get_type() in UPLOAD_MESSAGES:
            return True
        of_scanner = message.get_type() == "CAMERA_IMAGE_CAPTURED"
        return (of_scanner and message.get_srcSystem() == self.of.system) or super().wants(message)


class AutoRunner:
    """The run of one vehicle's mission; `board` is cut while no data come from the vehicle."""

    def __init__(
        self,
        peer: Peer,
        book: Logbook,
        wall: Clock,
        consent: Consent,
        board: Switchboard,
        *,
        looks_only: bool = False,
        stands: bool = False,
    ) -> None:
        """`stands` as for `VehicleCommands`."""
        self.changed: Callable[[], None] = lambda: None
        self._peer = peer
        self._book = book
        self._board = board
        self._looks_only = looks_only
        self._observer = Observer(peer.autopilot)
        self._commands = ConfirmedCommands(peer, self._observer, book.clock)
        self._vehicle_commands = VehicleCommands(
            book, peer, self._observer, self._commands, wall, consent, stands=stands
        )
        self._follower = AutoFollower(book, peer, self._observer, self._commands, looks_only=looks_only)
        self.works: tuple[Callable[[], None], ...] = (self._look, self._act, self._follower.guard)
        self._reported_ns = 0
        self._late = False
        self._closing = threading.Event()
        self._observer.take(peer.heartbeat, book.listed, book.clock.now_ns())

    @property
    def boot_id(self) -> str:
        return self._book.boot_id

    def snapshot(self) -> tuple[Run, Mission | None]:
        """The run as seen if this process only looks; else as stored by any process."""
        listed, run = self._book.listed, self._follower.run if self._looks_only else self._book.run
        run = run_on_vehicle(run, self._observer.position.items, listed)
        return run, None if listed is None else listed.mission

    def position(self) -> Position | None:
        fix = self._observer.poses.fix
        if fix is None or fix.ns <= self._reported_ns:
            return None
        self._reported_ns = fix.ns
        return Position(fix.pose, fix.speed, fix.ns)

    def battery(self) -> float | None:
        return self._observer.status.health.charge

    def health(self) -> BaseHealth:
        now = self._observer.status.health
        return BaseHealth(battery_ok=now.battery, position_ok=now.position, fence_ok=now.fence)

    def execute(self, order: RunCommand) -> Answer:
        """Carry out a command; raises `OutcomeUnknown` if the vehicle does not show its effect."""
        answer = self._vehicle_commands.execute(order)
        self._follower.run = self._book.run
        self.changed()
        return answer

    def on_link_silence(self, silent_s: float) -> None:
        """Do nothing: the vehicle goes on without a station, by its own failsafes."""

    def stand_still(self, error: BaseException) -> None:
        """Do nothing: the vehicle drives by itself, and a station that ends does not stop it."""

    def close(self) -> None:
        self._follower.close()

    def await_news(self, timeout_s: float, *, compares: bool = False) -> None:
        """Wait until the vehicle has reported its state and, if it does in time, its position.

        Raises
        ------
        RobotUnreachable
            If it does not report its state.
        """
        with self._commands.news:
            listed = self._book.listed
            self._commands.news.wait_for(lambda: self._observer.complete(listed), timeout_s)
        if self._observer.position.sequence is None and self._book.listed is not None:
            raise RobotUnreachable(
                f"{self._peer}: no current item (MISSION_CURRENT) within {timeout_s:g} s; nothing was sent"
            )
        if compares:
            self._follower.compare()
        if not self._follower.run.over:  # its last report may have been missed
            self._commands.ask_for_picture()
            self._peer.ask(MessageId.CAMERA_IMAGE_CAPTURED)
        self._follower.begin()

    def _act(self) -> None:
        """Send pending commands, also the one that the end of a run requires."""
        try:
            self._follower.act()
        finally:
            self._closing.set()

    def _look(self) -> None:
        asked_ns = 0
        with self._peer.wire.filling(Telemetry(frozenset(USED_MESSAGES), self._peer.who)) as waiting:
            while not self._closing.is_set():
                now_ns = self._book.clock.now_ns()
                if now_ns > asked_ns + ASK_AGAIN_S * 1e9 and not self._observer.fresh(ASK_AGAIN_S, now_ns):
                    asked_ns = now_ns
                    self._commands.ask_for_telemetry()
                self._take_next(waiting)

    def _is_late(self) -> bool:
        """True while the link delivers the vehicle's reports so late that they do not show its state."""
        late_s = 0.0 if self._looks_only else self._book.boots.late_s
        was_late, self._late = self._late, is_lost(late_s)
        if self._late and not was_late:
            say(f"{self._peer}: the link delivers its reports {late_s:.0f} s late; they count as no data")
        return self._late

    def _take_next(self, waiting: MessageQueue) -> None:
        message = waiting.get(TICK_S)
        self._board.cut = is_lost(self._peer.silent_s) or self._is_late()  # then nothing answers for it
        if message is None:
            return
        if message.get_type() in UPLOAD_MESSAGES:
            return self._follower.overhear(message)
        with self._commands.news:
            name = self._observer.take(message, self._book.listed, self._book.clock.now_ns())
            self._commands.news.notify_all()
        before = self._follower.run
        self._follower.look(name)
        if name == "HEARTBEAT" or self._follower.run != before:
            self.changed()
