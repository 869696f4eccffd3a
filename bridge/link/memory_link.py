"""A link in memory: for tests, and between a station and what answers for a vehicle in its own process."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from stopgo.bridge.link.link import Answering, Hearing, Presence, Publish, Request, Unanswered, matches
from stopgo.bridge.link.signatures import NO_SIGNING, MessageSigning, SignedAnswering, SignedHearing


@dataclass(frozen=True)
class SignedMessage:
    """A message as its carrier sees it."""

    kind: Literal["question", "answer", "told"]
    key: str
    payload: bytes
    attachment: bytes
    parameters: Mapping[str, str] = field(default_factory=dict)


class Switchboard:
    """Connects links in memory: publications arrive at once, in the caller's thread."""

    def __init__(self) -> None:
        self.serving: list[tuple[MemoryLink, str, SignedAnswering]] = []
        self.hearing: list[tuple[str, SignedHearing]] = []
        self.watching: list[tuple[str, Presence]] = []
        self.alive: set[str] = set()
        self.cut = False
        """True while no message passes."""
        self.failure: Exception | None = None
        """Error that ended the end that answers; raised in the end that asks."""

    def fail(self, error: Exception) -> None:
        self.failure = error

    def link(self, signing: MessageSigning = NO_SIGNING) -> MemoryLink:
        return MemoryLink(self, signing)

    def carried(self, packet: SignedMessage) -> Iterable[SignedMessage]:
        """Return the messages that arrive: this one, unless the link is cut."""
        return () if self.cut else (packet,)

    def answers(self, question: SignedMessage) -> list[SignedMessage]:
        """Return all answers to a question, as they arrive at the end that asked."""
        if self.failure is not None:
            raise self.failure
        arrived: list[SignedMessage] = []
        for asked in self.carried(question):
            request = Request(asked.key, asked.payload, asked.parameters, asked.attachment)
            for answer in [answer for _, key, answer in self.serving if matches(key, asked.key)]:
                try:
                    payload, attachment = answer(request)
                except Unanswered:
                    continue
                arrived += self.carried(SignedMessage("answer", asked.key, payload, attachment))
        return arrived

    def tell(self, packet: SignedMessage) -> None:
        """Deliver a publication to all subscribers, as it arrives there."""
        for arrived in self.carried(packet):
            for pattern, heard in list(self.hearing):
                if matches(pattern, arrived.key):
                    heard(arrived.key, arrived.payload, arrived.attachment)


class MemoryLink:
    """One end of a switchboard."""

    def __init__(self, board: Switchboard, signing: MessageSigning = NO_SIGNING) -> None:
        self._board = board
        self._signing = signing
        self._announced: list[str] = []
        self.may_be_sent = False

    @property
    def distrusted(self) -> str:
        return self._signing.distrusted

    def serve(self, key: str, answer: Answering) -> None:
        # The end that served a key last answers first.
        self._board.serving.insert(0, (self, key, self._signing.sign_answers(answer)))

    def publisher(self, key: str, *, bulk: bool = False) -> Publish:
        return lambda payload: self._board.tell(
            SignedMessage("told", key, payload, self._signing.sign_publication(key, payload))
        )

    def announce(self, key: str) -> None:
        self._announced.append(key)
        self._board.alive.add(key)
        self._tell_presence(key, True)

    def ask(
        self,
        key: str,
        payload: bytes = b"",
        *,
        timeout_s: float,
        parameters: Mapping[str, str] | None = None,
        bulk: bool = False,
    ) -> bytes | None:
        answers = self._answers(key, payload, parameters or {})
        return answers[0] if answers else None

    def ask_all(self, key: str, payload: bytes = b"", *, timeout_s: float) -> list[bytes]:
        return self._answers(key, payload, {})

    def _answers(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> list[bytes]:
        self.may_be_sent |= any(matches(served, key) for _, served, _ in self._board.serving)
        question = self._signing.sign_question(key, payload, parameters)
        arrived = self._board.answers(
            SignedMessage("question", key, payload, question.attachment, parameters)
        )
        opened = (
            self._signing.verify_answer(question, packet.payload, packet.attachment) for packet in arrived
        )
        return [payload for payload in opened if payload is not None]

    def hear(self, key: str, heard: Hearing) -> None:
        self._board.hearing.append((key, self._signing.verify_publications(heard)))

    def watch_presence(self, key: str, changed: Presence) -> None:
        for alive in sorted(self._board.alive):
            if matches(key, alive):
                changed(alive, True)
        self._board.watching.append((key, changed))

    def close(self) -> None:
        self._board.serving = [served for served in self._board.serving if served[0] is not self]
        for key in self._announced:
            self._board.alive.discard(key)
            self._tell_presence(key, False)

    def _tell_presence(self, key: str, alive: bool) -> None:
        for pattern, changed in list(self._board.watching):
            if matches(pattern, key):
                changed(key, alive)
