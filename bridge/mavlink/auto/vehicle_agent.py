"""A MAVLink vehicle that answers as a robot does: in the station's process, on a link in memory.

`Station`, `follow` and `watch` need not know that there is no robot of stopgo at the other end. What the
vehicle tells moves the run on in the logbook, what the logbook holds is told as a robot tells it. While the
vehicle is silent, so is its agent.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from bridge.link.clock import Clock, WallClock
from bridge.link.link import Request
from bridge.link.memory_link import MemoryLink, Switchboard
from bridge.link.protocol import (
    CHUNK_BYTES,
    MAX_DOCUMENT_BYTES,
    VERSION,
    Info,
    KeyExpressions,
    Malformed,
    Reply,
    count_of,
    decode,
    encode,
)
from bridge.mavlink.auto.auto_follower import AutoFollower
from bridge.mavlink.auto.confirmed_commands import ConfirmedCommands
from bridge.mavlink.auto.logbook import Logbook, logbook
from bridge.mavlink.auto.vehicle_orders import Consent, VehicleOrders
from bridge.mavlink.line.peer import Peer, found
from bridge.mavlink.line.url import Url
from bridge.mavlink.line.wire import GROUND_STATION, MessageQueue, Who, wire
from bridge.robot.pages import POSES_KEPT, address_of, events_page, mission_part, poses_page
from bridge.station.station import Station, whoami
from mission import __version__
from mission.errors import RobotUnreachable
from mission.events import PoseReport, StateReport
from mission.mavlink.enums import MessageId
from mission.mavlink.following.observer import TOLD, Observer
from mission.mavlink.following.steps import held_by_vehicle
from mission.mavlink.telemetry import is_lost
from mission.run import states as runs
from mission.run.lease import Lease
from mission.run.orders import Order

TICK_S = 0.2
ASK_AGAIN_S = 2.0
COMPONENTS = range(25, 100)
"""Free for users (MAV_COMP_ID_USER1 to 75): by them a vehicle tells processes of one station apart."""
POSES = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")


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
    with (
        wire(url, me=me, signing_key=options.signing_key) as opened,
        found(opened, options.vehicle, timeout_s=options.timeout_s) as peer,
        logbook(url, peer.who.system, options.state) as book,
        vehicle_agent(peer, book, options) as at,
    ):
        at.await_news(options.timeout_s, compares=options.compares)
        who = options.commander or whoami()
        yield Station(at.board.link(), at.keys, commander=who, timeout_s=options.timeout_s)


@contextmanager
def vehicle_agent(peer: Peer, book: Logbook, options: Options) -> Iterator[VehicleAgent]:
    """The agent at work, until the block ends; the vehicle stays as it is."""
    opened = VehicleAgent(peer, book, options)
    opened.open()
    try:
        yield opened
    finally:
        opened.close()


class VehicleAgent:
    """Serves a robot's words for one vehicle."""

    def __init__(self, peer: Peer, book: Logbook, options: Options) -> None:
        self.board = Switchboard()
        self.keys = KeyExpressions(book.robot)
        self._peer = peer
        self._book = book
        self._wall: Clock = WallClock()
        self._observer = Observer(peer.autopilot)
        self._commands = ConfirmedCommands(peer, self._observer, book.clock)
        self._orders = VehicleOrders(book, peer, self._observer, self._commands, self._wall, options.consent)
        self._follower = AutoFollower(
            book, peer, self._observer, self._commands, looks_only=options.looks_only
        )
        self._link: MemoryLink = self.board.link()
        self._poses: deque[PoseReport] = deque(maxlen=POSES_KEPT)
        self._boot_id = ""
        self._error: Exception | None = None
        self._seq = self._pose_seq = 0
        self._told = book.journal.newest
        self._closing = threading.Event()
        self._threads: list[threading.Thread] = []

    def open(self) -> None:
        """Answer on every key, and begin to look and to tell."""
        keys, link = self.keys, self._link
        link.serve(keys.info, lambda request: encode(self._info()))
        link.serve(keys.log, lambda request: encode(events_page(self._book.journal, request)))
        link.serve(keys.poses, lambda request: encode(poses_page(self._poses.copy(), self._boot_id, request)))
        link.serve(keys.mission("*", "part/*"), self._mission)
        link.serve(keys.command("*"), self._command)
        self._tell_state = link.publisher(keys.state)
        self._tell_event = link.publisher(keys.event)
        self._tell_pose = link.publisher(keys.pose)
        link.announce(keys.alive)
        self._observer.take(self._peer.heartbeat, self._book.listed, self._book.clock.now_ns())
        for work in (self._look, self._follower.act):
            thread = threading.Thread(target=self._watched, args=(work,), name=work.__name__, daemon=True)
            self._threads.append(thread)
            thread.start()

    def _watched(self, work: Callable[[], None]) -> None:
        """What ends a thread is told to whoever asks next."""
        try:
            work()
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self._error = error

    def close(self) -> None:
        looking, acting = self._threads
        self._follower.close()
        acting.join()  # what the end of a run wants of the vehicle is still told, and seen
        self._closing.set()
        looking.join()
        self._link.close()

    def await_news(self, timeout_s: float, *, compares: bool = False) -> None:
        """Wait until it is known what the vehicle does; where it stands, as long as that may take.

        Raises
        ------
        RobotUnreachable
            If it does not tell.
        """
        with self._commands.news:
            listed = self._book.listed
            self._commands.news.wait_for(lambda: self._observer.complete(listed), timeout_s)
        if self._observer.sequence is None and self._book.listed is not None:
            raise RobotUnreachable(
                f"{self._peer} does not tell which item it works on (MISSION_CURRENT) within {timeout_s:g} s;"
                " nothing was sent"
            )
        if compares:
            self._follower.compare()
        if not self._follower.run.over:  # what was missed: the scan that was made last
            self._peer.ask(MessageId.CAMERA_IMAGE_CAPTURED)
        self._follower.begin()

    # What it hears, and tells

    def _look(self) -> None:
        asked_ns = 0
        with self._peer.waiting(*TOLD) as waiting:
            while not self._closing.is_set():
                now_ns = self._book.clock.now_ns()
                if now_ns > asked_ns + ASK_AGAIN_S * 1e9 and not self._observer.fresh(ASK_AGAIN_S, now_ns):
                    asked_ns = now_ns
                    self._commands.ask_for_telemetry()
                self._take_next(waiting)

    def _take_next(self, waiting: MessageQueue) -> None:
        message = waiting.get(TICK_S)
        self.board.cut = is_lost(self._peer.silent_s)  # then it is not answered for
        if message is None:
            return
        with self._commands.news:
            name = self._observer.take(message, self._book.listed, self._book.clock.now_ns())
            self._commands.news.notify_all()
        before = self._follower.run
        self._follower.look(name)
        if name in POSES:
            self._report_pose()
        if name == "HEARTBEAT" or self._follower.run != before:
            self._report()

    def _report(self) -> None:
        """Every event once, in order, whichever process has written it; then the state."""
        for event in self._book.journal.events(since=self._told):
            self._tell_event(encode(event))
            self._told = event.number
        self._tell_state(encode(self._state()))

    def _report_pose(self) -> None:
        fix, run = self._observer.fix, self._follower.run
        if fix is None or fix.ns <= (self._poses[-1].robot_ns if self._poses else 0):
            return
        if self._boot_id != self._book.boot_id:  # each boot counts its poses anew
            self._boot_id, self._pose_seq = self._book.boot_id, 0
            self._poses.clear()
        self._pose_seq += 1
        report = PoseReport(
            robot=self.keys.robot, boot_id=self._boot_id, seq=self._pose_seq, robot_ns=fix.ns,
            run_id=run.run_id, mission_time_s=(fix.ns - run.started_ns) / 1e9 if run.run_id else None,
            pose=fix.pose, speed=fix.speed,
        )  # fmt: skip
        self._poses.append(report)
        self._tell_pose(encode(report))

    def _state(self) -> StateReport:
        self._seq += 1
        listed = self._book.listed
        run = held_by_vehicle(self._follower.run, self._observer.items)
        stop = runs.stop_of(run, None if listed is None else listed.mission)
        return StateReport(
            robot=self.keys.robot, boot_id=self._book.boot_id, seq=self._seq,
            robot_ns=self._book.clock.now_ns(), state=run.state, run_id=run.run_id,
            mission_id=run.mission_id, revision=run.revision, stop=stop.id if stop else None,
            stop_state=run.stop_state if stop else None, done=run.done, skipped=run.skipped,
            battery=self._observer.battery, last_event=self._book.journal.newest,
        )  # fmt: skip

    # What it is asked

    def _info(self) -> Info:
        if self._error is not None:
            raise self._error
        return Info(
            protocol=VERSION, stopgo=__version__, robot=self.keys.robot, boot_id=self._book.boot_id,
            clock_ns=self._wall.now_ns(), state=self._state(), lease=self._book.journal.fact("lease", Lease),
            chunk_bytes=CHUNK_BYTES, document_bytes=MAX_DOCUMENT_BYTES, profiles=None, to_map=None,
        )  # fmt: skip

    def _mission(self, request: Request) -> bytes:
        mission_id, step = address_of(request.key)
        try:
            number, revision = count_of(step[1]), count_of(request.parameters.get("revision", ""))
        except ValueError as error:
            return encode(Malformed(message=f"part: {error}"))
        return encode(mission_part(self._book.journal, mission_id, number, revision))

    def _command(self, request: Request) -> bytes:
        return encode(self._obey(request))

    def _obey(self, request: Request) -> Reply:
        try:
            order = decode(request.payload, Order)
        except msgspec.DecodeError as error:
            return Malformed(message=f"Order: {error}")
        answer = self._orders.obey(order)
        self._follower.run = self._book.run
        return answer
