"""The robot's end of the link: it answers the questions of stations, and publishes state, poses and events.

A token shows that the robot is present, the age of its last state that it is well. The robot publishes its
state on every change and at least every second, its pose many times a second, and every event as soon as the
journal has it.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

import msgspec

from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.keys import Untrusted, now_utc
from stopgo.bridge.link.link import Link, Request, Unanswered
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
from stopgo.bridge.robot.pages import address_of, events_page, part_page
from stopgo.bridge.robot.published_poses import PublishedPoses
from stopgo.bridge.robot.recorder import ENTRY_S, RunRecorder
from stopgo.bridge.robot.refusal_log import RefusalLog
from stopgo.bridge.robot.reported_journal import ReportedJournal
from stopgo.bridge.robot.runner import Runner, state_report
from stopgo.bridge.robot.station_contact import StationContact
from stopgo.mission import __version__
from stopgo.mission.console.process import wait_for
from stopgo.mission.document.decoding import converted
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import StateReport
from stopgo.mission.run.lease import Lease, renewed
from stopgo.mission.run.run_commands import FREE_VERBS, RunCommand

STATE_EVERY_S = 1.0
POSE_EVERY_S = 0.05
TWIN_S = 5.0
"""Interval at which a robot behind a router looks for another robot of its name."""
LEAST_POSE_PAUSE_S = 0.02
"""At most fifty poses a second are published, however fast the simulated clock runs."""


Signed = TypeVar("Signed", RunCommand, Commit)


def check_ordering(request: Request, commander: str | None = None) -> None:
    """Allow commands only from stations, each in its own name; without keys from everybody.

    Raises
    ------
    Untrusted
        If the sender may not; it names the sender.
    """
    holder = request.holder
    if holder is None:
        return
    if holder.role != "station":
        raise Untrusted(f"{holder.name} is a {holder.role}; only stations send commands")
    if commander not in (None, holder.name):
        raise Untrusted(f"signed by {holder.name}, not by {commander}")


def others_of(link: Link, keys: KeyExpressions, boot_id: str, *, timeout_s: float = 1.0) -> tuple[str, ...]:
    """Return the boot ids of other robots that answer to this robot's name."""
    answers = link.ask_all(keys.boot, timeout_s=timeout_s)
    boots = {boot.boot_id for boot in map(_boot_in, answers) if boot is not None}
    return tuple(sorted(boots - {boot_id}))


def _boot_in(answer: bytes) -> Booted | None:
    try:
        return decode(answer, Booted)
    except msgspec.DecodeError:
        return None


def keep_lease(journal: Journal, commander: str, *, now_ns: int) -> None:
    """Renew the lease if it is the commander's. A disk that fails is ignored here: commands report it."""
    with suppress(sqlite3.DatabaseError):
        if renewed(journal.fact("lease", Lease), commander, now_ns=now_ns) is not None:
            _renew(journal, commander, now_ns=now_ns)


def _renew(journal: Journal, commander: str, *, now_ns: int) -> None:
    with journal.transaction():
        lease = renewed(journal.fact("lease", Lease), commander, now_ns=now_ns)  # or another station's by now
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
        """Without an `inbox` no mission is accepted; `failed` is called with an error that ended a thread.

        `stand_still` is called with the reason if another robot has this name; without it none can have.
        """
        self._keys = keys
        self._link = link
        self._journal = journal
        self._reported = ReportedJournal(journal)
        self._runner = runner
        self._inbox = inbox
        self._recorder = recorder
        self._clock, self._command_clock = clock, command_clock
        self._stand_still, self._on_failure = stand_still, failed
        self._refusals = refusals or RefusalLog(lambda line: None, now_utc)
        self._contact = StationContact(command_clock)
        self._poses = PublishedPoses(keys.robot, runner.boot_id)
        self._pose_pause_s = max(POSE_EVERY_S / speed_up, LEAST_POSE_PAUSE_S)
        self._to_map = None if to_map is None else converted(to_map, OwnMap, from_attributes=True)
        self._twin_check_ns = command_clock.now_ns()
        self._closing, self._news, self._failed = threading.Event(), threading.Event(), threading.Event()
        self._error: Exception | None = None
        self._threads: list[threading.Thread] = []
        self._state_seq, self._state_lock = 0, threading.Lock()

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
        for verb in FREE_VERBS:  # each on a key of its own: a stop waits behind no other command
            link.serve(keys.command(verb), self._command)
        link.serve(keys.command("*"), self._other_command)
        link.watch_presence(keys.watcher("*"), self._on_token)

    def open(self) -> None:
        """Answer, start the threads, and announce the robot."""
        if self._recorder is not None and self._runner.snapshot()[0].over:
            self._recorder.idle()
        self.serve()
        keys, link = self._keys, self._link
        self._publish_state = link.publisher(keys.state)
        self._publish_event = link.publisher(keys.event)
        self._publish_health = link.publisher(keys.health)
        self._publish_pose = link.publisher(keys.pose, bulk=True)
        self._runner.changed = self._news.set
        recording = () if self._recorder is None else (self._write_record,)
        for work in (*self._runner.works, self._publish_news, self._publish_poses, *recording):
            thread = threading.Thread(target=self._run_thread, args=(work,), name=work.__name__, daemon=True)
            self._threads.append(thread)
            thread.start()
        link.announce(keys.alive)

    def wait(self) -> None:
        """Wait until a thread ends, which happens only by an error; that error is raised here.

        A robot whose controller has died must not look alive: its process ends, and the next boot finds
        the run paused.
        """
        wait_for(self._failed)
        if self._error is not None:
            raise self._error

    def _run_thread(self, work: Callable[[], None]) -> None:
        try:
            work()
        except Exception as error:  # noqa: BLE001 (the end of a thread)
            self.fail(error)

    def fail(self, error: Exception) -> None:
        """Stand still because of an error that ended a thread; `wait` raises it."""
        try:
            self._runner.stand_still(error)
        finally:
            self._error = error
            self._failed.set()
            self._on_failure(error)

    def close(self) -> None:
        self._runner.close()
        self._closing.set()
        self._news.set()
        for thread in self._threads:
            thread.join()
        if self._recorder is not None:
            self._recorder.close()

    def _commander(self) -> str | None:
        """Return the holder of the lease, also of one that has ended; a failing disk does not matter."""
        lease = self._reported.lease
        return None if lease is None else lease.commander

    def _on_token(self, key: str, alive: bool) -> None:
        self._contact.on_presence(key.rpartition("/")[2], alive)

    def _note_contact(self, request: Request, *, sender: str | None = None, token: str | None = None) -> None:
        self._contact.on_request(request, self._commander(), sender=sender, token=token)

    def _mission(self, request: Request) -> bytes:
        _, step = address_of(request.key)
        if step[:1] == ["commit"]:
            return self._ordered(request, Commit, self._commit)
        self._note_contact(request)
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
        """Carry out a command or a commit, if its sender is the one that it names."""
        try:
            order = decode(request.payload, kind)
            check_ordering(request, order.commander)
        except msgspec.DecodeError as error:
            return encode(Malformed(message=f"{kind.__name__}: {error}"))
        except Untrusted as error:
            self._refusals.note(kind.__name__.lower(), order.commander, str(error))
            return encode(untrusted(error))
        reply = carry_out(request, order)
        self._note_contact(request, sender=order.commander)  # a stop waits for nothing, and leases change
        what = order.verb if isinstance(order, RunCommand) else f"push of {order.manifest.mission_id[:12]}"
        self._refusals.note_reply(what, order.commander, reply)
        return encode(reply)

    def _keep(self, request: Request) -> bytes:
        try:
            watching = decode(request.payload, Watching)
            check_ordering(request, watching.commander)
        except msgspec.DecodeError as error:
            return encode(Malformed(message=f"Watching: {error}"))
        except Untrusted:
            return self._answered_info()  # viewers watch as well
        if request.fresh:
            self._keep_lease(watching.commander)
        self._note_contact(request, sender=watching.commander, token=watching.token)
        return self._answered_info()

    def _keep_lease(self, commander: str) -> None:
        """Renew the lease of a commander who watches during a run."""
        run, _ = self._runner.snapshot()
        if not run.over:
            keep_lease(self._journal, commander, now_ns=self._command_clock.now_ns())

    def _info(self, request: Request) -> bytes:
        self._note_contact(request)
        return self._answered_info()

    def _answered_info(self) -> bytes:
        info = Info(
            protocol=VERSION,
            stopgo=__version__,
            robot=self._keys.robot,
            boot_id=self._runner.boot_id,
            clock_ns=self._command_clock.now_ns(),
            state=self._state(),
            lease=self._reported.lease,
            chunk_bytes=CHUNK_BYTES,
            document_bytes=MAX_DOCUMENT_BYTES,
            profiles=None if self._inbox is None else self._inbox.profiles,
            to_map=self._to_map,
            capabilities=() if self._recorder is None else (RECORD,),
        )
        return encode(info)

    def _other_command(self, request: Request) -> bytes:
        """Answer all commands but those that have keys of their own."""
        if request.key in map(self._keys.command, FREE_VERBS):
            raise Unanswered
        return self._command(request)

    def _command(self, request: Request) -> bytes:
        return self._ordered(request, RunCommand, self._obey)

    def _obey(self, request: Request, order: RunCommand) -> Reply:
        if not request.key.endswith(f"/cmd/{order.verb}"):
            return Malformed(message=f"command {order.verb} on {request.key}")
        return self._runner.execute(order)

    def _log(self, request: Request) -> bytes:
        self._note_contact(request)
        try:
            return encode(events_page(self._journal, request))
        except sqlite3.DatabaseError as error:
            return encode(Malformed(message=f"the journal cannot be read: {error}"))

    def _past_poses(self, request: Request) -> bytes:
        self._note_contact(request)
        return encode(self._poses.page(request))

    def _record(self, request: Request) -> bytes:
        self._note_contact(request)
        assert self._recorder is not None
        return encode(self._recorder.answer(request))

    def _publish_news(self) -> None:
        """Publish the state on every change and every second, and each event once, in order."""
        published = self._reported.newest
        while not self._closing.is_set():
            self._news.wait(STATE_EVERY_S)
            self._news.clear()
            self._runner.on_link_silence(self._contact.silent_s(self._commander()))
            self._look_for_twin()
            for event in self._reported.events(since=published):
                self._publish_event(encode(event))
                published = event.number
            state = self._state()
            if self._recorder is not None:
                self._recorder.state(state)
            self._publish_state(encode(state))

    def _state(self) -> StateReport:
        with self._state_lock:
            self._state_seq += 1
            return state_report(
                self._runner, robot=self._keys.robot, seq=self._state_seq, ns=self._clock.now_ns(),
                newest=self._reported.newest,
            )  # fmt: skip

    def _look_for_twin(self) -> None:
        """Stand still if another robot has this name: nobody could know which of them a command reaches."""
        now_ns = self._command_clock.now_ns()
        if self._stand_still is None or now_ns - self._twin_check_ns < TWIN_S * 1e9:
            return
        self._twin_check_ns = now_ns
        if others_of(self._link, self._keys, self._runner.boot_id):
            self._stand_still(f"another robot answers to the name {self._keys.robot}; end one of them")

    def _publish_poses(self) -> None:
        while not self._closing.wait(self._pose_pause_s):
            run, _ = self._runner.snapshot()  # before the pose: a run that begins now gets no earlier one
            position = self._runner.position()
            if position is not None:
                report = self._poses.add(position, run, self._runner.boot_id)
                if self._recorder is not None:
                    self._recorder.pose(report, began_ns=run.started_ns, over=run.over)
                self._publish_pose(encode(report))

    def _write_record(self) -> None:
        assert self._recorder is not None
        while not self._closing.wait(ENTRY_S):
            health = self._recorder.look(battery=self._runner.battery(), robot_ns=self._clock.now_ns())
            if health is not None:
                self._publish_health(encode(health))
            self._recorder.write()


@contextmanager
def on_link(agent: Agent) -> Iterator[Agent]:
    """Open the agent, and close it when the block ends."""
    agent.open()
    try:
        yield agent
    finally:
        agent.close()
