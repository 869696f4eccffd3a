"""Numbers as the fields of items hold them: as float32 on the link, and as stored on a vehicle."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import replace

from stopgo.mission.mavlink.items import Item

Field = Callable[[float], float]


def as_sent(item: Item) -> Item:
    """Return the item as it arrives: real numbers rounded to float32."""
    one, two, three, four = (float32(param) for param in item.params)
    return replace(item, params=(one, two, three, four), z=float32(item.z))


def float32(value: float) -> float:
    """Return the nearest number a float32 holds; beyond its range, infinity."""
    try:
        return float(struct.unpack("<f", struct.pack("<f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def float16(value: float) -> float:
    try:
        return float(struct.unpack("<e", struct.pack("<e", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def same(value: float) -> float:
    return value


def dropped(_: float) -> float:
    return 0.0


def whole(value: float) -> float:
    """Truncate towards zero, as a C cast does; NaN and infinity stay, because the vehicle refuses them."""
    return float(int(value)) if math.isfinite(value) else value


def uint16(value: float) -> float:
    """Truncate to 16 bits: 2.9 becomes 2 and 100 000 becomes 34 464."""
    return float(int(value) & 0xFFFF) if math.isfinite(value) else value


def uint8(value: float) -> float:
    return float(int(value) & 0xFF) if math.isfinite(value) else value


def int8(value: float) -> float:
    return float((int(value) + 0x80 & 0xFF) - 0x80) if math.isfinite(value) else value


def int16(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000


def centimetres(metres: float) -> float:
    """Truncate to whole centimetres, in float32 (metres × 100, then × 0.01)."""
    if not math.isfinite(float32(metres * 100.0)):
        return metres
    return float32(int(float32(metres * 100.0)) * float32(0.01))


PLACED = frozenset({16, 17, 18, 19, 21, 22, 30, 31, 82, 84, 85, 94, 179, 189, 195, 201})
"""Commands whose x and y are a latitude and a longitude."""
