"""A robot that a station under test believes to command; what that station is to do is told by `do`."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec

from stopgo.bridge.conform.fake_robot import (
    FakeRobot,
    ForgedAnswers,
    Meddling,
    Withholding,
    everything,
    plainly,
)
from stopgo.bridge.conform.requirements import Nonconforming, NotTried, must
from stopgo.bridge.conform.trial_mission import trial_mission
from stopgo.bridge.link.link import Answering, Request
from stopgo.bridge.link.protocol import CHUNK_BYTES, Commit, Manifest, count_of, decode, encode
from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.orders import Answer, Order, Verb

Doing = Callable[[str, Mission | None], int | None]
"""Lets the station do something (`push` with a mission, `start`, `watch`); its exit code, if it has one."""
DONE, NO, UNKNOWN = 0, 1, 3
LONG_SCAN_S = 3_600.0

M = TypeVar("M")


class StationBench:
    """One station under test."""

    def __init__(self, robot: FakeRobot, do: Doing, *, forged: ForgedAnswers | None = None) -> None:
        self.robot = robot
        self.link = robot.link
        self.forged = forged
        self._do = do
        self._revision = 0
        self._mission_id = f"conform-{uuid.uuid4().hex[:12]}"
        self.commander = "stopgo-conform"

    # Letting the station do something

    def does(self, what: str, mission: Mission | None = None) -> int | None:
        """Let the station do something; what it asks is noted from now on."""
        self.link.asked.clear()
        code = self._do(what, mission)
        if not self.link.asked:
            told = "" if code is None else f" (exit code {code})"
            raise NotTried(f"the station was to {what} and asked nothing{told}; does it find the robot?")
        return code

    @contextmanager
    def meddling(self, meddle: Meddling = plainly, withhold: Withholding = everything) -> Iterator[None]:
        self.link.meddle, self.link.withhold = meddle, withhold
        try:
            yield
        finally:
            self.link.meddle, self.link.withhold = plainly, everything

    @contextmanager
    def forging(self, part: str) -> Iterator[None]:
        """Answers on keys with this in them are sealed wrongly."""
        if self.forged is None:
            raise NotTried("the link has no keys: --keys DIR")
        self.forged.forges = lambda key: part in key
        try:
            yield
        finally:
            self.forged.forges = lambda key: False

    # What it asked

    def asked(self, part: str) -> list[Request]:
        return [asked.request for asked in list(self.link.asked) if asked.tail.startswith(part)]

    def tails(self) -> list[str]:
        return [asked.tail for asked in list(self.link.asked)]

    def orders(self, verb: Verb) -> list[Order]:
        return [_read(request, Order, verb) for request in self.asked(f"cmd/{verb}")]

    def announced(self) -> list[Manifest]:
        return self._steps("begin", Manifest)

    def commits(self) -> list[Commit]:
        return self._steps("commit", Commit)

    def _steps(self, step: str, kind: type[M]) -> list[M]:
        """What was sent for a step of a push, read."""
        sent = (request for request in self.asked("mission/") if request.key.endswith(f"/{step}"))
        return [_read(request, kind, f"a {step}") for request in sent]

    def chunks(self) -> list[int]:
        """Numbers of the chunks that came, in their order."""
        return [self._number(tail.split("/")[-1]) for tail in self.tails() if "/chunk/" in tail]

    def _number(self, told: str) -> int:
        try:
            return count_of(told)
        except ValueError as error:
            raise Nonconforming(f"a chunk's number: {error}") from None

    # The robot's own side

    def mission(self, *, stops: int = 2, scan_s: float = 1.0) -> Mission:
        self._revision += 1
        here = self.robot.controller.position().pose
        return trial_mission(self._mission_id, self._revision, here, stops=stops, scan_s=scan_s)

    def large(self) -> Mission:
        """A mission of several chunks."""
        return self.mission(stops=3 * CHUNK_BYTES // _bytes_of_a_stop(self.mission()))

    def ready(self, *, scan_s: float = 1.0) -> Mission:
        """A mission that lies on the robot, and that nobody commands."""
        self.at_rest()
        mission = self.mission(scan_s=scan_s)
        document = msgspec.json.encode(mission)
        manifest = Manifest(
            mission_id=mission.id, revision=mission.revision, digest=mission.digest, size=len(document),
            sha256=hashlib.sha256(document).hexdigest(), chunk_bytes=CHUNK_BYTES,
        )  # fmt: skip
        journal, controller = self.robot.journal, self.robot.controller
        journal.missions.begin_transfer(manifest)
        for number in range(manifest.chunks):
            piece = document[number * CHUNK_BYTES : (number + 1) * CHUNK_BYTES]
            journal.missions.store_chunk(manifest, number, piece)
        commit = Commit(
            manifest=manifest, commander=self.commander, nonce=uuid.uuid4().hex, take_over=True,
            not_after_ns=self.robot.wall.now_ns() + 10**10,
        )  # fmt: skip
        rejected = controller.take(commit, mission)
        assert rejected is None, rejected
        self.free_lease()
        return mission

    def info(self) -> dict[str, Any]:
        """What the robot would tell of itself."""
        key = self.robot.keys.info
        info: dict[str, Any] = msgspec.json.decode(self.link.served[key](Request(key, b"")))
        return info

    def long_run(self) -> None:
        """A run that nobody need hurry for: each of its scans takes an hour."""
        self.ready(scan_s=LONG_SCAN_S)
        self.gives("start")

    def free_lease(self) -> None:
        """Let the lease of whoever holds it be over."""
        lease = self.robot.controller.lease
        if lease is not None:
            self.robot.journal.store_fact("lease", msgspec.structs.replace(lease, until_ns=0))

    def leased_to(self, commander: str) -> None:
        lease = self.robot.controller.lease
        assert lease is not None
        until_ns = self.robot.wall.now_ns() + 60 * 10**9
        held = msgspec.structs.replace(
            lease, commander=commander, fence=lease.fence + 1, until_ns=until_ns
        )  # fmt: skip
        self.robot.journal.store_fact("lease", held)

    def gives(self, verb: Verb) -> Answer:
        """An order that does not come from the station under test."""
        order = Order(
            cmd_id=uuid.uuid4().hex, verb=verb, commander=self.commander, valid_for_s=5.0, take_over=True,
            issued_ns=self.robot.wall.now_ns(),
        )  # fmt: skip
        answer = self.robot.controller.execute(order)
        assert answer.outcome == "ok", answer
        return answer

    def at_rest(self) -> None:
        if not self.robot.controller.run.over:
            self.gives("abort")

    def check_in(self, *, may_drive: bool) -> None:
        self.at_rest()
        self.link.meddle, self.link.withhold = plainly, everything
        self.free_lease()


def _bytes_of_a_stop(mission: Mission) -> int:
    stop: Stop = mission.stops[0]
    return len(msgspec.json.encode(stop))


def _read(request: Request, kind: type[M], what: str) -> M:
    try:
        return decode(request.payload, kind)
    except msgspec.DecodeError as error:
        raise Nonconforming(f"{what} cannot be read ({error})") from None


def changed_answer(answer: Answering, **changes: Any) -> Answering:
    """The same answer with fields that are otherwise, or that are more."""

    def answered(request: Request) -> bytes:
        return encode({**msgspec.json.decode(answer(request)), **changes})

    return answered


def tells(code: int | None, wanted: int, otherwise: str) -> None:
    """Raise `Nonconforming` if the station has an exit code and it is another."""
    must(code is None or code == wanted, f"{otherwise} (exit code {code}, not {wanted})")
