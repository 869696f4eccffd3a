"""Intentionally wrong message signatures, to test that the peer refuses them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import msgspec

from stopgo.bridge.link.link import Answering, Hearing
from stopgo.bridge.link.seals import Question, Seal, SealedAnswering, SealedHearing, Seals

Falsifying = Callable[[Question, Seals], Question]
"""Returns a query with an invalid signature, made from a valid one."""


class FalsifiedSeals:
    """Signatures of a holder: those of queries are falsified by `falsify`, and every answer is accepted."""

    def __init__(self, seals: Seals) -> None:
        self._seals = seals
        self.falsify: Falsifying = lambda question, seals: question
        self.distrusted = ""

    def seal_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        return self.falsify(self._seals.seal_question(key, payload, parameters), self._seals)

    def verify_answer(self, question: Question, payload: bytes, seal: bytes) -> bytes | None:
        self._seals.verify_answer(question, payload, seal)
        self.distrusted = self._seals.distrusted
        return payload

    def seal_answers(self, answer: Answering) -> SealedAnswering:
        return self._seals.seal_answers(answer)

    def seal_publication(self, key: str, payload: bytes) -> bytes:
        return self._seals.seal_publication(key, payload)

    def verify_publications(self, heard: Hearing) -> SealedHearing:
        return self._seals.verify_publications(heard)


def unsigned(question: Question, seals: Seals) -> Question:
    """Remove the signature."""
    return replace(question, seal=b"")


def flipped(question: Question, seals: Seals) -> Question:
    """Change one bit of the signature."""
    seal = msgspec.json.decode(question.seal, type=Seal)
    signature = bytes([seal.signature[0] ^ 1]) + seal.signature[1:]
    return replace(question, seal=msgspec.json.encode(msgspec.structs.replace(seal, signature=signature)))


def of_another_key(question: Question, seals: Seals) -> Question:
    """Sign for another key expression."""
    other = seals.seal_question(f"{question.key}x", question.payload, question.parameters)
    return replace(question, seal=other.seal)


def of_another_payload(question: Question, seals: Seals) -> Question:
    """Sign another payload."""
    other = seals.seal_question(question.key, question.payload + b" ", question.parameters)
    return replace(question, seal=other.seal)


def of_other_parameters(question: Question, seals: Seals) -> Question:
    """Sign other parameters."""
    other = seals.seal_question(question.key, question.payload, {**question.parameters, "since": "7"})
    return replace(question, seal=other.seal)


def without_certificate(question: Question, seals: Seals) -> Question:
    """Remove the certificate."""
    seal = msgspec.json.decode(question.seal, type=Seal)
    return replace(question, seal=msgspec.json.encode(msgspec.structs.replace(seal, certificate=None)))
