"""The robot's end of the link: answers what stations ask, and tells what happens.

Presence is a token, health is the age of the last state: a robot tells its state on every change and at
least every second, its pose many times a second, and every event as soon as the journal has it.
"""

from __future__ import annotations

import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

import msgspec

from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.keys import Untrusted, now_utc
from stopgo.bridge.link.link import Link, Request
from stopgo.bridge.link.protocol import (
    CHUNK_BYTES,
    MAX_DOCUMENT_BYTES,
    VERSION,
    Booted,
    Commit,
    Info,
    KeyExpressions,
    Malformed,
    OwnMap,
    Reply,
    Watching,
    decode,
    encode,
    untrusted,
)
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.pages import POSES_KEPT, address_of, events_page, part_page, poses_page
from stopgo.bridge.robot.recorder import ENTRY_S, RunRecorder
from stopgo.bridge.robot.refusal_log import RefusalLog
from stopgo.bridge.robot.runner import Position, Runner, state_report
from stopgo.mission import __version__
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import PoseReport, StateReport
from stopgo.mission.run.lease import Lease, renewed
from stopgo.mission.run.orders import Order
from stopgo.mission.run.states import Run

STATE_EVERY_S = 1.0
POSE_EVERY_S = 0.05
TWIN_S = 5.0
"""How often a robot behind a router looks whether another answers to its name."""
TOKEN_S = 15.0
"""How long a station's token counts after its last sealed question; whoever watches asks every 5 s."""
LEAST_POSE_PAUSE_S = 0.02
"""However fast the simulated clock runs, poses go out at most fifty times a second."""


Signed = TypeVar("Signed", Order, Commit)


def check_ordering(request: Request, commander: str | None = None) -> None:
    """Let only stations give orders, and each in its own name; without keys everybody may.

    Raises
    ------
    Untrusted
        Naming who asks.
    """
    holder = request.holder
    if holder is None:
        return
    if holder.role != "station":
        raise Untrusted(f"{holder.name} is a {holder.role}; only stations give orders")
    if commander not in (None, holder.name):
        raise Untrusted(f"signed by {holder.name}, not by {commander}")


def others_of(link: Link, keys: KeyExpressions, boot_id: str, *, timeout_s: float = 1.0) -> tuple[str, ...]:
    """The boots of other robots that answer to this robot's name."""
    answers = link.ask_all(keys.boot, timeout_s=timeout_s)
    boots = {boot.boot_id for boot in map(_boot_in, answers) if boot is not None}
    return tuple(sorted(boots - {boot_id}))


def _boot_in(answer: bytes) -> Booted | None:
    try:
        return decode(answer, Booted)
    except msgspec.DecodeError:
        return None


def keep_lease(journal: Journal, commander: str, *, now_ns: int) -> None:
    """Renew the lease if it is the commander's; a journal that takes nothing shows in what matters more."""
    if renewed(journal.fact("lease", Lease), commander, now_ns=now_ns) is None:
        return
    with suppress(sqlite3.OperationalError), journal.transaction():
        lease = renewed(journal.fact("lease", Lease), commander, now_ns=now_ns)  # nobody else's by now
        if lease is not None:
            journal.store_fact("lease", lease)


class Agent:
    """One robot on a link."""

    def __init__(
        self,
        *,
        keys: KeyExpressions,
        link: Link,
        journal: Journal,
        runner: Runner,
        clock: Clock,
        command_clock: Clock,
        inbox: Inbox | None = None,
        speed_up: float = 1.0,
        to_map: Transform | None = None,
        failed: Callable[[Exception], None] = lambda error: None,
        stand_still: Callable[[str], None] | None = None,
        refusals: RefusalLog | None = None,
        recorder: RunRecorder | None = None,
    ) -> None:
        """`inbox` takes missions, if the robot does; `failed` is told what ended one of its works.

        `stand_still` is given the reason if another robot answers to this name; without it none can.
        """
        self._keys = keys
        self._stand_still = stand_still
        self._refusals = refusals or RefusalLog(lambda line: None, now_utc)
        self._looked_ns = command_clock.now_ns()
        self._recorder = recorder
        self._link = link
        self._journal = journal
        self._runner = runner
        self._clock = clock
        self._command_clock = command_clock
        self._pose_pause_s = max(POSE_EVERY_S / speed_up, LEAST_POSE_PAUSE_S)
        self._inbox = inbox
        self._to_map = None if to_map is None else msgspec.convert(to_map, OwnMap, from_attributes=True)
        self._closing = threading.Event()
        self._news = threading.Event()
        self._failed = threading.Event()
        self._error: Exception | None = None
        self._tell_failure = failed
        self._threads: list[threading.Thread] = []
        self._watchers: set[str] = set()
        self._poses: deque[PoseReport] = deque(maxlen=POSES_KEPT)
        self._poses_boot = runner.boot_id
        self._pose_seq = self._state_seq = 0
        self._stating = threading.Lock()
        self._heard_ns = command_clock.now_ns()
        self._sealed_ns: int | None = None
        """When a holder of keys last asked, if ends hold keys."""

    def serve(self) -> None:
        """Answer on every key."""
        keys, link = self._keys, self._link
        link.serve(keys.info, self._info)
        link.serve(keys.keep, self._keep)
        link.serve(keys.boot, lambda request: encode(Booted(boot_id=self._runner.boot_id)))
        link.serve(keys.log, self._log)
        link.serve(keys.poses, self._past_poses)
        if self._recorder is not None:
            link.serve(keys.record, self._record)
        link.serve(keys.mission("*", "**" if self._inbox else "part/*"), self._mission)
        link.serve(keys.command("*"), self._command)
        link.watch_presence(keys.watcher("*"), self._watcher)

    def open(self) -> None:
        """Answer, begin to work and to tell, and announce the robot."""
        if self._recorder is not None and self._runner.snapshot()[0].over:
            self._recorder.idle()
        self.serve()
        keys, link = self._keys, self._link
        self._tell_state = link.publisher(keys.state)
        self._tell_event = link.publisher(keys.event)
        self._tell_health = link.publisher(keys.health)
        self._tell_pose = link.publisher(keys.pose, bulk=True)
        self._runner.changed = self._news.set
        recording = () if self._recorder is None else (self._write_record,)
        for work in (*self._runner.works, self._tell_news, self._tell_poses, *recording):
            thread = threading.Thread(target=self._watched, args=(work,), name=work.__name__, daemon=True)
            self._threads.append(thread)
            thread.start()
        link.announce(keys.alive)

    def wait(self) -> None:
        """Wait until the robot's work ends, which it does only by an error; that is raised here.

        A robot whose controller has died must not look alive: its process ends, and the next boot finds
        the run paused.
        """
        self._failed.wait()
        if self._error is not None:
            raise self._error

    def _watched(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self._error = error
            self._failed.set()
            self._tell_failure(error)

    def close(self) -> None:
        self._runner.close()
        self._closing.set()
        self._news.set()
        for thread in self._threads:
            thread.join()
        if self._recorder is not None:
            self._recorder.close()

    def _watcher(self, key: str, alive: bool) -> None:
        (self._watchers.add if alive else self._watchers.discard)(key)
        if self._sealed_ns is None:
            self._heard_ns = self._command_clock.now_ns()

    def _contact(self, request: Request) -> None:
        """Somebody asks: just now, and not somebody else again what was asked long ago."""
        if request.fresh:
            self._heard_ns = self._command_clock.now_ns()
            if request.holder is not None:
                self._sealed_ns = self._heard_ns

    def _silent_s(self) -> float:
        """How long no station has watched or asked.

        A token is no proof of a station where ends hold keys: it counts while its station asks now and then.
        """
        now_ns = self._command_clock.now_ns()
        if self._watchers and (self._sealed_ns is None or now_ns - self._sealed_ns < TOKEN_S * 1e9):
            self._heard_ns = now_ns
        return (now_ns - self._heard_ns) / 1e9

    def _mission(self, request: Request) -> bytes:
        self._contact(request)
        _, step = address_of(request.key)
        if step[:1] == ["commit"]:
            return self._ordered(request, Commit, self._commit)
        try:
            if step[:1] != ["part"]:
                check_ordering(request)
        except Untrusted as error:
            return encode(untrusted(error))
        return encode(self._mission_step(request))

    def _commit(self, request: Request, commit: Commit) -> Reply:
        return self._mission_step(request)

    def _mission_step(self, request: Request) -> Reply:
        return part_page(self._journal, request) if self._inbox is None else self._inbox.receive(request)

    def _ordered(
        self, request: Request, kind: type[Signed], carry_out: Callable[[Request, Signed], Reply]
    ) -> bytes:
        """Carry out what only a commander may order, if it is from the one it says it is from."""
        try:
            order = decode(request.payload, kind)
            check_ordering(request, order.commander)
        except msgspec.DecodeError as error:
            return encode(Malformed(message=f"{kind.__name__}: {error}"))
        except Untrusted as error:
            self._refusals.note(kind.__name__.lower(), order.commander, str(error))
            return encode(untrusted(error))
        reply = carry_out(request, order)
        what = order.verb if isinstance(order, Order) else f"push of {order.manifest.mission_id[:12]}"
        self._refusals.note_reply(what, order.commander, reply)
        return encode(reply)

    def _keep(self, request: Request) -> bytes:
        try:
            watching = decode(request.payload, Watching)
            check_ordering(request, watching.commander)
        except msgspec.DecodeError as error:
            return encode(Malformed(message=f"Watching: {error}"))
        except Untrusted:
            return self._info(request)  # viewers watch as well
        if request.fresh:
            self._keep_lease(watching.commander)
        return self._info(request)

    def _keep_lease(self, commander: str) -> None:
        """During a run the lease of a commander who watches does not end."""
        run, _ = self._runner.snapshot()
        if not run.over:
            keep_lease(self._journal, commander, now_ns=self._command_clock.now_ns())

    def _info(self, request: Request) -> bytes:
        self._contact(request)
        info = Info(
            protocol=VERSION,
            stopgo=__version__,
            robot=self._keys.robot,
            boot_id=self._runner.boot_id,
            clock_ns=self._command_clock.now_ns(),
            state=self._state(),
            lease=self._journal.fact("lease", Lease),
            chunk_bytes=CHUNK_BYTES,
            document_bytes=MAX_DOCUMENT_BYTES,
            profiles=None if self._inbox is None else self._inbox.profiles,
            to_map=self._to_map,
            capabilities=() if self._recorder is None else (RECORD,),
        )
        return encode(info)

    def _command(self, request: Request) -> bytes:
        self._contact(request)
        return self._ordered(request, Order, self._obey)

    def _obey(self, request: Request, order: Order) -> Reply:
        if not request.key.endswith(f"/cmd/{order.verb}"):
            return Malformed(message=f"command {order.verb} on {request.key}")
        return self._runner.execute(order)

    def _log(self, request: Request) -> bytes:
        self._contact(request)
        return encode(events_page(self._journal, request))

    def _past_poses(self, request: Request) -> bytes:
        self._contact(request)
        # A copy: meanwhile the robot goes on writing.
        return encode(poses_page(self._poses.copy(), self._poses_boot, request))

    def _record(self, request: Request) -> bytes:
        self._contact(request)
        assert self._recorder is not None
        return encode(self._recorder.answer(request))

    def _tell_news(self) -> None:
        """State on every change and every second; each event once, in order."""
        told = self._journal.newest
        while not self._closing.is_set():
            self._news.wait(STATE_EVERY_S)
            self._news.clear()
            self._runner.on_link_silence(self._silent_s())
            self._look_for_twin()
            for event in self._journal.events(since=told):
                self._tell_event(encode(event))
                told = event.number
            state = self._state()
            if self._recorder is not None:
                self._recorder.state(state)
            self._tell_state(encode(state))

    def _state(self) -> StateReport:
        with self._stating:
            self._state_seq += 1
            return state_report(
                self._runner, robot=self._keys.robot, seq=self._state_seq, ns=self._clock.now_ns(),
                newest=self._journal.newest,
            )  # fmt: skip

    def _look_for_twin(self) -> None:
        """Stand still if another robot answers to this name, of which nobody knows which one they order."""
        now_ns = self._command_clock.now_ns()
        if self._stand_still is None or now_ns - self._looked_ns < TWIN_S * 1e9:
            return
        self._looked_ns = now_ns
        if others_of(self._link, self._keys, self._runner.boot_id):
            self._stand_still(f"another robot answers to the name {self._keys.robot}; end one of them")

    def _tell_poses(self) -> None:
        while not self._closing.wait(self._pose_pause_s):
            position = self._runner.position()
            if position is not None:
                run, _ = self._runner.snapshot()
                report = self._pose_report(position, run)
                self._poses.append(report)
                if self._recorder is not None:
                    self._recorder.pose(report, began_ns=run.started_ns, over=run.over)
                self._tell_pose(encode(report))

    def _write_record(self) -> None:
        assert self._recorder is not None
        while not self._closing.wait(ENTRY_S):
            health = self._recorder.look(battery=self._runner.battery(), robot_ns=self._clock.now_ns())
            if health is not None:
                self._tell_health(encode(health))
            self._recorder.write()

    def _pose_report(self, position: Position, run: Run) -> PoseReport:
        boot_id = self._runner.boot_id
        if boot_id != self._poses_boot:  # each boot counts its poses anew
            self._poses_boot, self._pose_seq = boot_id, 0
            self._poses.clear()
        self._pose_seq += 1
        return PoseReport(
            robot=self._keys.robot, boot_id=boot_id, seq=self._pose_seq, robot_ns=position.ns,
            run_id=run.run_id,
            mission_time_s=(position.ns - run.started_ns) / 1e9 if run.run_id else None,
            pose=position.pose, speed=position.speed,
        )  # fmt: skip


@contextmanager
def on_link(agent: Agent) -> Iterator[Agent]:
    """The agent at work, until the block ends."""
    agent.open()
    try:
        yield agent
    finally:
        agent.close()
