"""Simulated robot whose answers and publications have faults on request."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import msgspec

from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.link.link import Answering, Hearing, Link, Presence, Publish, Request, Unanswered
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.signatures import (
    MessageSigning,
    Question,
    SignatureAttachment,
    SignedAnswering,
    SignedHearing,
)
from stopgo.bridge.robot.agent import Agent, on_link
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.robot_hardware import pose_of
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner
from stopgo.mission.document import Mission
from stopgo.mission.document.decoding import decoded

AnswerFault = Callable[[Request, Answering], bytes]
"""Returns the answer to a query in place of the robot; may raise `Unanswered`."""
PublishFault = Callable[[str, bytes], bytes | None]
"""Returns the payload to publish instead of a payload on a key expression; `None` publishes nothing."""


def plainly(request: Request, answer: Answering) -> bytes:
    """Answer without a fault."""
    return answer(request)


def everything(key: str, payload: bytes) -> bytes | None:
    """Publish without a fault."""
    return payload


@dataclass(frozen=True)
class ReceivedQuery:
    """Query as it was received, with the part of its key expression after the robot's name."""

    tail: str
    request: Request


class FaultyLink:
    """Link of a robot that records queries, and puts faults into answers and publications."""

    def __init__(self, link: Link, keys: KeyExpressions) -> None:
        self._link = link
        self._keys = keys
        self._lock = threading.Lock()
        self.answer_fault: AnswerFault = plainly
        self.publish_fault: PublishFault = everything
        self.asked: list[ReceivedQuery] = []
        self.watchers: set[str] = set()
        self.served: dict[str, Answering] = {}
        """Answers without faults, by key expression."""

    @property
    def distrusted(self) -> str:
        return self._link.distrusted

    @property
    def may_be_sent(self) -> bool:
        return self._link.may_be_sent

    def serve(self, key: str, answer: Answering) -> None:
        def answered(request: Request) -> bytes:
            with self._lock:
                self.asked.append(ReceivedQuery(request.key.removeprefix(f"{self._keys.root}/"), request))
            return self.answer_fault(request, answer)

        self.served[key] = answer
        self._link.serve(key, answered)

    def serve_beside(self, key: str, answer: Answering) -> None:
        """Serve a key expression as a second robot of the same name."""
        self._link.serve(key, answer)

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        publish = self._link.publisher(key, bulk=bulk)

        def published(payload: bytes) -> None:
            changed = self.publish_fault(key, payload)
            if changed is not None:
                publish(changed)

        return published

    def announce(self, key: str) -> None:
        self._link.announce(key)

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        return self._link.ask(key, payload, timeout_s=timeout_s, parameters=parameters, bulk=bulk)

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        return self._link.ask_all(key, payload, timeout_s=timeout_s)

    def hear(self, key: str, heard: Hearing) -> None:
        self._link.hear(key, heard)

    def watch_presence(self, key: str, changed: Presence) -> None:
        def noted(token: str, alive: bool) -> None:
            if alive and "/watch/" in token:
                self.watchers.add(token)
            changed(token, alive)

        self._link.watch_presence(key, noted)

    def close(self) -> None:
        self._link.close()


class ForgedAnswers:
    """Message signatures of a robot; those of answers on keys for which `forges` is true are wrong."""

    def __init__(self, signing: MessageSigning) -> None:
        self._signing = signing
        self.distrusted = ""
        self.forges: Callable[[str], bool] = lambda key: False

    def sign_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        return self._signing.sign_question(key, payload, parameters)

    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        return self._signing.verify_answer(question, payload, attachment)

    def sign_answers(self, answer: Answering) -> SignedAnswering:
        signed = self._signing.sign_answers(answer)

        def answered(request: Request) -> tuple[bytes, bytes]:
            reply, attachment = signed(request)
            return (reply, _falsified(attachment)) if self.forges(request.key) else (reply, attachment)

        return answered

    def sign_publication(self, key: str, payload: bytes) -> bytes:
        return self._signing.sign_publication(key, payload)

    def verify_publications(self, heard: Hearing) -> SignedHearing:
        return self._signing.verify_publications(heard)


def _falsified(attachment: bytes) -> bytes:
    valid = decoded(attachment, SignatureAttachment)
    signature = bytes([valid.signature[0] ^ 1]) + valid.signature[1:]
    return msgspec.json.encode(msgspec.structs.replace(valid, signature=signature))


class FakeRobot:
    """Simulated robot in this process; it drives nothing."""

    def __init__(self, link: FaultyLink, keys: KeyExpressions, boot_id: str, *, speed_up: float) -> None:
        self.link = link
        self.keys = keys
        self.journal = memory_journal()
        self.wall = WallClock()
        clock = WallClock(speed_up=speed_up)
        base, scanner = SimulatedBase(clock=clock), SimulatedScanner(clock=clock)
        self.controller = Controller(
            robot=keys.robot, journal=self.journal, base=base, scanner=scanner, clock=clock,
            command_clock=self.wall, boot_id=boot_id,
            mission_taken=lambda mission: base.stand_at_start(pose_of(mission.start)),
        )  # fmt: skip
        self.agent = Agent(
            keys=keys, link=link, journal=self.journal, runner=self.controller, clock=clock,
            command_clock=self.wall, inbox=Inbox(self.journal, self.controller, scanner.profiles),
            speed_up=speed_up,
        )  # fmt: skip

    def holds(self, mission: Mission | None) -> bool:
        """Return True if this mission is stored on the robot."""
        run = self.controller.run
        return mission is not None and (run.mission_id, run.revision) == (mission.id, mission.revision)


@contextmanager
def at_work(robot: FakeRobot) -> Iterator[FakeRobot]:
    """Run the robot's agent within the block."""
    with on_link(robot.agent):
        yield robot


def no_answer(request: Request, answer: Answering) -> bytes:
    """Lose the query: the robot does not receive it."""
    raise Unanswered


def lost(request: Request, answer: Answering) -> bytes:
    """Lose the answer: the robot executes the request, and its answer does not arrive."""
    answer(request)
    raise Unanswered
