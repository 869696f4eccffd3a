"""Frames that somebody hostile may send, from a seed: broken ones, and whole ones that say nonsense."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message

FLOATS = (
    0.0, -0.0, 1.0, -1.0, 0.5, 90.0, 1e7, 1e38, -1e38, 1e-45, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
RANGES = {
    "uint8_t": (0, 2**8), "int8_t": (-(2**7), 2**7), "uint16_t": (0, 2**16), "int16_t": (-(2**15), 2**15),
    "uint32_t": (0, 2**32), "int32_t": (-(2**31), 2**31), "uint64_t": (0, 2**64),
    "int64_t": (-(2**63), 2**63),
}  # fmt: skip
HEARD = (
    "COMMAND_LONG", "COMMAND_INT", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_ITEM", "HEARTBEAT",
    "MISSION_REQUEST_LIST", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK", "MISSION_CLEAR_ALL",
    "MISSION_SET_CURRENT", "MISSION_WRITE_PARTIAL_LIST", "MISSION_REQUEST_PARTIAL_LIST", "SET_MODE",
    "SET_GPS_GLOBAL_ORIGIN", "SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "PARAM_SET",
    "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST",
)  # fmt: skip
"""Messages that a vehicle acts upon; the rest of the dialect is sent too, but less often."""
COMMANDS = (
    16, 17, 19, 20, 93, 178, 176, 192, 193, 203, 217, 224, 246, 300, 400, 410, 510, 511, 512, 520, 2000,
)  # fmt: skip
CLASSES = {made.msgname: made for made in dialect.mavlink_map.values()}


class Hostile:
    """A sender without manners."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self._coders = [dialect.MAVLink(None, system, 190) for system in (1, 250, 254, 255, 0)]
        self._rest = b""

    def datagrams(self, count: int) -> Iterator[bytes]:
        ways = (
            self._noise, self._cut, self._flipped, self._wrong_sum, self._falsely_signed, self._halves,
            self._several, self.frame, self.frame, self.frame, self.frame,
        )  # fmt: skip
        for _ in range(count):
            yield self.chance.choice(ways)()

    def message(self) -> Message:
        """A whole message with numbers that nobody would send."""
        name = self.chance.choice(HEARD) if self.chance.random() < 0.8 else self.chance.choice(list(CLASSES))
        made = CLASSES[name]
        lengths = dict(zip(made.ordered_fieldnames, made.array_lengths, strict=True))
        fields = zip(made.fieldnames, made.fieldtypes, strict=True)
        return made(*(self._value(field, kind, lengths[field]) for field, kind in fields))

    def items(self) -> list[Item]:
        """A short mission of items that a vehicle may take, with numbers that it must live with."""
        return [self._item() for _ in range(self.chance.randrange(1, 6))]

    def _item(self) -> Item:
        near = self.chance.choice((0, 100, -300, 20_000_000, 2**31 - 1 - 850_000_000))
        params = [self.chance.choice((*FLOATS, 2.0, 3.0)) for _ in range(4)]
        if self.chance.random() < 0.9:
            params = [value if math.isfinite(value) else 0.0 for value in params]
        command = self.chance.choice((16, 16, 16, 17, 19, 20, 93, 93, 178, 203, 217, 2000, 42702))
        frame = 6 if command in (16, 17, 19) else 2
        one, two, three, four = params
        return Item(command, frame, (one, two, three, four), 474_000_000 + near % 300, 85_000_000 + near)

    def frame(self) -> bytes:
        message, coder = self.message(), self.chance.choice(self._coders)
        coder.seq = self.chance.randrange(256)
        old = message.get_msgId() < 256 and self.chance.random() < 0.3
        return bytes(message.pack(coder, force_mavlink1=old))

    def _value(self, field: str, kind: str, length: int) -> Any:
        if kind == "char":
            return self.chance.randbytes(length or 1) if length else self.chance.randbytes(1)
        if length:
            return [self._number(kind) for _ in range(length)]
        if self.chance.random() < 0.9:
            if field in ("target_system", "target_component"):
                return self.chance.choice((0, 1))
            if field in ("seq", "count", "mission_type", "frame", "start_index", "end_index"):
                return self.chance.choice((0, 0, 0, 1, 1, 2, 3))
            if field == "command":
                return self.chance.choice(COMMANDS)
        return self._number(kind)

    def _number(self, kind: str) -> Any:
        if kind in ("float", "double"):
            return self.chance.choice(
                (*FLOATS, self.chance.uniform(-300, 300), float(self.chance.randrange(300)))
            )
        low, high = RANGES[kind]
        near = self.chance.randrange(low, high)
        return self.chance.choice((low, high - 1, 0, 1, near, self.chance.randrange(min(high, 12))))

    def _noise(self) -> bytes:
        return self.chance.choice((b"", b"\xfd", b"\xfe")) + self.chance.randbytes(self.chance.randrange(300))

    def _cut(self) -> bytes:
        frame = self.frame()
        return frame[: self.chance.randrange(len(frame))]

    def _flipped(self) -> bytes:
        frame = bytearray(self.frame())
        for _ in range(self.chance.randrange(1, 4)):
            frame[self.chance.randrange(len(frame))] ^= 1 << self.chance.randrange(8)
        return bytes(frame)

    def _wrong_sum(self) -> bytes:
        frame = self.frame()
        return frame[:-2] + self.chance.randbytes(2)

    def _falsely_signed(self) -> bytes:
        frame = bytearray(self.frame())
        frame[2] |= 1
        return bytes(frame) + self.chance.randbytes(self.chance.choice((0, 5, 13, 13)))

    def _halves(self) -> bytes:
        """The rest of one frame and the beginning of another."""
        frame = self.frame()
        cut = self.chance.randrange(len(frame))
        before, self._rest = self._rest, frame[cut:]
        return before + frame[:cut]

    def _several(self) -> bytes:
        return b"".join(self.frame() for _ in range(self.chance.randrange(2, 5)))
