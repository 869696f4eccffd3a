"""The station's end of the link: it pushes missions, sends commands, requests states, and follows runs.

Requests are idempotent: sent twice, they take effect once. So the station repeats each request until an
answer comes or the time is up. A request without an answer has an unknown outcome (`OutcomeUnknown`); it is
never reported as failed. A command's `cmd_id` and a commit's `nonce` stay the same in all repetitions.
"""

from __future__ import annotations

import getpass
import hashlib
import os
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from stopgo.bridge.console import Progress
from stopgo.bridge.link.capabilities import RECORD
from stopgo.bridge.link.direct_question import DirectQuestion, can_ask_directly
from stopgo.bridge.link.keys import HeldKeys, now_utc, read_keys
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import (
    CHUNK_BYTES,
    VERSION,
    Accepted,
    ChunkHeld,
    Commit,
    Info,
    KeyExpressions,
    Manifest,
    MissionPart,
    Ready,
    Watching,
    encode,
)
from stopgo.bridge.link.tls_probe import why_no_link
from stopgo.bridge.station import follow
from stopgo.bridge.station.robot_replies import read_answer, read_reply
from stopgo.bridge.station.shown_stop import ShownStop
from stopgo.bridge.station.window import Window, windowed
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.files.mission_json import parse
from stopgo.mission.run.events import AnyEvent, Scanned, Skipped, StateReport, Unconfirmed
from stopgo.mission.run.lease import Lease, remaining_s
from stopgo.mission.run.run_commands import FREE_VERBS, LONGEST_VALID_S, Answer, RunCommand, Verb
from stopgo.mission.run.tolerance import stops_outside

TRY_S = 1.0
"""Timeout of one try."""
BULK_TRY_S = 6.0
"""Timeout of one try for a chunk; repeated too early, copies would fill a slow link."""
COMMIT_BYTES_PER_S = 1e6
"""Lowest rate at which a robot reads and stores a document."""
LEAST_S = 0.5
"""Shortest time for a command itself, even if finding the robot took nearly all of the timeout."""
PAUSE_S = 0.02
"""Pause between tries: a query just after a reconnect may return nothing at once."""
COMMITS = 3
"""Largest number of commits of a push; each restart of the robot needs a new one."""
BEGINNINGS = 5
"""Largest number of transfers of a push; each push of another mission ends the one before."""
UNTIL_ANSWERED = ". A robot that does not answer may drive on later: --timeout 600 sends it until it does"
"""Remedy for a pause or an abort without an answer."""
PATIENCE_S = 20.0
"""Longest time of a push without an answer: on a lossy link, the connection may be opened again."""


@contextmanager
def connect(
    endpoint: str,
    *,
    robot: str,
    site: str | None = None,
    commander: str | None = None,
    timeout_s: float = 5.0,
    patience_s: float = PATIENCE_S,
    insecure: bool = False,
    keys: Path | None = None,
    at_once: bool = False,
) -> Iterator[Station]:
    """Connect to a robot at `endpoint`, such as `tcp/127.0.0.1:7447`.

    With `keys`, a folder made by `stopgo keys`, the commander is the holder of the keys. `at_once` does not
    wait for the robot: a stop command is sent as soon as the link is up.

    Raises
    ------
    RobotUnreachable
        If the robot was not found within `timeout_s`; nothing was sent.
    """
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    held = None if keys is None else read_keys(keys, now=now_utc())
    who = commander or (held.holder.name if held else whoami())
    if held and who != held.holder.name:
        raise InputError(f"--as {who}: the keys in {keys} belong to {held.holder.name}; leave --as out")
    with connecting(endpoint, Guard(held, insecure), open_s=timeout_s) as link:
        station = Station(
            link, KeyExpressions(robot, site), commander=who, timeout_s=timeout_s, patience_s=patience_s,
            held=held,
        )  # fmt: skip
        if at_once and held is not None and can_ask_directly(endpoint):
            station.direct = partial(DirectQuestion, endpoint, held)
        begin = station.look_for if at_once else station.reach
        begin(endpoint, why=lambda: why_no_link(endpoint, held))
        yield station


def whoami() -> str:
    """Return the default name of the operator: user@host, with the number of a user without a name."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # Python up to 3.12, and later ones
        user = f"user-{os.getuid()}"
    return f"{user}@{socket.gethostname()}"


class Station:
    """Connection of this station to one robot, or to all robots of a site."""

    def __init__(
        self,
        link: Link,
        keys: KeyExpressions,
        *,
        commander: str,
        timeout_s: float = 5.0,
        patience_s: float = PATIENCE_S,
        held: HeldKeys | None = None,
    ) -> None:
        self.link = link
        self.held = held
        self.capabilities: tuple[str, ...] = ()
        """Capabilities that the robot reported last."""
        self.lease: Lease | None = None
        """Lease that the robot reported last; it may have ended."""
        self.lease_left_s = 0.0
        """Time that the lease still lasted then."""
        self.meant_stop: str | None = None
        """Stop that the last command was meant for."""
        self.asked_at = time.monotonic()
        """Time of the last query for the robot's state: its answer is no older than that."""
        self.stop_remedy = UNTIL_ANSWERED
        """Remedy for a pause or an abort without an answer, as the error names it."""
        self.direct: Callable[..., DirectQuestion] | None = None
        """Asks a question on a connection of its own; `None` if that is not to be tried."""
        self.keys = keys
        self.commander = commander
        self.timeout_s = timeout_s
        """Timeout of a query or a command."""
        self.patience_s = max(patience_s, timeout_s)
        """Timeout of each chunk of a mission."""
        self._seen = threading.Event()
        self._not_found: Callable[[], RobotUnreachable] | None = None
        """Error for a robot that does not show its token; `None` if no token is looked for."""

    def look_for(
        self, endpoint: str, *, why: Callable[[], str] = lambda: ""
    ) -> Callable[[], RobotUnreachable]:
        """Look for the robot's liveliness token; return the error of a robot that does not show it.

        `why` returns the fault of the link, empty if it is unknown.
        """

        def not_found() -> RobotUnreachable:
            who = "no robot" if self.keys.every else f"robot {self.keys.robot} not"
            reason = why() or "is it running, under this name and site?"
            return RobotUnreachable(
                f"{endpoint}: {who} found within {round(self.timeout_s, 1):g} s"
                f" (key expression {self.keys.alive}); nothing was sent: {reason}"
            )

        self._not_found = not_found
        self.link.watch_presence(self.keys.alive, lambda key, alive: self._seen.set() if alive else None)
        return not_found

    def reach(self, endpoint: str, *, why: Callable[[], str] = lambda: "") -> None:
        """Look for the robot's token and wait for it: a query sent before it returns nothing at once."""
        not_found = self.look_for(endpoint, why=why)
        if not self._seen.wait(self.timeout_s):
            raise not_found()

    def info(self, *, within_s: float | None = None) -> Info:
        """Request the robot's info."""
        within_s = self.timeout_s if within_s is None else within_s
        info = self._only_info(self._ask_all(self.keys.info, b"", within_s), "info")
        if info is None:
            raise OutcomeUnknown(
                f"{self.keys.robot}: no state received within {within_s:.1f} s{self._distrusted()}"
            )
        if info.protocol != VERSION:
            raise InputError(
                f"robot {info.robot}: protocol {info.protocol}, here {VERSION}; update the older one"
            )
        return info

    def keep(self, token: str | None = None) -> StateReport | None:
        """Report to the robot that somebody watches, and return its state; this renews the station's lease.

        `token` is the name of the token that this station shows.

        Raises
        ------
        NegativeResult
            If two robots answer to one name.
        """
        watching = encode(Watching(commander=self.commander, token=token))
        info = self._only_info(self.link.ask_all(self.keys.keep, watching, timeout_s=TRY_S), "watch")
        return None if info is None else info.state

    def _only_info(self, replies: list[bytes], what: str) -> Info | None:
        """Return the info of the only robot that answered; pause both if two robots have one name."""
        infos = {info.boot_id: info for info in (self._decoded(reply, Info, what) for reply in replies)}
        if len(infos) > 1:
            self._pause_duplicates(tuple(infos.values()))
        info = next(iter(infos.values()), None)
        if info is not None:
            self.capabilities, self.lease = info.capabilities, info.lease
            self.lease_left_s = remaining_s(info.lease, info.clock_ns) if info.lease else 0.0
        return info

    def _pause_duplicates(self, infos: tuple[Info, ...]) -> NoReturn:
        """Pause robots of one name: a command could be executed by either."""
        boots = " and ".join(sorted(info.boot_id for info in infos))
        action = "a viewer cannot pause them: inform a station"
        if self.held is None or self.held.holder.role == "station":
            for info in infos:
                pause = RunCommand(
                    cmd_id=uuid.uuid4().hex, verb="pause", commander=self.commander, boot_id=info.boot_id,
                    issued_ns=info.clock_ns, valid_for_s=LONGEST_VALID_S,
                )  # fmt: skip
                self.link.ask_all(self.keys.command("pause"), encode(pause), timeout_s=TRY_S)
            action = "both received a pause"
        raise NegativeResult(
            f"{self.keys.robot}: two robots answer to this name (boots {boots}); {action}. End one of them,"
            " or start it under another --name"
        )

    def status(self) -> StateReport:
        """Request the robot's state, with every stop that is done or skipped."""
        state = self.info().state
        if (state.done_count, state.skipped_count) == (len(state.done), len(state.skipped)):
            return state
        events = self.log(run_id=state.run_id)
        done = tuple(event.stop for event in events if isinstance(event, Scanned | Unconfirmed))
        skipped = tuple(event.stop for event in events if isinstance(event, Skipped))
        outside = state.outside
        if state.outside_count > len(outside):
            outside = tuple(stops_outside(events, self.mission))
        return msgspec.structs.replace(
            state,
            done=done,
            skipped=skipped,
            done_count=len(done),
            skipped_count=len(skipped),
            outside=outside,
        )

    def push(
        self,
        mission: Mission,
        *,
        progress: Progress = lambda held, size: None,
        take_over: bool = False,
    ) -> Accepted:
        """Transfer a mission, and verify that the robot stored it; only missing chunks are sent.

        Raises
        ------
        NegativeResult
            If the robot rejects it; the robot keeps its former mission.
        OutcomeUnknown
            If the robot stopped answering; another push continues where this one ended.
        """
        self._check_role("push")
        # A file may have 0 for 0.0, and the digest of that; the robot computes the digest of the numbers.
        mission = with_digest(mission)
        document = msgspec.json.encode(mission)
        manifest = Manifest(
            mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
            sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
        )  # fmt: skip
        accepted = self._transferred(manifest, document, progress, take_over=take_over)
        self._read_back(manifest)
        return accepted

    def _transferred(
        self, manifest: Manifest, document: bytes, progress: Progress, *, take_over: bool
    ) -> Accepted:
        """Send and commit the chunks, from the beginning again if another push has ended the transfer."""
        for _ in range(BEGINNINGS):
            began = time.monotonic()
            ready = self._step(manifest, "begin", encode(manifest), Ready)
            window = Window(time.monotonic() - began)
            try:
                self._send_chunks(manifest, document, set(ready.held), window, progress)
                return self._commit(manifest, take_over=take_over)
            except NegativeResult as no:
                if no.reason != "incomplete":
                    raise
                rejection = no
        raise NegativeResult(
            f"{rejection}. The transfer was begun {BEGINNINGS} times: another station may be pushing too;"
            " push again when it has finished",
            reason="incomplete",
        )

    def _commit(self, manifest: Manifest, *, take_over: bool) -> Accepted:
        """Commit the chunks that were sent; with a new commit if the robot was restarted meanwhile."""
        for tries_left in reversed(range(COMMITS)):
            info = self.info(within_s=self.patience_s)
            commit = Commit(
                manifest=manifest, commander=self.commander, take_over=take_over, nonce=uuid.uuid4().hex,
                # A commit that was not accepted until this station gives up expires.
                not_after_ns=info.clock_ns + round(self._commit_s(manifest) * 1e9),
                boot_id=info.boot_id, fence=info.lease.fence if info.lease else None,
            )  # fmt: skip
            try:
                return self._step(manifest, "commit", encode(commit), Accepted)
            except NegativeResult as no:
                if no.reason != "expired" or not tries_left:
                    raise
        raise AssertionError

    def _commit_s(self, manifest: Manifest) -> float:
        """Return the timeout of a commit: the robot reads and stores a large document before it answers."""
        return self.patience_s + 2 * manifest.size / COMMIT_BYTES_PER_S

    def _send_chunks(
        self, manifest: Manifest, document: bytes, held: set[int], window: Window, progress: Progress
    ) -> None:
        def send(number: int) -> None:
            data = document[number * manifest.chunk_bytes : (number + 1) * manifest.chunk_bytes]
            stored = self._step(manifest, f"chunk/{number}", data, ChunkHeld, of=manifest.sha256)
            if stored.sha256 != hashlib.sha256(data).hexdigest():
                raise NegativeResult(f"{self.keys.robot}: chunk {number} arrived damaged; push again")

        missing = [number for number in range(manifest.chunks) if number not in held]
        progress(min(manifest.size, len(held) * manifest.chunk_bytes), manifest.size)
        for sent, _ in enumerate(windowed(missing, send, window), start=len(held) + 1):
            progress(min(manifest.size, sent * manifest.chunk_bytes), manifest.size)

    def _read_back(self, manifest: Manifest) -> None:
        """Verify that the robot reports the mission, and stored the manifest that was sent."""
        state = self.info(within_s=self.patience_s).state
        # The part after the last contains only the manifest, which is fast on a slow link too.
        stored = self._part(manifest.mission_id, manifest.revision, manifest.chunks).manifest
        reported = state.mission_id == manifest.mission_id and manifest.revision in (
            state.revision, state.next_revision,
        )  # fmt: skip
        if not reported or stored.digest != manifest.digest:
            raise OutcomeUnknown(
                f"{self.keys.robot} accepted the mission, but reports mission {state.mission_id}"
                f" revision {state.revision}; has somebody else pushed meanwhile?"
            )

    def mission(self, mission_id: str, revision: int) -> Mission:
        """Read a mission that is stored on the robot."""
        began = time.monotonic()
        first = self._part(mission_id, revision, 0)
        window = Window(time.monotonic() - began)
        rest = range(1, -(-first.manifest.size // max(1, len(first.data))))
        fetched = windowed(rest, lambda number: self._part(mission_id, revision, number), window)
        parts = (first.data, *(part.data for _, part in fetched))
        return parse(b"".join(parts), f"mission {mission_id} on {self.keys.robot}")

    def command(self, verb: Verb, **details: Any) -> Answer:
        """Send a command, which takes effect once, and return the answer; `details` are its fields.

        Raises
        ------
        NegativeResult
            If the robot refuses.
        OutcomeUnknown
            If no answer came: the robot may or may not have executed the command.
        RobotUnreachable
            If no state was received: the command was not sent.
        """
        self._check_role(verb)
        if verb in FREE_VERBS:
            return self.give(self.stop_order(verb, **details))
        deadline = time.monotonic() + self.timeout_s
        try:
            order = self.order(verb, **details)
        except OutcomeUnknown as error:
            raise RobotUnreachable(f"{error}; {verb} was not sent") from None
        within_s = max(LEAST_S, deadline - time.monotonic())
        if "valid_for_s" not in details:
            # The robot's clock was read before now: when this station gives up, the command has expired.
            order = msgspec.structs.replace(order, valid_for_s=min(within_s, LONGEST_VALID_S))
        return self.give(order, within_s=within_s)

    @contextmanager
    def hearing(self, heard: Callable[[], None]) -> Iterator[None]:
        """Call `heard` when the robot shows that it got a stop; here its answer alone shows that."""
        yield

    def _check_role(self, what: str) -> None:
        """Refuse a viewer's command here; the robot would not answer it."""
        if self.held is not None and self.held.holder.role != "station":
            holder = self.held.holder
            raise NegativeResult(f"{what}: {holder.name} is a {holder.role}; only stations may send commands")

    def give(self, order: RunCommand, *, within_s: float | None = None) -> Answer:
        """Send a command that was made before; sent twice, it still takes effect once."""
        within_s = self.timeout_s if within_s is None else within_s
        key, payload = self.keys.command(order.verb), encode(order)
        direct = None
        if self.direct is not None and order.verb in FREE_VERBS:
            direct = self.direct(key, payload, timeout_s=within_s)
        reply = self._ask_repeatedly(key, payload, within_s, beside=direct)
        if reply is None and self._not_found is not None and not self._may_be_sent(direct):
            raise self._not_found()
        if reply is None and order.verb not in FREE_VERBS and within_s >= order.valid_for_s:
            raise OutcomeUnknown(
                f"{self.keys.robot}: no answer to {order.verb} in time, its outcome is unknown;"
                f" see stopgo status. It has expired, and has no effect later{self._distrusted()}"
            )
        if reply is None:
            raise self._unanswered(order.verb, self.stop_remedy if order.verb in FREE_VERBS else "")
        answer = read_answer(reply, order, robot=self.keys.robot)
        if answer.outcome == "refused":
            why = f"{answer.reason}: {answer.message}"
            raise NegativeResult(f"{self.keys.robot} refused {order.verb}: {why}", reason=answer.reason)
        return answer

    def _may_be_sent(self, direct: DirectQuestion | None) -> bool:
        """True if a command that was not answered may have left for the robot."""
        return self._seen.is_set() or self.link.may_be_sent or (direct is not None and direct.may_be_sent)

    def stop_order(self, verb: Verb, **details: Any) -> RunCommand:
        """Make a pause or an abort: a few hundred bytes, without an earlier query of the robot."""
        given = {key: value for key, value in details.items() if value is not None}
        plain: dict[str, Any] = {
            "cmd_id": uuid.uuid4().hex,
            "commander": self.commander,
            "issued_ns": 0,
            "valid_for_s": LONGEST_VALID_S,
        }
        return RunCommand(verb=verb, **(plain | given))

    def order(self, verb: Verb, *, shown: ShownStop | None = None, **details: Any) -> RunCommand:
        """Make a command for the robot's present state: a late command meets another state and is refused.

        A skip that names no stop is meant for the one that was `shown` of this run, else the present one.
        """
        info = self.info()
        state = info.state
        stop = shown.stop if shown is not None and shown.run_id == state.run_id else state.stop
        expected: dict[str, Any] = {
            "commander": self.commander,
            "valid_for_s": min(self.timeout_s, LONGEST_VALID_S),
            "run_id": None if verb == "start" else state.run_id,
            "mission_id": state.mission_id,
            "revision": state.revision,
            "expect_state": (state.state,),
            "boot_id": info.boot_id,
            "fence": info.lease.fence if info.lease else None,
            "stop": stop if verb in ("skip", "retry") else None,
        }
        given = {key: value for key, value in details.items() if value is not None}
        order = RunCommand(cmd_id=uuid.uuid4().hex, verb=verb, issued_ns=info.clock_ns, **(expected | given))
        self.meant_stop = order.stop
        return order

    def log(self, *, since: int = 0, run_id: str | None = None) -> tuple[AnyEvent, ...]:
        """Read all events of the journal above number `since`, of one run if given."""
        events: list[AnyEvent] = []
        while True:
            page = follow.log_page(self.link, self.keys, since=since, run_id=run_id, timeout_s=self.timeout_s)
            if page is None:
                raise OutcomeUnknown(
                    f"{self.keys.robot}: its journal was not read whole, log is not answered;"
                    " the link is lost or drops log, or access rules deny it"
                )
            events += page.events
            if not page.events:
                return tuple(events)
            since = page.events[-1].number

    def reports(self) -> Iterator[follow.Followed]:
        """Yield states, poses and events of the robot's run, gaps filled, until the run is over.

        If the robot's mission has not been run yet, wait for the next run.
        """
        token = uuid.uuid4().hex[:12]
        self.link.announce(self.keys.watcher(token))
        keep = partial(self.keep, token)
        return follow.reports(self.link, self.keys, keep, lambda: RECORD in self.capabilities)

    def _part(self, mission_id: str, revision: int, number: int) -> MissionPart:
        key = self.keys.mission(mission_id, f"part/{number}")
        reply = self._ask_repeatedly(
            key, b"", self.patience_s, try_s=BULK_TRY_S, bulk=True, revision=str(revision)
        )
        return self._decoded(reply, MissionPart, "reading the mission back")

    def _step(self, manifest: Manifest, step: str, payload: bytes, kind: type[Any], **parameters: str) -> Any:
        key = self.keys.mission(manifest.mission_id, step)
        bulk = step.startswith("chunk")
        try_s, within_s = BULK_TRY_S if bulk else TRY_S, self.patience_s
        if step == "commit":
            try_s, within_s = try_s + manifest.size / COMMIT_BYTES_PER_S, self._commit_s(manifest)
        reply = self._ask_repeatedly(
            key, payload, within_s, try_s=try_s, bulk=bulk, beside=None, **parameters
        )
        return self._decoded(reply, kind, f"push ({step})")

    def _ask_repeatedly(
        self,
        key: str,
        payload: bytes,
        within_s: float,
        *,
        try_s: float = TRY_S,
        bulk: bool = False,
        beside: DirectQuestion | None = None,
        **parameters: str,
    ) -> bytes | None:
        """Repeat a query until it is answered, there or by `beside`, or the time is up."""
        deadline = time.monotonic() + within_s
        while (left := deadline - time.monotonic()) > 0:
            if beside is not None and beside.reply is not None:
                return beside.reply
            wait_s = min(try_s, left)
            reply = self.link.ask(key, payload, timeout_s=wait_s, parameters=parameters, bulk=bulk)
            if reply is not None:
                return reply
            time.sleep(min(PAUSE_S, left))
        return None

    def _distrusted(self) -> str:
        """Return why an answer was not believed to be the robot's; empty if there was none."""
        why = self.link.distrusted
        return f" (an answer came that is not {self.keys.robot}'s: {why})" if why else ""

    def _ask_all(self, key: str, payload: bytes, within_s: float) -> list[bytes]:
        """Repeat a query to all who serve a key expression, until one answers or the time is up."""
        deadline = time.monotonic() + within_s
        while (left := deadline - time.monotonic()) > 0:
            self.asked_at = time.monotonic()
            replies = self.link.ask_all(key, payload, timeout_s=min(TRY_S, left))
            if replies:
                return replies
            time.sleep(min(PAUSE_S, left))
        return []

    def _decoded(self, reply: bytes | None, kind: type[Any], what: str) -> Any:
        """Decode an answer of type `kind`; raise an error for every other, and for a missing one."""
        if reply is None:
            raise self._unanswered(what)
        return read_reply(reply, kind, robot=self.keys.robot, what=what)

    def _unanswered(self, what: str, remedy: str = "") -> OutcomeUnknown:
        return OutcomeUnknown(
            f"{self.keys.robot}: no answer to {what} in time, its outcome is unknown;"
            f" see stopgo status{remedy}{self._distrusted()}"
        )
