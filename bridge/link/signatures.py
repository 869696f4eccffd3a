"""Signatures of messages between ends that hold keys; each travels as the message's attachment.

An attachment is an Ed25519 signature, and the values that bind it to one use. Nobody between two ends can
change, swap, replay or long delay a message unnoticed. Without keys (`NO_SIGNING`) every message is unsigned
and is accepted: for use on one machine only.

What is signed (`_signed`): a line for the kind of message (`question`, `answer` or `told`), a line for each
thing that it is bound to, four lines with its `nonce`, `boot_id`, `number` and `at_ns`, then the bytes as
they were sent. It is bound to the key that it is sent on, which names the robot; a question to its
parameters too; an answer to the question's parameters and the hash of its payload.

Questions and answers
    The question has a fresh nonce, which its answer repeats. An answer to another question is not accepted.
    Each answer has the robot's boot and the time on its clock. The station stores both (`Anchor`). Into its
    next question it puts that boot, and the time that the robot's clock must show by then. So the robot
    sees if a question is fresh: of this boot, and at most `OLDEST_S` old. A question that is not fresh is
    answered, but counts as no contact and renews no lease; commands and commits have limits of their own.

Publications
    They are numbered by key. A number that is not above the last one is a replay. A robot's numbers begin
    again with each boot, a station's with each session (`nonce`). A station accepts a robot's publications
    only after an answer of the same boot, which brings the certificate and the clock.

Invariants
    1. Who sent a message is known from the certificate, never from what the message says.
    2. A certificate counts only if the holder's own authority issued it, and it is valid and not revoked now.
    3. Two clocks are never compared directly: a station counts on from what the robot's clock showed.
    4. A message that is not accepted has no effect; `distrusted` has the reason of the last one.
    5. `_lock` guards the anchors and both counters while they change. No signature is made or checked
       under it.
"""

from __future__ import annotations

import hashlib
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Protocol

import msgspec

from stopgo.bridge.link.keys import Certificates, HeldKeys, Holder, Untrusted, now_utc
from stopgo.bridge.link.link import Answering, Hearing, Request, Unanswered
from stopgo.bridge.link.protocol import VERSION, decode, encode, place_of, untrusted

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

OLDEST_S: Final = 10.0
"""Greatest age of a message that is accepted. During a push a slow link delays messages by seconds."""
AHEAD_S: Final = 1.0
"""Greatest drift between two clocks before they are compared again."""


class SignatureAttachment(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The attachment of a message, as JSON; unknown fields are ignored."""

    signature: bytes = b""
    certificate: bytes | None = None
    """DER; a robot's publications have none, for its answers bring it."""
    nonce: str = ""
    """Of the question, repeated in its answer; in a station's publications, of its session."""
    boot_id: str = ""
    """The robot's boot; a station adds it once it knows it."""
    number: int = 0
    """Number of a publication on its key since that boot or session; grows."""
    at_ns: int = 0
    """On a clock of the robot with any origin; a station computes the time that this clock must show."""


@dataclass(frozen=True)
class Question:
    """A question with its signature, and what its answer must match."""

    key: str
    payload: bytes
    parameters: Mapping[str, str]
    attachment: bytes = b""
    nonce: str = ""
    asked_ns: int = 0


SignedAnswering = Callable[[Request], tuple[bytes, bytes]]
"""Returns the answer and its attachment."""
SignedHearing = Callable[[str, bytes, bytes], None]
"""Receives key, payload and attachment."""


class MessageSigning(Protocol):
    """One end's way to sign its messages, and to verify those of the other end."""

    distrusted: str
    """Reason of the last message that was not accepted."""

    def sign_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        """Return the question with its attachment."""

    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        """Return the answer if it is to be accepted, else `None`."""

    def sign_answers(self, answer: Answering) -> SignedAnswering:
        """Return a function that answers verified questions, and refuses all others; it signs its answers."""

    def sign_publication(self, key: str, payload: bytes) -> bytes:
        """Return the attachment of a publication."""

    def verify_publications(self, heard: Hearing) -> SignedHearing:
        """Return a function that passes on verified publications only."""


class NoSigning:
    """No signatures: nothing is signed, everything is accepted."""

    distrusted = ""

    def sign_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        return Question(key, payload, parameters)

    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        return payload

    def sign_answers(self, answer: Answering) -> SignedAnswering:
        return lambda request: (answer(request), b"")

    def sign_publication(self, key: str, payload: bytes) -> bytes:
        return b""

    def verify_publications(self, heard: Hearing) -> SignedHearing:
        return lambda key, payload, attachment: heard(key, payload)


NO_SIGNING: Final = NoSigning()


@dataclass(frozen=True)
class Anchor:
    """A robot's boot from its last answer, and the moment of that answer on both clocks."""

    boot_id: str
    certificate: bytes
    at_ns: int
    asked_ns: int
    """On this end's clock, when the question was sent; the robot read its clock after that."""
    heard_ns: int


class KeySigning:
    """Signs with one holder's keys, and accepts holders whose keys the same authority has issued."""

    def __init__(
        self,
        held: HeldKeys,
        *,
        boot_id: str = "",
        now: Callable[[], datetime] = now_utc,
        clock_ns: Callable[[], int] = time.monotonic_ns,
        refused: Callable[[str, str], None] = lambda key, why: None,
        state: Path | None = None,
    ) -> None:
        """`refused` is called with the key of each question that is not accepted, and the reason.

        The newest list of revoked certificates is stored in the folder `state`.
        """
        self.distrusted = ""
        self._held = held
        self._boot_id = boot_id
        """Boot of the robot at this end; empty at a station."""
        self._clock_ns = clock_ns
        self._refused = refused
        self._certificates = Certificates(held, now, state)
        self._session = secrets.token_hex(8)
        self._lock = threading.Lock()
        self._anchors: dict[str, Anchor] = {}
        self._published: Counter[str] = Counter()
        self._last_received: dict[tuple[str, ...], int] = {}

    # Questions

    def sign_question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        boot_id, at_ns = self._robot_time(key)
        attachment = SignatureAttachment(
            nonce=secrets.token_hex(16), certificate=self._held.der, boot_id=boot_id, at_ns=at_ns
        )
        signed = self._with_signature(attachment, payload, "question", key, _parameters(parameters))
        return Question(key, payload, parameters, signed, attachment.nonce, self._clock_ns())

    def verify_answer(self, question: Question, payload: bytes, attachment: bytes) -> bytes | None:
        try:
            self._check_answer(question, payload, _read(attachment))
        except Untrusted as error:
            self.distrusted = str(error)
            return None
        return payload

    def _check_answer(self, question: Question, payload: bytes, attachment: SignatureAttachment) -> None:
        robot, where = _place(question.key)
        holder, public = self._certificates.holder(attachment.certificate or b"")
        about = (_parameters(question.parameters), _hash(question.payload))
        _verify(public, attachment, payload, "answer", question.key, *about)
        _must_be_robot(holder, robot)
        if attachment.nonce != question.nonce:
            raise Untrusted("it answers another question")
        heard_ns = self._clock_ns()
        with self._lock:
            self._anchors[where] = Anchor(
                attachment.boot_id,
                attachment.certificate or b"",
                attachment.at_ns,
                question.asked_ns,
                heard_ns,
            )

    def _robot_time(self, key: str) -> tuple[str, int]:
        """Return the robot's boot and the least time its clock must show now, if it has answered before."""
        anchor = self._anchors.get(_place(key)[1])
        if anchor is None:
            return "", 0
        return anchor.boot_id, anchor.at_ns + self._clock_ns() - anchor.heard_ns

    # Answers

    def sign_answers(self, answer: Answering) -> SignedAnswering:
        def answered(request: Request) -> tuple[bytes, bytes]:
            nonce = ""
            try:
                attachment = _read(request.attachment)
                nonce = attachment.nonce
                reply = answer(self._verified(request, attachment))
            except Untrusted as error:
                self.distrusted = str(error)
                self._refused(request.key, str(error))
                reply = encode(untrusted(error))
            own = SignatureAttachment(
                certificate=self._held.der, nonce=nonce, boot_id=self._boot_id, at_ns=self._clock_ns()
            )
            about = (_parameters(request.parameters), _hash(request.payload))
            try:
                return reply, self._with_signature(own, reply, "answer", request.key, *about)
            except Untrusted as error:  # parameters with a line break: no signature could be right
                raise Unanswered(str(error)) from None

        return answered

    def _verified(self, request: Request, attachment: SignatureAttachment) -> Request:
        """Return the request with its verified sender, and with `fresh` true if it was asked just now."""
        holder, public = self._certificates.holder(attachment.certificate or b"")
        _verify(public, attachment, request.payload, "question", request.key, _parameters(request.parameters))
        return replace(request, holder=holder, fresh=self._is_fresh(attachment))

    def _is_fresh(self, attachment: SignatureAttachment) -> bool:
        """True if the message was sent in this boot, a moment ago."""
        age_s = (self._clock_ns() - attachment.at_ns) / 1e9
        return attachment.boot_id == self._boot_id and -AHEAD_S <= age_s <= OLDEST_S

    # Publications

    def sign_publication(self, key: str, payload: bytes) -> bytes:
        with self._lock:
            self._published[key] += 1
            number = self._published[key]
        if self._boot_id:
            attachment = SignatureAttachment(boot_id=self._boot_id, number=number, at_ns=self._clock_ns())
        else:
            boot_id, at_ns = self._robot_time(key)
            attachment = SignatureAttachment(
                certificate=self._held.der, nonce=self._session, boot_id=boot_id, number=number, at_ns=at_ns
            )
        return self._with_signature(attachment, payload, "told", key)

    def verify_publications(self, heard: Hearing) -> SignedHearing:
        def passed_on(key: str, payload: bytes, attachment: bytes) -> None:
            try:
                self._check_publication(key, payload, _read(attachment))
            except Untrusted as error:
                self.distrusted = str(error)
                return
            heard(key, payload)

        return passed_on

    def _check_publication(self, key: str, payload: bytes, attachment: SignatureAttachment) -> None:
        check = self._check_station if self._boot_id else self._check_robot
        stream = check(key, payload, attachment)
        with self._lock:
            if attachment.number <= self._last_received.get(stream, 0):
                raise Untrusted("it was received before")
            self._last_received[stream] = attachment.number

    def _check_station(self, key: str, payload: bytes, attachment: SignatureAttachment) -> tuple[str, ...]:
        certificate = attachment.certificate or b""
        holder, public = self._certificates.holder(certificate)
        _verify(public, attachment, payload, "told", key)
        if holder.role != "station":
            raise Untrusted(f"{holder.name} is a {holder.role}; only stations may publish to a robot")
        if not self._is_fresh(attachment):
            raise Untrusted(f"the message of {holder.name} is old, or for another boot")
        return key, attachment.nonce, _hash(certificate)

    def _check_robot(self, key: str, payload: bytes, attachment: SignatureAttachment) -> tuple[str, ...]:
        robot, where = _place(key)
        anchor = self._anchors.get(where)
        if anchor is None or attachment.boot_id != anchor.boot_id:
            raise Untrusted(f"{robot} has not answered since it started")
        holder, public = self._certificates.holder(anchor.certificate)
        _verify(public, attachment, payload, "told", key)
        _must_be_robot(holder, robot)
        sent_ns = anchor.asked_ns + attachment.at_ns - anchor.at_ns
        if self._clock_ns() - sent_ns > OLDEST_S * 1e9:
            raise Untrusted(f"the message of {robot} is older than {OLDEST_S:g} s")
        return key, attachment.boot_id

    def _with_signature(self, attachment: SignatureAttachment, payload: bytes, *about: str) -> bytes:
        signature = self._held.key.sign(_signed(attachment, payload, *about))
        return msgspec.json.encode(msgspec.structs.replace(attachment, signature=signature))


def _signed(attachment: SignatureAttachment, payload: bytes, *about: str) -> bytes:
    """Return the bytes to sign: a line for each thing that the message is bound to, then the message."""
    kind, *rest = about
    lines = (
        f"stopgo/{VERSION} {kind}",
        *rest,
        attachment.nonce,
        attachment.boot_id,
        str(attachment.number),
        str(attachment.at_ns),
    )
    if any("\n" in line for line in lines):
        raise Untrusted("its key or parameters have several lines")
    return "\n".join(lines).encode(errors="surrogatepass") + b"\n" + payload


def _verify(public: Ed25519PublicKey, attachment: SignatureAttachment, payload: bytes, *about: str) -> None:
    from cryptography.exceptions import InvalidSignature

    try:
        public.verify(attachment.signature, _signed(attachment, payload, *about))
    except InvalidSignature:
        raise Untrusted("the signature is not right") from None


def _read(attachment: bytes) -> SignatureAttachment:
    if not attachment:
        raise Untrusted("it is not signed")
    try:
        read = decode(attachment, SignatureAttachment)
    except msgspec.DecodeError:
        raise Untrusted("its signature cannot be read") from None
    if "\n" in read.nonce or "\n" in read.boot_id:
        raise Untrusted("its nonce or boot has several lines")
    return read


def _place(key: str) -> tuple[str, str]:
    """Return the robot in a key, and its end: the root of its keys, or of its tunnel's."""
    try:
        root, robot, rest = place_of(key)
    except ValueError as error:
        raise Untrusted(str(error)) from None
    return robot, f"{root}/mavlink" if rest.startswith("mavlink/") else root


def _must_be_robot(holder: Holder, robot: str) -> None:
    if (holder.role, holder.name) != ("robot", robot):
        raise Untrusted(f"signed by {holder.role} {holder.name}, not by robot {robot}")


def _parameters(parameters: Mapping[str, str]) -> str:
    return ";".join(f"{name}={value}" for name, value in sorted(parameters.items()))


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
