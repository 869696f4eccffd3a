"""Intentionally wrong message signatures, to test that the peer refuses them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import msgspec

from stopgo.bridge.link.link import Answering, Hearing
from stopgo.bridge.link.signatures import (
    MessageSigning,
    Question,
    SignatureAttachment,
    SignedAnswering,
    SignedHearing,
)
from stopgo.mission.document.decoding import decoded

Falsifying = Callable[[Question, MessageSigning], Question]
"""Returns a query with an invalid signature, made from a valid one."""


class FalsifiedSigning:
    """Signatures of a holder: those of queries are falsified by `falsify`, and every answer is accepted."""

    def __init__(self, signing: MessageSigning) -> None:
        self._signing = signing
        self.falsify: Falsifying = lambda question, signing: question
        self.distrusted = ""

    def sign_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        return self.falsify(self._signing.sign_question(key, payload, parameters), self._signing)

    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        self._signing.verify_answer(question, payload, attachment)
        self.distrusted = self._signing.distrusted
        return payload

    def sign_answers(self, answer: Answering) -> SignedAnswering:
        return self._signing.sign_answers(answer)

    def sign_publication(self, key: str, payload: bytes) -> bytes:
        return self._signing.sign_publication(key, payload)

    def verify_publications(self, heard: Hearing) -> SignedHearing:
        return self._signing.verify_publications(heard)


def unsigned(question: Question, signing: MessageSigning) -> Question:
    """Remove the signature."""
    return replace(question, attachment=b"")


def flipped(question: Question, signing: MessageSigning) -> Question:
    """Change one bit of the signature."""
    attachment = decoded(question.attachment, SignatureAttachment)
    signature = bytes([attachment.signature[0] ^ 1]) + attachment.signature[1:]
    return replace(
        question, attachment=msgspec.json.encode(msgspec.structs.replace(attachment, signature=signature))
    )


def of_another_key(question: Question, signing: MessageSigning) -> Question:
    """Sign for another key expression."""
    other = signing.sign_question(f"{question.key}x", question.payload, question.parameters)
    return replace(question, attachment=other.attachment)


def of_another_payload(question: Question, signing: MessageSigning) -> Question:
    """Sign another payload."""
    other = signing.sign_question(question.key, question.payload + b" ", question.parameters)
    return replace(question, attachment=other.attachment)


def of_other_parameters(question: Question, signing: MessageSigning) -> Question:
    """Sign other parameters."""
    other = signing.sign_question(question.key, question.payload, {**question.parameters, "since": "7"})
    return replace(question, attachment=other.attachment)


def without_certificate(question: Question, signing: MessageSigning) -> Question:
    """Remove the certificate."""
    attachment = decoded(question.attachment, SignatureAttachment)
    return replace(
        question, attachment=msgspec.json.encode(msgspec.structs.replace(attachment, certificate=None))
    )
