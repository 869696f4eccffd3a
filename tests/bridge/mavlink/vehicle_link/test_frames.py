"""Frames of numbers are read without pymavlink's parser, to the same messages."""

from __future__ import annotations

import random
from collections import Counter
from typing import Any

import pytest

from stopgo.bridge.mavlink.vehicle_link import frames
from stopgo.bridge.mavlink.vehicle_link.frames import Frames, dialect, plain_coder

NUMBERS = sorted(dialect.mavlink_map)


def frame(number: int, chance: random.Random, *, flags: int = 0) -> bytes:
    """A right frame of a message whose fields are any bytes."""
    kind = dialect.mavlink_map[number]
    payload = chance.randbytes(chance.randrange(kind.unpacker.size + 1)).rstrip(b"\0") or b"\0"
    header = dialect.MAVLink_header(number, flags, 0, len(payload), *(chance.randrange(256) for _ in "123"))
    begun = header.pack() + payload
    return begun + dialect.x25crc(begun[1:] + bytes((kind.crc_extra,))).crc.to_bytes(2, "little")


def everything(message: Any) -> str:
    """All that a message knows of itself and of its frame."""
    known = vars(message)
    return repr({**known, "_header": vars(known["_header"])})


def read(data: bytes) -> list[str]:
    return [everything(message) for message in Frames(Counter()).messages(data, datagram=True)]


def read_by_pymavlink(data: bytes, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    with monkeypatch.context() as patch:
        patch.setattr(frames, "_plain_message", lambda data: None)
        return read(data)


def test_every_message_is_read_as_pymavlink_reads_it(monkeypatch: pytest.MonkeyPatch) -> None:
    chance = random.Random(1)
    for number in NUMBERS:
        right = frame(number, chance)
        assert read(right) == read_by_pymavlink(right, monkeypatch)
        at = chance.randrange(len(right))
        for wrong in (
            right[:at], right + right[: at + 1], right[:at] + bytes((right[at] ^ 4,)) + right[at + 1 :],
            frame(number, chance, flags=chance.choice((1, 2))),
        ):  # fmt: skip
            assert read(wrong) == read_by_pymavlink(wrong, monkeypatch)


def test_most_telemetry_needs_no_parser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dialect.MAVLink, "parse_buffer", lambda self, data: pytest.fail("parsed"))
    for name in ("HEARTBEAT", "ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "MISSION_CURRENT"):
        data = frame(getattr(dialect, f"MAVLINK_MSG_ID_{name}"), random.Random(2))
        assert [message.get_type() for message in Frames(Counter()).messages(data, datagram=True)] == [name]


def test_with_a_key_every_frame_is_checked_by_the_parser() -> None:
    def coder() -> Any:
        made = plain_coder()
        made.signing.secret_key = bytes(32)
        return made

    unsigned = frame(dialect.MAVLINK_MSG_ID_HEARTBEAT, random.Random(3))
    (message,) = Frames(Counter(), coder).messages(unsigned, datagram=True)
    assert message.get_type() == "BAD_DATA"
