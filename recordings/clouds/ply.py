"""PLY files: a text header, then vertices as text or as numbers of either byte order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
CHUNK = 1_000_000
LONGEST_HEADER = 1000
"""Lines."""


@dataclass(frozen=True)
class Vertices:
    """Description of the vertices in the header; they are the first element."""

    order: str
    """`<` or `>`; empty for text."""
    count: int
    names: tuple[str, ...]
    kinds: tuple[str, ...]


def read_ply(path: Path) -> Iterator[FloatArray]:
    """Yield vertices (n, 3), a million at a time.

    Raises
    ------
    InputError
        When it cannot be read, or its vertices have no x, y, z.
    """
    with path.open("rb") as file:
        header = _header(file, path)
        if set("xyz") - set(header.names):
            raise InputError(f"{path}: its vertices have no x, y, z")
        yield from _text(file, header, path) if not header.order else _numbers(file, header, path)


def _header(file: BinaryIO, path: Path) -> Vertices:
    if file.readline(8).strip() != b"ply":
        raise InputError(f"{path}: invalid PLY header; incomplete copy?")
    order, count, element = "", 0, ""
    names: list[str] = []
    kinds: list[str] = []
    for _ in range(LONGEST_HEADER):
        words = file.readline(1000).decode("ascii", "replace").split()
        if words[:1] == ["end_header"]:
            return Vertices(order, count, tuple(names), tuple(kinds))
        if words[:1] == ["format"] and words[1:2] and words[1] in ORDERS:
            order = ORDERS[words[1]]
        elif words[:1] == ["element"] and len(words) == 3:
            if element == "" and words[1] != "vertex":
                break
            element = words[1]
            count = int(words[2]) if element == "vertex" and words[2].isdigit() else count
        elif words[:1] == ["property"] and element == "vertex":
            if len(words) != 3 or words[1] not in TYPES:
                break
            names.append(words[2])
            kinds.append(TYPES[words[1]])
    raise InputError(f"{path}: PLY header does not have vertices first; convert the file")


def _numbers(file: BinaryIO, header: Vertices, path: Path) -> Iterator[FloatArray]:
    kind = np.dtype(
        [(name, header.order + code) for name, code in zip(header.names, header.kinds, strict=True)]
    )
    left = header.count
    while left > 0:
        data = file.read(min(left, CHUNK) * kind.itemsize)
        rows = np.frombuffer(data[: len(data) // kind.itemsize * kind.itemsize], kind)
        if not len(rows):
            raise InputError(f"{path}: {left} vertices are missing at its end; incomplete copy?")
        left -= len(rows)
        yield np.stack([rows[axis].astype(float) for axis in "xyz"], axis=-1)


def _text(file: BinaryIO, header: Vertices, path: Path) -> Iterator[FloatArray]:
    at = [header.names.index(axis) for axis in "xyz"]
    left = header.count
    while left > 0:
        lines = [line for line in (file.readline() for _ in range(min(left, CHUNK))) if line]
        if not lines:
            raise InputError(f"{path}: {left} vertices are missing at its end; incomplete copy?")
        left -= len(lines)
        try:
            yield np.array([[float(line.split()[k]) for k in at] for line in lines])
        except (ValueError, IndexError):
            raise InputError(f"{path}: a vertex is not made of numbers") from None
