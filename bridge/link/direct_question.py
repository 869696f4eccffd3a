"""Questions on a TLS connection of their own, without a zenoh session: answered after three round trips.

A zenoh session takes five. Both ends name `PROTOCOL` in the TLS handshake; a robot or router without it
selects none. The question and its answer are one line of JSON each, signed as those on zenoh.
"""

from __future__ import annotations

import socket
import ssl
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

import msgspec

from stopgo.bridge.link.keys import HeldKeys
from stopgo.bridge.link.link import Request, Unanswered
from stopgo.bridge.link.signatures import KeySigning, SignedAnswering
from stopgo.mission.document.decoding import decoded

PROTOCOL: Final = "stopgo-question/1"
MOST_BYTES: Final = 16_384
"""Longest line. A pause has a few hundred bytes, and a certificate."""
LINE_S: Final = 5.0
"""Longest wait of a robot for a question, and for its answer to be taken."""


class DirectMessage(msgspec.Struct, frozen=True, kw_only=True):
    """A question or an answer with its signature; the key is the question's."""

    key: str = ""
    payload: bytes
    attachment: bytes = msgspec.field(name="seal")


class DirectQuestion:
    """A question that is being asked, in a thread of its own."""

    def __init__(self, endpoint: str, held: HeldKeys, key: str, payload: bytes, *, timeout_s: float) -> None:
        self.reply: bytes | None = None
        """The verified answer; `None` as long as there is none."""
        self.may_be_sent = False
        host, _, port = endpoint.partition("/")[2].rpartition(":")
        self._address = host.strip("[]"), int(port)
        self._held, self._key, self._payload, self._timeout_s = held, key, payload, timeout_s
        self.thread = threading.Thread(target=self._ask, name="direct question", daemon=True)
        self.thread.start()

    def _ask(self) -> None:
        with (
            suppress(OSError, msgspec.DecodeError),
            socket.create_connection(self._address, timeout=self._timeout_s) as connected,
            station_context(self._held).wrap_socket(connected, server_hostname=self._address[0]) as line,
        ):
            if line.selected_alpn_protocol() != PROTOCOL:
                return
            signing = KeySigning(self._held)
            question = signing.sign_question(self._key, self._payload, {})
            self.may_be_sent = True
            line.sendall(
                _line(DirectMessage(key=self._key, payload=self._payload, attachment=question.attachment))
            )
            answer = _read(line)
            self.reply = signing.verify_answer(question, answer.payload, answer.attachment)


def can_ask_directly(endpoint: str) -> bool:
    """True if the endpoint is one of TLS alone."""
    return endpoint.startswith("tls/") and not set(",?#") & set(endpoint)


def answer_directly(line: ssl.SSLSocket, answers: Mapping[str, SignedAnswering]) -> None:
    """Answer one question on an admitted connection, and close it; the answers are by key."""
    with suppress(OSError, msgspec.DecodeError, Unanswered), line:
        line.settimeout(LINE_S)
        question = _read(line)
        if question.key in answers:
            request = Request(question.key, question.payload, {}, question.attachment)
            payload, attachment = answers[question.key](request)
            line.sendall(_line(DirectMessage(payload=payload, attachment=attachment)))


def station_context(held: HeldKeys) -> ssl.SSLContext:
    """Return TLS settings that verify a robot's name and authority, and offer the holder's certificate."""
    context = ssl.create_default_context(cafile=str(held.files.authority))
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.load_cert_chain(str(held.files.certificate), str(held.files.key))
    context.set_alpn_protocols([PROTOCOL])
    return context


def _line(message: DirectMessage) -> bytes:
    return msgspec.json.encode(message) + b"\n"


def _read(line: ssl.SSLSocket) -> DirectMessage:
    """Read one line; raises `OSError` or `msgspec.DecodeError` if there is none."""
    received = bytearray()
    while not received.endswith(b"\n"):
        data = line.recv(MOST_BYTES)
        received += data
        if not data or len(received) > MOST_BYTES:
            raise ConnectionResetError
    return decoded(received, DirectMessage)
