"""Reader of the pictures of robots' maps: PGM and PNG, as one grey value and one opacity per pixel."""

from __future__ import annotations

import re
import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.errors import InputError

GreyBytes = NDArray[np.uint8]
MOST_PIXELS = 100_000_000
_PNG = b"\x89PNG\r\n\x1a\n"
_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Values per pixel of each PNG colour type: grey, RGB, palette, grey and alpha, RGB and alpha."""


@dataclass(frozen=True, eq=False)
class GreyPicture:
    """A picture, its first row at the top."""

    grey: GreyBytes
    """(rows, columns), 0 black to 255 white; colours by their mean."""
    opaque: NDArray[np.bool_]
    """(rows, columns): True where anything is drawn."""


def read_picture(data: bytes, *, name: str) -> GreyPicture:
    """The picture in the bytes of a PGM or a PNG.

    Raises
    ------
    InputError
        When it is neither, is cut off, or is larger than any map.
    """
    try:
        if data.startswith(_PNG):
            return _png(data, name)
        if data[:2] in (b"P2", b"P5"):
            return _pgm(data, name)
    except (struct.error, zlib.error, ValueError, IndexError, KeyError) as error:
        raise InputError(f"{name}: cannot be read ({error or type(error).__name__}); save it again") from None
    raise InputError(f"{name}: is neither PGM nor PNG; convert it, such as: convert {name} map.pgm")


def _pgm(data: bytes, name: str) -> GreyPicture:
    header = re.match(rb"P[25](?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)(?:\s|#[^\n]*\n)+(\d+)\s", data)
    if header is None:
        raise InputError(f"{name}: its header is damaged; save the map again")
    columns, rows, most = map(int, header.groups())
    _check_size(columns, rows, name)
    if not 0 < most < 65536:
        raise ValueError(f"greatest value {most}")
    body = data[header.end() :]
    if data[:2] == b"P2":
        values = np.array(body.split()[: rows * columns], dtype=np.float64)
    else:
        values = np.frombuffer(body, dtype=">u2" if most > 255 else "u1", count=-1).astype(np.float64)
    values = _whole(values, rows * columns, name).reshape(rows, columns)
    grey = np.round(values * (255.0 / most)).clip(0, 255).astype(np.uint8)
    return GreyPicture(grey, np.ones(grey.shape, dtype=bool))


def _whole(values: NDArray[np.float64], count: int, name: str) -> NDArray[np.float64]:
    if len(values) < count:
        raise InputError(f"{name}: is cut off after {len(values)} of {count} pixels; copy or save it again")
    return values[:count]


def _check_size(columns: int, rows: int, name: str) -> None:
    if not 0 < columns * rows <= MOST_PIXELS:
        raise InputError(f"{name}: {columns} x {rows} pixels; a map has 1 to {MOST_PIXELS}")


def _png(data: bytes, name: str) -> GreyPicture:
    chunks = _chunks(data)
    header = chunks["IHDR"]
    columns, rows, depth, colour, _, _, interlaced = struct.unpack(">IIBBBBB", header[:13])
    _check_size(columns, rows, name)
    if interlaced:
        raise InputError(f"{name}: is an interlaced PNG; save it without interlacing, or as PGM")
    packed = chunks.get("IDAT", b"")
    channels = _CHANNELS[colour]
    width = (columns * channels * depth + 7) // 8
    raw = zlib.decompressobj().decompress(packed, rows * (width + 1))
    if len(raw) < rows * (width + 1):
        raise InputError(f"{name}: is cut off; copy or save it again")
    rows_of_bytes = np.frombuffer(raw, dtype=np.uint8).reshape(rows, width + 1)
    lines = _unfiltered(rows_of_bytes, max(1, channels * depth // 8))
    values = _samples(lines, depth, columns * channels).reshape(rows, columns, channels)
    return _grey(values, colour, depth, chunks)


def _chunks(data: bytes) -> dict[str, bytes]:
    """Content by kind; pieces of one kind joined."""
    found: dict[str, bytearray] = {}
    at = len(_PNG)
    while at + 8 <= len(data):
        size, kind = struct.unpack(">I4s", data[at : at + 8])
        found.setdefault(kind.decode("latin-1"), bytearray()).extend(data[at + 8 : at + 8 + size])
        at += 12 + size
    return {kind: bytes(content) for kind, content in found.items()}


def _unfiltered(lines: GreyBytes, step: int) -> GreyBytes:
    """Rows as they were before PNG wrote differences to what is left (`step` bytes away) and above."""
    rows, width = lines.shape[0], lines.shape[1] - 1
    out = np.zeros((rows + 1, width + step), dtype=np.uint8)
    for row in range(rows):
        kind, line = int(lines[row, 0]), lines[row, 1:]
        if kind > 4:
            raise ValueError(f"row {row} has a filter that PNG does not define")
        _unfilter(kind, line, above=out[row], into=out[row + 1], step=step)
    return out[1:, step:]


def _unfilter(kind: int, line: GreyBytes, *, above: GreyBytes, into: GreyBytes, step: int) -> None:
    if kind in (0, 2):
        into[step:] = line + (above[step:] if kind else np.uint8(0))
    elif kind == 1:
        padded = np.concatenate([line, np.zeros(-len(line) % step, dtype=np.uint8)])
        into[step:] = np.cumsum(padded.reshape(-1, step), axis=0, dtype=np.uint8).reshape(-1)[: len(line)]
    else:
        given, up, now = line.tolist(), above.tolist(), into.tolist()
        for k, value in enumerate(given):
            left, over, corner = now[k], up[k + step], up[k]
            near = (left + over) // 2 if kind == 3 else _paeth(left, over, corner)
            now[k + step] = (value + near) & 255
        into[:] = now


def _paeth(left: int, over: int, corner: int) -> int:
    guess = left + over - corner
    away = (abs(guess - left), abs(guess - over), abs(guess - corner))
    return (left, over, corner)[away.index(min(away))]


def _samples(lines: GreyBytes, depth: int, count: int) -> NDArray[np.float64]:
    """Values of each row (rows, count), whatever number of bits they have."""
    if depth == 16:
        return lines.reshape(len(lines), -1, 2)[:, :count, 0].astype(np.float64)
    if depth == 8:
        return lines[:, :count].astype(np.float64)
    bits = np.unpackbits(lines, axis=1)[:, : count * depth].reshape(len(lines), count, depth)
    return (bits * (1 << np.arange(depth - 1, -1, -1))).sum(axis=2).astype(np.float64)


def _grey(values: NDArray[np.float64], colour: int, depth: int, chunks: dict[str, bytes]) -> GreyPicture:
    opaque = np.ones(values.shape[:2], dtype=bool)
    if colour == 3:
        palette = np.frombuffer(chunks["PLTE"], dtype=np.uint8).reshape(-1, 3).mean(axis=1)
        grey = palette[values[..., 0].astype(int)]
    else:
        most = 255.0 if depth >= 8 else (1 << depth) - 1
        colours = values[..., :1] if colour in (0, 4) else values[..., :3]
        grey = colours.mean(axis=2) * (255.0 / most)
        if colour in (4, 6):
            opaque = values[..., -1] > 0
    return GreyPicture(np.round(grey).astype(np.uint8), opaque)
