"""Signatures are, byte for byte, as docs/reference/protocol.md says: one dialogue, fixed keys and times."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from datetime import datetime
from importlib.resources import files
from pathlib import Path
from typing import Any

import msgspec
import pytest
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from stopgo.bridge.link.keys import HeldKeys, KeyFiles, holder_of
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.signatures import KeySigning

VECTORS: dict[str, Any] = json.loads(files("stopgo.bridge.link").joinpath("seal.vectors.json").read_bytes())
MESSAGES: list[dict[str, Any]] = VECTORS["messages"]
each_message = pytest.mark.parametrize("message", MESSAGES, ids=lambda message: str(message["shows"]))


def test_our_own_ends_say_exactly_this(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert dialogue(held_keys(tmp_path), monkeypatch) == MESSAGES


@each_message
def test_a_signature_verifies_as_the_document_says(message: dict[str, Any]) -> None:
    attachment = json.loads(message["seal"])
    assert by_the_document(message, attachment) == message["signed"].encode()
    key = public_key(message["by"])
    key.verify(msgspec.convert(attachment["signature"], bytes), message["signed"].encode())


@each_message
@pytest.mark.parametrize("line", ["nonce", "boot_id", "number", "at_ns"])
def test_whatever_is_changed_in_an_attachment_breaks_it(message: dict[str, Any], line: str) -> None:
    attachment = json.loads(message["seal"])
    changed = {**attachment, line: attachment.get(line, 0) + 1 if line in ("number", "at_ns") else "other"}
    with pytest.raises(InvalidSignature):
        public_key(message["by"]).verify(
            msgspec.convert(attachment["signature"], bytes), by_the_document(message, changed)
        )


def test_the_document_names_the_vectors() -> None:
    page = Path(__file__).parents[3] / "docs" / "reference" / "protocol.md"
    assert "bridge/link/seal.vectors.json" in page.read_text(encoding="utf-8")


def by_the_document(message: dict[str, Any], attachment: dict[str, Any]) -> bytes:
    """The bytes that are signed, written once more after docs/reference/protocol.md alone."""
    parameters = ";".join(f"{name}={value}" for name, value in sorted(message["parameters"].items()))
    asked = hashlib.sha256(message.get("question", "").encode()).hexdigest()
    about = {
        "question": [message["key"], parameters],
        "answer": [message["key"], parameters, asked],
        "told": [message["key"]],
    }[message["kind"]]
    bound = [
        attachment.get("nonce", ""),
        attachment.get("boot_id", ""),
        attachment.get("number", 0),
        attachment.get("at_ns", 0),
    ]
    lines = "".join(f"{line}\n" for line in (f"stopgo/1 {message['kind']}", *about, *bound))
    return lines.encode() + message["payload"].encode()


def public_key(name: str) -> Ed25519PublicKey:
    held = VECTORS["holders"][name]
    key = x509.load_der_x509_certificate(bytes.fromhex(held["certificate"])).public_key()
    assert isinstance(key, Ed25519PublicKey)
    return key


def held_keys(folder: Path) -> dict[str, HeldKeys]:
    """The keys of the vectors, as they were on the day of the vectors."""
    authority = x509.load_der_x509_certificate(bytes.fromhex(VECTORS["authority"]))
    held = {}
    for name, told in VECTORS["holders"].items():
        certificate = x509.load_der_x509_certificate(bytes.fromhex(told["certificate"]))
        key = Ed25519PrivateKey.from_private_bytes(bytes.fromhex(told["private_key"]))
        held[name] = HeldKeys(KeyFiles(folder / name), holder_of(certificate), authority, certificate, key)
    return held


class Dialogue:
    """What robot r1 and station alice say to one another, signed and verified, as vectors."""

    def __init__(self, held: dict[str, HeldKeys]) -> None:
        day = datetime.fromisoformat(VECTORS["now"])
        ns = 1_700_000_000_000_000_000
        self.station = KeySigning(held["alice"], now=lambda: day, clock_ns=lambda: 5_000_000_000)
        self.robot = KeySigning(held["r1"], boot_id="b7", now=lambda: day, clock_ns=lambda: ns)
        self.said: list[dict[str, Any]] = []

    def say(self, shows: str, kind: str, by: str, key: str, payload: str, seal: bytes, **more: Any) -> None:
        given = {"shows": shows, "kind": kind, "by": by, "key": key, "parameters": {}, "payload": payload}
        message = {**given, **more}
        signed = by_the_document(message, json.loads(seal)).decode()
        self.said.append({**message, "signed": signed, "seal": seal.decode()})

    def ask(self, shows: str, key: str, payload: str, reply: str, **parameters: str) -> None:
        question = self.station.sign_question(key, payload.encode(), parameters)
        self.say(shows, "question", "alice", key, payload, question.attachment, parameters=parameters)
        answered = self.robot.sign_answers(lambda request: reply.encode())
        got, seal = answered(Request(key, payload.encode(), parameters, question.attachment))
        assert self.station.verify_answer(question, got, seal) == reply.encode(), self.station.distrusted
        more = {"parameters": parameters, "question": payload}
        self.say(f"the answer to {shows}", "answer", "r1", key, reply, seal, **more)

    def publish(self, shows: str, by: str, key: str, payload: str) -> None:
        speaker, listener = (self.robot, self.station) if by == "r1" else (self.station, self.robot)
        heard: list[bytes] = []
        seal = speaker.sign_publication(key, payload.encode())
        hears = listener.verify_publications(lambda key, payload: heard.append(payload))
        hears(key, payload.encode(), seal)
        assert heard == [payload.encode()], listener.distrusted
        self.say(shows, "told", by, key, payload, seal)


def dialogue(held: dict[str, HeldKeys], monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Alice asks robot r1 what it is, hears its state, asks for its log and commands a pause."""
    nonces: Iterator[int] = iter(range(1, 100))
    monkeypatch.setattr("secrets.token_hex", lambda size: f"{next(nonces):0{2 * size}x}")
    talk, root = Dialogue(held), "north/hall/sx/1/r1"
    state = (f"{root}/tel/state", '{"robot":"r1","more":1}')
    log = '{"is":"LogPage","events":[],"newest":0}'
    talk.ask(
        "a first question, without payload", f"{root}/info", "", '{"is":"Malformed","message":"Büro 😀"}'
    )
    talk.publish("what a robot publishes", "r1", *state)
    talk.publish("the same once more, by another number", "r1", *state)
    talk.ask("a question with parameters", f"{root}/log", "", log, since="0", run="x")
    talk.ask("a question with a payload", f"{root}/cmd/pause", '{"is":"Command"}', '{"is":"Answer"}')
    talk.ask("a question to the tunnel", f"{root}/mavlink/hello", "", "{}")
    talk.publish("what a station publishes", "alice", f"{root}/mavlink/up", "frames")
    return talk.said
