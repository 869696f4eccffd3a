"""This end of the link: pushes a mission, gives orders, asks for the state, and follows a run.

Every request may be sent again with the same effect, so it is, until it is answered or the time is up;
an answer that never came is reported as unknown, never as failed.
"""

from __future__ import annotations

import getpass
import hashlib
import socket
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import msgspec

from stopgo.bridge.console import Progress
from stopgo.bridge.link.capabilities import RECORD
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
from stopgo.bridge.station.robot_replies import read_reply
from stopgo.bridge.station.window import Window, windowed
from stopgo.mission.document import Mission, sealed
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.files.mission_json import parse
from stopgo.mission.run.events import AnyEvent, Scanned, Skipped, StateReport, Unconfirmed
from stopgo.mission.run.orders import FREE_VERBS, LONGEST_VALID_S, Answer, Order, Verb
from stopgo.mission.run.tolerance import stops_outside

TRY_S = 1.0
"""How long one try waits for its answer."""
BULK_TRY_S = 6.0
"""The same for pieces of a document: asked again too early, they would fill a slow line with copies."""
COMMIT_BYTES_PER_S = 1e6
"""How fast, at least, a robot reads and stores a document."""
LEAST_S = 0.5
"""Left for an order itself when finding the robot took nearly all its time."""
PAUSE_S = 0.05
"""Between tries: a query just after a reconnect may come back empty at once."""
COMMITS = 3
"""How often a commit is written, if the robot is started anew each time."""
PATIENCE_S = 20.0
"""How long a push goes on without an answer: on a line that loses much, the link may be opened anew."""


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
) -> Iterator[Station]:
    """A robot that has been reached at `endpoint`, such as `tcp/127.0.0.1:7447`.

    With `keys`, a folder made by `stopgo keys`, the commander is the one they were issued to.

    Raises
    ------
    RobotUnreachable
        If the robot did not show itself within `timeout_s`; nothing was sent.
    """
    from stopgo.bridge.link.zenoh_link import Guard, connecting

    held = None if keys is None else read_keys(keys, now=now_utc())
    who = commander or (held.holder.name if held else whoami())
    if held and who != held.holder.name:
        raise InputError(f"--as {who}: the keys in {keys} are those of {held.holder.name}")
    with connecting(endpoint, Guard(held, insecure), open_s=timeout_s) as link:
        station = Station(
            link,
            KeyExpressions(robot, site),
            commander=who,
            timeout_s=timeout_s,
            patience_s=patience_s,
            held=held,
        )
        station.reach(endpoint, why=lambda: why_no_link(endpoint, held))
        yield station


def whoami() -> str:
    """Who gives orders, unless said otherwise: user@host."""
    return f"{getpass.getuser()}@{socket.gethostname()}"


class Station:
    """One robot, seen from here."""

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
        """What the robot said last that it can."""
        self.keys = keys
        self.commander = commander
        self.timeout_s = timeout_s
        """For a question or an order."""
        self.patience_s = max(patience_s, timeout_s)
        """For each piece of a mission."""

    def reach(self, endpoint: str, *, why: Callable[[], str] = lambda: "") -> None:
        """Wait until the robot shows itself: a question sent before comes back empty at once.

        `why` tells what is wrong with the line, if that can be found out.
        """
        seen = threading.Event()
        self.link.watch_presence(self.keys.alive, lambda key, alive: seen.set() if alive else None)
        if not seen.wait(self.timeout_s):
            who = "no robot showed" if self.keys.every else f"robot {self.keys.robot} did not show"
            reason = why() or "is it running, under this name and site?"
            raise RobotUnreachable(
                f"{endpoint}: {who} itself within {self.timeout_s:g} s"
                f" (key {self.keys.alive}); nothing was sent: {reason}"
            )

    def info(self, *, within_s: float | None = None) -> Info:
        """What the robot says of itself."""
        within_s = self.timeout_s if within_s is None else within_s
        info = self._one_of(self._insist_all(self.keys.info, b"", within_s), "info")
        if info is None:
            raise OutcomeUnknown(
                f"{self.keys.robot} did not tell its state within {within_s:.1f} s{self._distrusted()}"
            )
        if info.protocol != VERSION:
            raise InputError(
                f"robot {info.robot} speaks protocol {info.protocol}, this stopgo {VERSION}; update the older"
            )
        return info

    def keep(self) -> StateReport | None:
        """Tell the robot that somebody watches, which keeps the lease if it is this station's; its state.

        Raises
        ------
        AnswerIsNo
            If two robots answer to its name.
        """
        watching = encode(Watching(commander=self.commander))
        info = self._one_of(self.link.ask_all(self.keys.keep, watching, timeout_s=TRY_S), "watch")
        return None if info is None else info.state

    def _one_of(self, replies: list[bytes], what: str) -> Info | None:
        """What the robot says, if it is one; two of one name are both stopped."""
        infos = {info.boot_id: info for info in (self._answered(reply, Info, what) for reply in replies)}
        if len(infos) > 1:
            self._stop_twins(tuple(infos.values()))
        info = next(iter(infos.values()), None)
        if info is not None:
            self.capabilities = info.capabilities
        return info

    def _stop_twins(self, infos: tuple[Info, ...]) -> NoReturn:
        """Let both stand still: an order would be carried out by one or the other."""
        boots = " and ".join(sorted(info.boot_id for info in infos))
        told = "viewers stop nobody: tell a station"
        if self.held is None or self.held.holder.role == "station":
            for info in infos:
                pause = Order(
                    cmd_id=uuid.uuid4().hex, verb="pause", commander=self.commander, boot_id=info.boot_id,
                    issued_ns=info.clock_ns, valid_for_s=LONGEST_VALID_S,
                )  # fmt: skip
                self.link.ask_all(self.keys.command("pause"), encode(pause), timeout_s=TRY_S)
            told = "both were told to pause"
        raise NegativeResult(
            f"two robots answer to the name {self.keys.robot} (boots {boots}); {told}. End one of them,"
            " or start it under another --name"
        )

    def status(self) -> StateReport:
        """The robot's state, with every stop that is done or skipped."""
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
        """Transfer a mission and see it stored on the robot; only what is missing is sent.

        Raises
        ------
        AnswerIsNo
            If the robot rejects it; it holds what it held before.
        OutcomeUnknown
            If the robot stopped answering; pushing again goes on where this ended.
        """
        self._may_order("push")
        # A file may have 0 for 0.0, and the digest of that; the robot reads numbers, and so is told theirs.
        mission = sealed(mission)
        document = msgspec.json.encode(mission)
        manifest = Manifest(
            mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
            sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
        )  # fmt: skip
        began = time.monotonic()
        begun = self._step(manifest, "begin", encode(manifest), Ready)
        window = Window(time.monotonic() - began)
        self._send_chunks(manifest, document, set(begun.held), window, progress)
        accepted = self._commit(manifest, take_over=take_over)
        self._read_back(manifest)
        return accepted

    def _commit(self, manifest: Manifest, *, take_over: bool) -> Accepted:
        """Have what was sent taken; written anew if the robot was started anew meanwhile."""
        for tries_left in reversed(range(COMMITS)):
            info = self.info(within_s=self.patience_s)
            commit = Commit(
                manifest=manifest, commander=self.commander, take_over=take_over, nonce=uuid.uuid4().hex,
                # What has not been taken by the time this station gives up will never be.
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
        """How long a commit is insisted on: the robot reads and stores a large document before it answers."""
        return self.patience_s + 2 * manifest.size / COMMIT_BYTES_PER_S

    def _send_chunks(
        self, manifest: Manifest, document: bytes, held: set[int], window: Window, progress: Progress
    ) -> None:
        def send(number: int) -> None:
            data = document[number * manifest.chunk_bytes : (number + 1) * manifest.chunk_bytes]
            got = self._step(manifest, f"chunk/{number}", data, ChunkHeld, of=manifest.sha256)
            if got.sha256 != hashlib.sha256(data).hexdigest():
                raise NegativeResult(f"chunk {number} arrived damaged at {self.keys.robot}; push again")

        missing = [number for number in range(manifest.chunks) if number not in held]
        progress(min(manifest.size, len(held) * manifest.chunk_bytes), manifest.size)
        for sent, _ in enumerate(windowed(missing, send, window), start=len(held) + 1):
            progress(min(manifest.size, sent * manifest.chunk_bytes), manifest.size)

    def _read_back(self, manifest: Manifest) -> None:
        state = self.info(within_s=self.patience_s).state
        # The piece beyond the last holds nothing but the manifest, which is soon here on a slow line too.
        kept = self._part(manifest.mission_id, manifest.revision, manifest.chunks).manifest
        told = state.mission_id == manifest.mission_id and manifest.revision in (
            state.revision, state.next_revision,
        )  # fmt: skip
        if not told or kept.digest != manifest.digest:
            raise OutcomeUnknown(
                f"{self.keys.robot} accepted the mission, but tells of mission {state.mission_id}"
                f" revision {state.revision}; has somebody else pushed meanwhile?"
            )

    def mission(self, mission_id: str, revision: int) -> Mission:
        """The mission as the robot holds it."""
        began = time.monotonic()
        first = self._part(mission_id, revision, 0)
        window = Window(time.monotonic() - began)
        rest = range(1, -(-first.manifest.size // max(1, len(first.data))))
        fetched = windowed(rest, lambda number: self._part(mission_id, revision, number), window)
        parts = (first.data, *(part.data for _, part in fetched))
        return parse(b"".join(parts), f"mission {mission_id} on {self.keys.robot}")

    def command(self, verb: Verb, **details: Any) -> Answer:
        """Give an order, once, and return the robot's answer; `details` are fields of `Order`.

        Raises
        ------
        AnswerIsNo
            If the robot refuses.
        OutcomeUnknown
            If no answer came: the order may or may not have been carried out.
        RobotUnreachable
            If the robot did not even tell its state: the order was not sent.
        """
        self._may_order(verb)
        if verb in FREE_VERBS:
            return self.give(self.stop_order(verb, **details))
        deadline = time.monotonic() + self.timeout_s
        try:
            order = self.order(verb, **details)
        except OutcomeUnknown as error:
            raise RobotUnreachable(f"{error}; {verb} was not sent") from None
        within_s = max(LEAST_S, deadline - time.monotonic())
        if "valid_for_s" not in details:
            # The robot's clock was read before now: when this station gives up, the order has run out.
            order = msgspec.structs.replace(order, valid_for_s=min(within_s, LONGEST_VALID_S))
        return self.give(order, within_s=within_s)

    def _may_order(self, what: str) -> None:
        """Viewers are told here; the robot would not even answer them."""
        if self.held is not None and self.held.holder.role != "station":
            holder = self.held.holder
            raise NegativeResult(f"{what}: {holder.name} is a {holder.role}, and only stations give orders")

    def give(self, order: Order, *, within_s: float | None = None) -> Answer:
        """Give an order that was written before; given again it is still carried out once."""
        within_s = self.timeout_s if within_s is None else within_s
        reply = self._insist(self.keys.command(order.verb), encode(order), within_s)
        if reply is None and order.verb not in FREE_VERBS and within_s >= order.valid_for_s:
            raise OutcomeUnknown(
                f"{self.keys.robot} did not answer {order.verb} in time: whether it was carried out is"
                f" unknown; see stopgo status. It has expired: later it will not be{self._distrusted()}"
            )
        answer = self._answered(reply, Answer, order.verb)
        if answer.outcome == "refused":
            why = f"{answer.reason}: {answer.message}"
            raise NegativeResult(f"{self.keys.robot} refused {order.verb}: {why}", reason=answer.reason)
        return answer

    def stop_order(self, verb: Verb, **details: Any) -> Order:
        """A pause or an abort: a few hundred bytes that need nothing of what the robot tells."""
        given = {key: value for key, value in details.items() if value is not None}
        plain: dict[str, Any] = {
            "commander": self.commander,
            "issued_ns": 0,
            "valid_for_s": LONGEST_VALID_S,
        }
        return Order(cmd_id=uuid.uuid4().hex, verb=verb, **(plain | given))

    def order(self, verb: Verb, **details: Any) -> Order:
        """An order for the robot as it is just now: late, it meets another state and is refused."""
        info = self.info()
        state = info.state
        meant: dict[str, Any] = {
            "commander": self.commander,
            "valid_for_s": min(self.timeout_s, LONGEST_VALID_S),
            "run_id": None if verb == "start" else state.run_id,
            "mission_id": state.mission_id,
            "revision": state.revision,
            "expect_state": (state.state,),
            "boot_id": info.boot_id,
            "fence": info.lease.fence if info.lease else None,
            "stop": state.stop if verb in ("skip", "retry") else None,
        }
        given = {key: value for key, value in details.items() if value is not None}
        return Order(cmd_id=uuid.uuid4().hex, verb=verb, issued_ns=info.clock_ns, **(meant | given))

    def log(self, *, since: int = 0, run_id: str | None = None) -> tuple[AnyEvent, ...]:
        """All events of the journal above number `since`, of one run if given."""
        told: list[AnyEvent] = []
        while True:
            page = follow.log_page(self.link, self.keys, since=since, run_id=run_id, timeout_s=self.timeout_s)
            if page is None:
                raise OutcomeUnknown(f"{self.keys.robot} stopped answering; its log was not read to the end")
            told += page.events
            if not page.events:
                return tuple(told)
            since = page.events[-1].number

    def reports(self) -> Iterator[follow.Followed]:
        """States, poses and events of the robot's run as they come, gaps filled, until the run is over.

        If the robot's mission has not been run yet, the next run is waited for.
        """
        return follow.reports(self.link, self.keys, self.keep, lambda: RECORD in self.capabilities)

    def _part(self, mission_id: str, revision: int, number: int) -> MissionPart:
        key = self.keys.mission(mission_id, f"part/{number}")
        reply = self._insist(key, b"", self.patience_s, try_s=BULK_TRY_S, bulk=True, revision=str(revision))
        return self._answered(reply, MissionPart, "reading the mission back")

    def _step(self, manifest: Manifest, step: str, payload: bytes, kind: type[Any], **parameters: str) -> Any:
        key = self.keys.mission(manifest.mission_id, step)
        bulk = step.startswith("chunk")
        try_s, within_s = BULK_TRY_S if bulk else TRY_S, self.patience_s
        if step == "commit":
            try_s, within_s = try_s + manifest.size / COMMIT_BYTES_PER_S, self._commit_s(manifest)
        reply = self._insist(key, payload, within_s, try_s=try_s, bulk=bulk, **parameters)
        return self._answered(reply, kind, f"push ({step})")

    def _insist(
        self,
        key: str,
        payload: bytes,
        within_s: float,
        *,
        try_s: float = TRY_S,
        bulk: bool = False,
        **parameters: str,
    ) -> bytes | None:
        """Ask the same thing until it is answered or the time is up."""
        deadline = time.monotonic() + within_s
        while (left := deadline - time.monotonic()) > 0:
            reply = self.link.ask(key, payload, timeout_s=min(try_s, left), parameters=parameters, bulk=bulk)
            if reply is not None:
                return reply
            time.sleep(min(PAUSE_S, left))
        return None

    def _distrusted(self) -> str:
        """Why an answer that came was not taken for the robot's; empty if none came."""
        why = self.link.distrusted
        return f" (an answer came that is not {self.keys.robot}'s: {why})" if why else ""

    def _insist_all(self, key: str, payload: bytes, within_s: float) -> list[bytes]:
        """Ask all who serve a key until somebody has answered or the time is up."""
        deadline = time.monotonic() + within_s
        while (left := deadline - time.monotonic()) > 0:
            replies = self.link.ask_all(key, payload, timeout_s=min(TRY_S, left))
            if replies:
                return replies
            time.sleep(min(PAUSE_S, left))
        return []

    def _answered(self, reply: bytes | None, kind: type[Any], what: str) -> Any:
        """The reply if it is of `kind`; every other, and none, is an error that says what it means."""
        robot = self.keys.robot
        if reply is None:
            raise OutcomeUnknown(
                f"{robot} did not answer {what} in time: whether it was carried out is unknown;"
                f" see stopgo status{self._distrusted()}"
            )
        return read_reply(reply, kind, robot=robot, what=what)
