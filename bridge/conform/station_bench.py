"""Bench of a station under test: a fake robot, and a function that makes the station act."""

from __future__ import annotations

import hashlib
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import msgspec

from stopgo.bridge.conform.fake_robot import (
    AnswerFault,
    FakeRobot,
    ForgedAnswers,
    PublishFault,
    everything,
    plainly,
)
from stopgo.bridge.conform.requirements import Nonconforming, NotTried, must
from stopgo.bridge.conform.trial_mission import trial_mission
from stopgo.bridge.link.link import Answering, Request
from stopgo.bridge.link.protocol import CHUNK_BYTES, Commit, Manifest, count_of, decode, encode
from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.run_commands import Answer, RunCommand, Verb

StationAction = Callable[[str, Mission | None], int | None]
"""Makes the station act (`push` with a mission, `start`, `watch`); returns its exit code, if it has one."""
DONE, NO, UNKNOWN = 0, 1, 3
LONG_SCAN_S = 3_600.0
"""Scan time of a run that does not end during a test."""

M = TypeVar("M")


class StationBench:
    """One station under test."""

    def __init__(self, robot: FakeRobot, do: StationAction, *, forged: ForgedAnswers | None = None) -> None:
        self.robot = robot
        self.link = robot.link
        self.forged = forged
        self._do = do
        self._revision = 0
        self._mission_id = f"conform-{uuid.uuid4().hex[:12]}"
        self.commander = "stopgo-conform"

    # Letting the station do something

    def does(self, what: str, mission: Mission | None = None) -> int | None:
        """Make the station act, and record its queries; return its exit code."""
        self.link.asked.clear()
        code = self._do(what, mission)
        if not self.link.asked:
            ended = "" if code is None else f" (exit code {code})"
            raise NotTried(f"the station was to {what} and sent no query{ended}; does it find the robot?")
        return code

    @contextmanager
    def faults(self, answer: AnswerFault = plainly, publish: PublishFault = everything) -> Iterator[None]:
        """Put faults into answers and publications within the block."""
        self.link.answer_fault, self.link.publish_fault = answer, publish
        try:
            yield
        finally:
            self.link.answer_fault, self.link.publish_fault = plainly, everything

    @contextmanager
    def forging(self, part: str) -> Iterator[None]:
        """Falsify the signatures of answers on keys that contain `part`, within the block."""
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

    def orders(self, verb: Verb) -> list[RunCommand]:
        return [_read(request, RunCommand, verb) for request in self.asked(f"cmd/{verb}")]

    def announced(self) -> list[Manifest]:
        return self._steps("begin", Manifest)

    def commits(self) -> list[Commit]:
        return self._steps("commit", Commit)

    def _steps(self, step: str, kind: type[M]) -> list[M]:
        """Decode the messages of a step of a push."""
        sent = (request for request in self.asked("mission/") if request.key.endswith(f"/{step}"))
        return [_read(request, kind, f"a {step}") for request in sent]

    def chunks(self) -> list[int]:
        """Return the numbers of the chunks in the order in which they came."""
        return [self._number(tail.split("/")[-1]) for tail in self.tails() if "/chunk/" in tail]

    def _number(self, text: str) -> int:
        try:
            return count_of(text)
        except ValueError as error:
            raise Nonconforming(f"a chunk's number: {error}") from None

    # The robot's own side

    def mission(self, *, stops: int = 2, scan_s: float = 1.0) -> Mission:
        self._revision += 1
        here = self.robot.controller.position().pose
        return trial_mission(self._mission_id, self._revision, here, stops=stops, scan_s=scan_s)

    def large(self) -> Mission:
        """Make a mission of several chunks."""
        return self.mission(stops=3 * CHUNK_BYTES // _bytes_of_a_stop(self.mission()))

    def ready(self, *, scan_s: float = 1.0) -> Mission:
        """Store a mission on the robot, in READY and without a lease, and return it."""
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
            data = document[number * CHUNK_BYTES : (number + 1) * CHUNK_BYTES]
            journal.missions.store_chunk(manifest, number, data)
        commit = Commit(
            manifest=manifest, commander=self.commander, nonce=uuid.uuid4().hex, take_over=True,
            not_after_ns=self.robot.wall.now_ns() + 10**10,
        )  # fmt: skip
        rejected = controller.take(commit, mission)
        assert rejected is None, rejected
        self.free_lease()
        return mission

    def info(self) -> dict[str, Any]:
        """Return the robot's info."""
        key = self.robot.keys.info
        info: dict[str, Any] = msgspec.json.decode(self.link.served[key](Request(key, b"")))
        return info

    def long_run(self) -> None:
        """Start a run that does not end during a test: each of its scans takes an hour."""
        self.ready(scan_s=LONG_SCAN_S)
        self.gives("start")

    def free_lease(self) -> None:
        """End the lease of the present commander."""
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
        """Execute a command that does not come from the station under test."""
        order = RunCommand(
            cmd_id=uuid.uuid4().hex, verb=verb, commander=self.commander, valid_for_s=5.0, take_over=True,
            issued_ns=self.robot.wall.now_ns(),
        )  # fmt: skip
        answer = self.robot.controller.execute(order)
        assert answer.outcome == "ok", answer
        return answer

    def at_rest(self) -> None:
        if not self.robot.controller.run.over:
            self.gives("abort")

    def return_to_rest(self, *, may_drive: bool) -> None:
        self.at_rest()
        self.link.answer_fault, self.link.publish_fault = plainly, everything
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
    """Return the answer with changed or additional fields."""

    def answered(request: Request) -> bytes:
        return encode({**msgspec.json.decode(answer(request)), **changes})

    return answered


def must_exit(code: int | None, wanted: int, otherwise: str) -> None:
    """Raise `Nonconforming` if the station has an exit code other than `wanted`."""
    must(code is None or code == wanted, f"{otherwise} (exit code {code}, not {wanted})")
