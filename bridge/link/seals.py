"""Who said it, to whom and when: the seal that goes beside every message between ends that hold keys.

A seal is an Ed25519 signature over the bytes as they were sent, with what binds them: the key that they are
sent on, which names the robot; the robot's boot and a number or, in an answer, the question's nonce; and the
time on the speaker's clock. So nobody in between can change, swap, replay or long withhold a message and be
believed. An end without keys seals nothing and believes everything, which is good for one machine only.
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
from stopgo.bridge.link.link import Answering, Hearing, Request
from stopgo.bridge.link.protocol import VERSION, decode, encode, place_of, untrusted

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path

    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

OLDEST_S: Final = 10.0
"""What was said longer ago is not believed: a slow line beside a push holds a message for seconds."""
AHEAD_S: Final = 1.0
"""By so much two clocks may run apart before they are compared anew."""


class Seal(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Goes beside a message, as JSON; fields that are not known are passed over."""

    signature: bytes = b""
    certificate: bytes | None = None
    """DER; a robot leaves it out of what it publishes, for its answers have told it."""
    nonce: str = ""
    """Of the question, also in its answer; of the sender's session in what a station publishes."""
    boot_id: str = ""
    """The robot's boot, also in what a station says to it once it knows."""
    number: int = 0
    """Of what is published on one key since then; grows."""
    at_ns: int = 0
    """On a clock of the robot that counts from anywhere; a station tells the time that must be there."""


@dataclass(frozen=True)
class Question:
    """What is asked, and what its answer must fit."""

    key: str
    payload: bytes
    parameters: Mapping[str, str]
    seal: bytes = b""
    nonce: str = ""
    asked_ns: int = 0


SealedAnswering = Callable[[Request], tuple[bytes, bytes]]
"""Gives the answer and its seal."""
SealedHearing = Callable[[str, bytes, bytes], None]
"""Is given key, payload and seal."""


class Seals(Protocol):
    """How one end of a link seals what it says, and judges what it hears."""

    distrusted: str
    """Why the last message that was not believed was not."""

    def question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question: ...

    def opened(self, question: Question, payload: bytes, seal: bytes) -> bytes | None:
        """The answer if it is to be believed."""

    def answering(self, answer: Answering) -> SealedAnswering:
        """Answers what is to be believed, sealed; refuses everything else."""

    def telling(self, key: str, payload: bytes) -> bytes:
        """The seal of what is published."""

    def hearing(self, heard: Hearing) -> SealedHearing:
        """Hears what is to be believed, and nothing else."""


class NoSeals:
    """Neither seals nor doubts."""

    distrusted = ""

    def question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        return Question(key, payload, parameters)

    def opened(self, question: Question, payload: bytes, seal: bytes) -> bytes | None:
        return payload

    def answering(self, answer: Answering) -> SealedAnswering:
        return lambda request: (answer(request), b"")

    def telling(self, key: str, payload: bytes) -> bytes:
        return b""

    def hearing(self, heard: Hearing) -> SealedHearing:
        return lambda key, payload, seal: heard(key, payload)


NO_SEALS: Final = NoSeals()


@dataclass(frozen=True)
class Anchor:
    """A robot's boot as its last answer told it, and that moment on both clocks."""

    boot_id: str
    certificate: bytes
    at_ns: int
    asked_ns: int
    """Here, when the question was sent; the robot read its clock after that."""
    heard_ns: int


class KeySeals:
    """Seals with one holder's keys; believes those whom the same authority has issued theirs."""

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
        """`refused` is told of questions that are not believed: their key, and why not.

        In the folder `state` the newest list of revoked certificates is kept.
        """
        self.distrusted = ""
        self._held = held
        self._boot_id = boot_id
        """Of a robot that answers here; a station has none."""
        self._clock_ns = clock_ns
        self._refused = refused
        self._certificates = Certificates(held, now, state)
        self._session = secrets.token_hex(8)
        self._lock = threading.Lock()
        self._anchors: dict[str, Anchor] = {}
        self._told: Counter[str] = Counter()
        self._heard: dict[tuple[str, ...], int] = {}

    # Asking

    def question(self, key: str, payload: bytes, parameters: Mapping[str, str]) -> Question:
        boot_id, at_ns = self._there(key)
        seal = Seal(nonce=secrets.token_hex(16), certificate=self._held.der, boot_id=boot_id, at_ns=at_ns)
        sealed = self._sealed(seal, payload, "question", key, _parameters(parameters))
        return Question(key, payload, parameters, sealed, seal.nonce, self._clock_ns())

    def opened(self, question: Question, payload: bytes, seal: bytes) -> bytes | None:
        try:
            self._check_answer(question, payload, _read(seal))
        except Untrusted as error:
            self.distrusted = str(error)
            return None
        return payload

    def _check_answer(self, question: Question, payload: bytes, seal: Seal) -> None:
        robot, where = _place(question.key)
        holder, public = self._certificates.holder(seal.certificate or b"")
        about = (_parameters(question.parameters), _hash(question.payload))
        _verify(public, seal, payload, "answer", question.key, *about)
        _must_be_robot(holder, robot)
        if seal.nonce != question.nonce:
            raise Untrusted("it answers another question")
        heard_ns = self._clock_ns()
        with self._lock:
            self._anchors[where] = Anchor(
                seal.boot_id, seal.certificate or b"", seal.at_ns, question.asked_ns, heard_ns
            )

    def _there(self, key: str) -> tuple[str, int]:
        """The robot's boot and what its clock must at least show by now, if it has answered before."""
        anchor = self._anchors.get(_place(key)[1])
        if anchor is None:
            return "", 0
        return anchor.boot_id, anchor.at_ns + self._clock_ns() - anchor.heard_ns

    # Answering

    def answering(self, answer: Answering) -> SealedAnswering:
        def answered(request: Request) -> tuple[bytes, bytes]:
            nonce = ""
            try:
                seal = _read(request.seal)
                nonce = seal.nonce
                reply = answer(self._believed(request, seal))
            except Untrusted as error:
                self.distrusted = str(error)
                self._refused(request.key, str(error))
                reply = encode(untrusted(error))
            own = Seal(certificate=self._held.der, nonce=nonce, boot_id=self._boot_id, at_ns=self._clock_ns())
            about = (_parameters(request.parameters), _hash(request.payload))
            return reply, self._sealed(own, reply, "answer", request.key, *about)

        return answered

    def _believed(self, request: Request, seal: Seal) -> Request:
        """The request with who asks, if that is certain, and whether it was asked just now."""
        holder, public = self._certificates.holder(seal.certificate or b"")
        _verify(public, seal, request.payload, "question", request.key, _parameters(request.parameters))
        return replace(request, holder=holder, fresh=self._is_fresh(seal))

    def _is_fresh(self, seal: Seal) -> bool:
        """Whether it was said in this boot, a moment ago."""
        age_s = (self._clock_ns() - seal.at_ns) / 1e9
        return seal.boot_id == self._boot_id and -AHEAD_S <= age_s <= OLDEST_S

    # Publishing and hearing

    def telling(self, key: str, payload: bytes) -> bytes:
        with self._lock:
            self._told[key] += 1
            number = self._told[key]
        if self._boot_id:
            seal = Seal(boot_id=self._boot_id, number=number, at_ns=self._clock_ns())
        else:
            boot_id, at_ns = self._there(key)
            seal = Seal(
                certificate=self._held.der, nonce=self._session, boot_id=boot_id, number=number, at_ns=at_ns
            )
        return self._sealed(seal, payload, "told", key)

    def hearing(self, heard: Hearing) -> SealedHearing:
        def judged(key: str, payload: bytes, seal: bytes) -> None:
            try:
                self._check_told(key, payload, _read(seal))
            except Untrusted as error:
                self.distrusted = str(error)
                return
            heard(key, payload)

        return judged

    def _check_told(self, key: str, payload: bytes, seal: Seal) -> None:
        speaker = self._station_speaks if self._boot_id else self._robot_speaks
        stream = speaker(key, payload, seal)
        with self._lock:
            if seal.number <= self._heard.get(stream, 0):
                raise Untrusted("it was said before")
            self._heard[stream] = seal.number

    def _station_speaks(self, key: str, payload: bytes, seal: Seal) -> tuple[str, ...]:
        certificate = seal.certificate or b""
        holder, public = self._certificates.holder(certificate)
        _verify(public, seal, payload, "told", key)
        if holder.role != "station":
            raise Untrusted(f"{holder.name} is a {holder.role}; only stations speak to a robot")
        if not self._is_fresh(seal):
            raise Untrusted(f"what {holder.name} said is old, or was meant for another boot")
        return key, seal.nonce, _hash(certificate)

    def _robot_speaks(self, key: str, payload: bytes, seal: Seal) -> tuple[str, ...]:
        robot, where = _place(key)
        anchor = self._anchors.get(where)
        if anchor is None or seal.boot_id != anchor.boot_id:
            raise Untrusted(f"{robot} has not answered since it was started")
        holder, public = self._certificates.holder(anchor.certificate)
        _verify(public, seal, payload, "told", key)
        _must_be_robot(holder, robot)
        said_ns = anchor.asked_ns + seal.at_ns - anchor.at_ns
        if self._clock_ns() - said_ns > OLDEST_S * 1e9:
            raise Untrusted(f"what {robot} said is older than {OLDEST_S:g} s")
        return key, seal.boot_id

    def _sealed(self, seal: Seal, payload: bytes, *about: str) -> bytes:
        signature = self._held.key.sign(_signed(seal, payload, *about))
        return msgspec.json.encode(msgspec.structs.replace(seal, signature=signature))


def _signed(seal: Seal, payload: bytes, *about: str) -> bytes:
    """What is signed: a line for each thing that the message is bound to, then the message as it is."""
    what, *rest = about
    lines = (f"stopgo/{VERSION} {what}", *rest, seal.nonce, seal.boot_id, str(seal.number), str(seal.at_ns))
    if any("\n" in line for line in lines):
        raise Untrusted("its key or parameters have several lines")
    return "\n".join(lines).encode(errors="surrogatepass") + b"\n" + payload


def _verify(public: Ed25519PublicKey, seal: Seal, payload: bytes, *about: str) -> None:
    from cryptography.exceptions import InvalidSignature

    try:
        public.verify(seal.signature, _signed(seal, payload, *about))
    except InvalidSignature:
        raise Untrusted("the signature is not right") from None


def _read(seal: bytes) -> Seal:
    if not seal:
        raise Untrusted("it is not signed")
    try:
        return decode(seal, Seal)
    except msgspec.DecodeError:
        raise Untrusted("its signature cannot be read") from None


def _place(key: str) -> tuple[str, str]:
    """The robot that a key names, and its end there: the robot's own, or its tunnel's."""
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
