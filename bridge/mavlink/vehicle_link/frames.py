"""MAVLink messages from bytes, of several senders at once."""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Callable
from typing import Any

os.environ.setdefault("MAVLINK20", "1")
from pymavlink.dialects.v20 import ardupilotmega as dialect

from stopgo.bridge.mavlink.vehicle_link.transport import Address
from stopgo.mission.mavlink.telemetry import Message

MAX_SENDERS = 64
UNREADABLE = "unreadable"
"""Reason by which bytes that are no frame are counted."""
ERRORS = (dialect.MAVError, struct.error, UnicodeDecodeError, ValueError, TypeError, IndexError)
"""Errors that a parser raises on bytes that are no frames."""


def plain_coder() -> Any:
    """A coder that packs and parses without a signing key."""
    coder = dialect.MAVLink(None)
    coder.robust_parsing = True
    return coder


class Frames:
    """Whole frames: only the sender who began a frame completes it, and never in another datagram."""

    def __init__(self, dropped: Counter[str], coder: Callable[[], Any] = plain_coder) -> None:
        self._dropped = dropped
        self._coder = coder
        self._parsers: dict[Address, Any] = {}

    def messages(self, data: bytes, *, datagram: bool, sender: Address = None) -> list[Message]:
        """The messages that `data` completes, BAD_DATA among them."""
        parser = self._parsers.pop(sender, None)
        if parser is None or (datagram and parser.buf_len() > 0):
            parser = self._coder()
        self._parsers[sender] = parser
        while len(self._parsers) > MAX_SENDERS:
            del self._parsers[next(iter(self._parsers))]
        try:
            return parser.parse_buffer(data) or []
        except ERRORS:
            self._dropped[UNREADABLE] += 1
            del self._parsers[sender]
            return []

    def whole(self, data: bytes, *, datagram: bool, sender: Address = None) -> list[tuple[bytes, Message]]:
        """The frames that `data` completes, with their messages; other bytes are dropped and counted."""
        messages = self.messages(data, datagram=datagram, sender=sender)
        read = [message for message in messages if message.get_type() != "BAD_DATA"]
        self._dropped[UNREADABLE] += len(messages) - len(read)
        return [(bytes(message.get_msgbuf()), message) for message in read]
