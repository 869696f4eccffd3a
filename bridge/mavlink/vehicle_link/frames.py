"""MAVLink messages from bytes, of several senders at once."""

from __future__ import annotations

import os
import struct
from collections import Counter
from collections.abc import Callable
from functools import cache
from operator import itemgetter
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


FRAME_V2, AROUND_PAYLOAD = 0xFD, 12
"""First byte of a MAVLink 2 frame, and the number of bytes that an unsigned one has besides its payload."""


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
        if parser.signing.secret_key is None and parser.buf_len() == 0:
            plain = _plain_message(data)
            if plain is not None:
                return [plain]
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


def _plain_message(data: bytes) -> Message | None:
    """The message that pymavlink makes of a right and whole MAVLink 2 frame of numbers, without a signature.

    Nearly all telemetry is such; anything else is for pymavlink's parser, which takes several times as long.
    """
    if len(data) < AROUND_PAYLOAD or data[0] != FRAME_V2 or data[2] or len(data) != data[1] + AROUND_PAYLOAD:
        return None
    number = data[7] | data[8] << 8 | data[9] << 16
    reading = _reading(number)
    if reading is None:
        return None
    kind, size, ordered = reading
    crc = data[-2] | data[-1] << 8
    if crc != dialect.x25crc(data[1:-2] + bytes((kind.crc_extra,))).crc:
        return None
    message = kind(*ordered(kind.unpacker.unpack(data[10:-2].ljust(size, b"\0")[:size])))
    message._msgbuf, message._crc = bytearray(data), crc
    message._payload = message._msgbuf[6:-2]  # as pymavlink has it
    message._header = dialect.MAVLink_header(number, 0, data[3], data[1], data[4], data[5], data[6])
    return message


@cache
def _reading(number: int) -> tuple[Any, int, Callable[[Any], Any]] | None:
    """Class of a message, its payload's size, and the order of its fields; `None` with texts or arrays."""
    kind = dialect.mavlink_map.get(number)
    if kind is None or len(kind.orders) < 2 or set(kind.lengths) != {1} or "s" in kind.unpacker.format:
        return None
    return kind, kind.unpacker.size, itemgetter(*kind.orders)
