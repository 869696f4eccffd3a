"""A station that asks a robot under test, and hears what it tells, byte by byte where that matters."""

from __future__ import annotations

import hashlib
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import msgspec

from stopgo.bridge.conform.falsified_seals import FalsifiedSeals
from stopgo.bridge.conform.requirements import Nonconforming, NotTried, PeerNotResponding, must, short
from stopgo.bridge.conform.trial_mission import REACH_M, trial_mission
from stopgo.bridge.link.link import Link
from stopgo.bridge.link.protocol import (
    Accepted,
    ChunkHeld,
    Commit,
    Info,
    KeyExpressions,
    LogPage,
    Malformed,
    Manifest,
    MissionPart,
    Ready,
    Rejected,
    Reply,
    decode,
    encode,
)
from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Pose, PoseReport, StateReport, event_of
from stopgo.mission.run.orders import Answer, Order, Verb

TRY_S: Final = 1.0
LOOK_S: Final = 0.02
"""Between two looks at what has been heard."""
AT_REST_S: Final = 60.0
"""How long a run that was aborted may take to end."""
OVER: Final = ("IDLE", "READY", "FINISHED", "ABORTED")
PIECE_BYTES: Final = 1024
"""The smallest pieces a robot takes: so that a small mission has several."""
MOST_PAGES: Final = 1000
"""Of a robot's log that are read."""

K = TypeVar("K")
V = TypeVar("V")


@dataclass(frozen=True)
class OtherStation:
    """A second identity, to see who may order what."""

    name: str
    link: Link


@dataclass(frozen=True)
class Forger:
    """A link on which questions are sealed wrongly."""

    link: Link
    seals: FalsifiedSeals


class HeardOnLink:
    """What the robot has published since the link was opened, as it came."""

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self.states: list[bytes] = []
        self.events: list[bytes] = []
        self.poses: list[bytes] = []
        link.hear(keys.state, lambda key, payload: self.states.append(payload))
        link.hear(keys.event, lambda key, payload: self.events.append(payload))
        link.hear(keys.pose, lambda key, payload: self.poses.append(payload))


class RobotBench:
    """One robot under test."""

    def __init__(
        self,
        link: Link,
        keys: KeyExpressions,
        *,
        commander: str,
        timeout_s: float = 5.0,
        take_over: bool = False,
        other: OtherStation | None = None,
        forger: Forger | None = None,
        restart: Callable[[], None] | None = None,
    ) -> None:
        self.link = link
        self.keys = keys
        self.commander = commander
        self.timeout_s = timeout_s
        self.other = other
        self.forger = forger
        self.restart = restart
        self.heard = HeardOnLink(link, keys)
        self.mission_id = f"conform-{uuid.uuid4().hex[:12]}"
        self._revision = 0
        self._take_over = take_over

    # Asking

    def ask_raw(self, key: str, payload: bytes = b"", **parameters: str) -> bytes | None:
        """The answer as it came: asked again until there is one or the time is up."""
        deadline = time.monotonic() + self.timeout_s
        while (left := deadline - time.monotonic()) > 0:
            reply = self.link.ask(key, payload, timeout_s=min(TRY_S, left), parameters=parameters)
            if reply is not None:
                return reply
            time.sleep(min(LOOK_S, left))
        return None

    def ask(self, key: str, payload: bytes = b"", **parameters: str) -> Any:
        """The answer, read; raises `Nonconforming` if there is none or it is no message."""
        raw = self.ask_raw(key, payload, **parameters)
        if raw is None:
            why = f" ({self.link.distrusted})" if self.link.distrusted else ""
            raise Nonconforming(f"no answer that can be believed on {self._tail(key)}{why}")
        return read_reply(raw)

    def ask_for(self, kind: type[K], key: str, payload: bytes = b"", **parameters: str) -> K:
        """The answer, which must be of a kind."""
        reply = self.ask(key, payload, **parameters)
        must(isinstance(reply, kind), f"{self._tail(key)} was answered with {told_of(reply)}")
        return reply

    def refuses_to_read(self, key: str, payload: bytes, what: str, **parameters: str) -> None:
        """Raise `Nonconforming` unless the answer is `Malformed`."""
        reply = self.ask(key, payload, **parameters)
        must(
            isinstance(reply, Malformed),
            f"{what} on {self._tail(key)} was answered with {told_of(reply)}, not Malformed",
        )

    def _tail(self, key: str) -> str:
        return key.removeprefix(f"{self.keys.root}/")

    def info(self) -> Info:
        return self.ask_for(Info, self.keys.info)

    def wait(self, seen: Callable[[], V | None], within_s: float, what: str) -> V:
        """What `seen` gives as soon as it gives something."""
        deadline = time.monotonic() + within_s
        while True:
            found = seen()
            if found is not None:
                return found
            must(time.monotonic() < deadline, f"within {within_s:g} s {what}")
            time.sleep(LOOK_S)

    def wait_for_state(self, *states: str, within_s: float = 20.0) -> StateReport:
        """The robot's state once it is one of these."""

        def reached() -> StateReport | None:
            state = self.info().state
            return state if state.state in states else None

        return self.wait(reached, within_s, f"the robot did not become {' or '.join(states)}")

    # Its journal and its place

    def log(self, since: int = 0) -> list[AnyEvent]:
        """All events above a number."""
        events: list[AnyEvent] = []
        for _ in range(MOST_PAGES):
            page = self.ask_for(LogPage, self.keys.log, since=str(since))
            if not page.bodies:
                break
            for body in page.bodies:
                event = read_event(bytes(body))
                must(event.number > since, "the log does not go on behind `since`")
                events.append(event)
                since = event.number
        return events

    def pose(self) -> Pose:
        """Where the robot stands; raises `NotTried` if it does not tell."""

        def newest() -> PoseReport | None:
            return None if not self.heard.poses else read(self.heard.poses[-1], PoseReport, "a pose")

        self.heard.poses.clear()
        try:
            return self.wait(newest, self.timeout_s, "no pose was told").pose
        except Nonconforming as unknown:
            raise NotTried(f"where the robot stands is not known: {unknown}") from None

    # Missions

    def mission(self, *, stops: int = 2, reach_m: float = REACH_M) -> Mission:
        """The next revision of the trial mission, from where the robot stands."""
        self._revision += 1
        profiles = self.info().profiles
        return trial_mission(
            self.mission_id, self._revision, self.pose(), stops=stops, reach_m=reach_m,
            profile=(profiles or ("default",))[0],
        )  # fmt: skip

    def begin(self, manifest: Manifest) -> Any:
        return self.ask(self.keys.mission(manifest.mission_id, "begin"), encode(manifest))

    def send(self, manifest: Manifest, document: bytes, number: int) -> Any:
        size = manifest.chunk_bytes
        return self.chunk(manifest, number, document[number * size : (number + 1) * size])

    def chunk(self, manifest: Manifest, number: int, data: bytes) -> Any:
        key = self.keys.mission(manifest.mission_id, f"chunk/{number}")
        return self.ask(key, data, of=manifest.sha256)

    def commit(self, manifest: Manifest, **details: Any) -> Any:
        """The answer to a commit of what was sent; `details` are fields of it that are meant otherwise."""
        return self.ask(
            self.keys.mission(manifest.mission_id, "commit"), encode(self.commitment(manifest, **details))
        )

    def commitment(self, manifest: Manifest, **details: Any) -> Commit:
        info = self.info()
        meant: dict[str, Any] = {
            "commander": self.commander, "nonce": uuid.uuid4().hex, "take_over": self._take_over,
            "not_after_ns": info.clock_ns + round(self.timeout_s * 2e9), "boot_id": info.boot_id,
            "fence": info.lease.fence if info.lease else None,
        }  # fmt: skip
        return Commit(manifest=manifest, **(meant | details))

    def push(self, mission: Mission, *, document: bytes = b"", **details: Any) -> Any:
        """The last answer to a push of a mission: to the commit, if the pieces were taken."""
        document = document or msgspec.json.encode(mission)
        manifest = manifest_of(mission, document)
        ready = self.begin(manifest)
        if not isinstance(ready, Ready):
            return ready
        for number in sorted(set(range(manifest.chunks)) - set(ready.held)):
            held = self.send(manifest, document, number)
            must(isinstance(held, ChunkHeld), f"chunk {number} was answered with {told_of(held)}")
        return self.commit(manifest, **details)

    def has(self, mission: Mission) -> Mission:
        """The same mission, once the robot holds it."""
        reply = self.push(mission)
        must(isinstance(reply, Accepted), f"a push was answered with {told_of(reply)}")
        return mission

    def stored(self, mission_id: str, revision: int) -> bytes:
        """A mission as the robot holds it, as bytes."""
        document, number = b"", 0
        while number < MOST_PAGES:
            key = self.keys.mission(mission_id, f"part/{number}")
            part = self.ask_for(MissionPart, key, revision=str(revision))
            if not part.data:
                must(
                    len(document) == part.manifest.size, f"{len(document)} of {part.manifest.size} bytes come"
                )
                return document
            document, number = document + part.data, number + 1
        raise Nonconforming("the parts of a mission have no end")

    def held_mission(self) -> bytes | None:
        """The mission that lies on the robot, to be put back."""
        state = self.info().state
        if state.mission_id is None or state.revision is None:
            return None
        return self.stored(state.mission_id, state.revision)

    def put_back(self, document: bytes | None) -> None:
        """Let the mission lie ready that lay there before."""
        if document is not None:
            mission = read(document, Mission, "the mission that the robot held before")
            reply = self.push(mission, document=document)
            must(isinstance(reply, Accepted), f"the mission that was there before: {told_of(reply)}")

    # Orders

    def order(self, verb: Verb, **details: Any) -> Order:
        """An order for the robot as it is; `details` are fields of it that are meant otherwise."""
        info = self.info()
        meant: dict[str, Any] = {
            "cmd_id": uuid.uuid4().hex, "commander": self.commander, "issued_ns": info.clock_ns,
            "valid_for_s": self.timeout_s, "boot_id": info.boot_id,
        }  # fmt: skip
        return Order(verb=verb, **(meant | details))

    def give(self, order: Order) -> Answer:
        return self.ask_for(Answer, self.keys.command(order.verb), encode(order))

    def obeyed(self, verb: Verb, **details: Any) -> Answer:
        """The answer to an order that must be carried out."""
        answer = self.give(self.order(verb, **details))
        must(answer.outcome == "ok", f"{verb} was refused: {answer.reason}: {short(answer.message)}")
        return answer

    def refused(self, order: Order, *reasons: str) -> Answer:
        """The answer to an order that must be refused for one of these reasons."""
        answer = self.give(order)
        must(answer.outcome == "refused", f"{order.verb} was carried out; it had to be refused")
        must(
            answer.reason in reasons,
            f"{order.verb} was refused as {answer.reason}, not as {' or '.join(reasons)}",
        )
        return answer

    # Rest

    def return_to_rest(self, *, may_drive: bool) -> None:
        state = self._state_or_gone()
        if state.state in OVER:
            return
        self.end_run()
        if not may_drive:
            raise Nonconforming(f"the robot was {state.state} although nothing told it to drive; aborted")

    def _state_or_gone(self) -> StateReport:
        try:
            return self.info().state
        except Nonconforming as silent:
            raise PeerNotResponding(f"the robot answers no more: {silent}") from None

    def leave(self) -> None:
        """Abort the run under way, if the robot still answers; `PeerNotResponding` if it does not obey."""
        raw = self.link.ask(self.keys.info, timeout_s=TRY_S)
        if raw is not None and not self._at_rest(raw):
            self.end_run()

    def _at_rest(self, raw: bytes) -> bool:
        try:
            return read(raw, Info, "info").state.state in OVER
        except Nonconforming:
            return False  # who knows

    def end_run(self) -> None:
        """Abort what is under way; raises `PeerNotResponding` if the robot does not obey."""
        try:
            self.give(self.order("abort"))
            self.wait_for_state(*OVER, within_s=AT_REST_S)
        except Nonconforming as wrong:
            raise PeerNotResponding(f"the robot does not obey an abort; stop it by hand: {wrong}") from None


def manifest_of(mission: Mission, document: bytes, **details: Any) -> Manifest:
    """What is announced of a mission that is sent as `document`."""
    meant: dict[str, Any] = {
        "mission_id": mission.id, "revision": mission.revision, "digest": mission.digest,
        "size": len(document), "sha256": hashlib.sha256(document).hexdigest(), "chunk_bytes": PIECE_BYTES,
    }  # fmt: skip
    return Manifest(**(meant | details))


def read_reply(raw: bytes) -> Any:
    """A message of the robot's, whichever it is."""
    return read(raw, Reply, "an answer")


def read(raw: bytes, kind: Any, what: str) -> Any:
    """What was told, read strictly; raises `Nonconforming` where it is not of this kind."""
    with _readable(raw, what):
        return decode(raw, kind)


def read_event(raw: bytes) -> AnyEvent:
    """An event of any kind; raises `Nonconforming` where it is none."""
    with _readable(raw, "an event"):
        return event_of(raw)


@contextmanager
def _readable(raw: bytes, what: str) -> Iterator[None]:
    try:
        yield
    except msgspec.DecodeError as error:
        raise Nonconforming(f"{what} cannot be read ({error}): {short(raw)}") from None


def told_of(reply: Any) -> str:
    """An answer in a few words."""
    if isinstance(reply, Rejected):
        return f"Rejected {reply.reason} ({short('; '.join(reply.messages))})"
    if isinstance(reply, Answer):
        return f"Answer {reply.outcome} {reply.reason or ''}".strip()
    if isinstance(reply, Malformed):
        return f"Malformed ({short(reply.message)})"
    return type(reply).__name__


def rejects(reply: Any, *reasons: str) -> None:
    """Raise `Nonconforming` unless an answer is a rejection for one of these reasons."""
    must(
        isinstance(reply, Rejected) and reply.reason in reasons,
        f"answered with {told_of(reply)}, not Rejected {' or '.join(reasons)}",
    )
