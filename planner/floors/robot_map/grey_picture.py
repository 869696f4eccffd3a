"""Reader of the pictures of robots' maps: PGM and PNG, as one grey value and one opacity per pixel."""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterator, Sized
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL.PngImagePlugin import PngImageFile

from stopgo.mission.errors import InputError

GreyBytes = NDArray[np.uint8]
MOST_PIXELS = 100_000_000
_GAP, _PIECE = re.compile(rb"\s"), 1 << 20
"""Numbers are cut into pieces of about so many bytes, between two of them."""
_PNG = b"\x89PNG\r\n\x1a\n"


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
    except (struct.error, ValueError, OSError, EOFError, SyntaxError) as error:
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
    if data[:2] == b"P5" and most < 256:
        values = np.frombuffer(body, dtype="u1")
        _check_whole(values, rows * columns, name)
        grey = _greys(np.arange(256.0), most)[values[: rows * columns]].reshape(rows, columns)
    else:
        grey = _greys_of_numbers(data[:2], body, rows * columns, most, name).reshape(rows, columns)
    return GreyPicture(grey, np.ones(grey.shape, dtype=bool))


def _greys_of_numbers(kind: bytes, body: bytes, count: int, most: int, name: str) -> GreyBytes:
    """Greys of values that are written as numbers, or in two bytes."""
    if kind == b"P5":
        values = np.frombuffer(body, dtype=">u2")
        _check_whole(values, count, name)
        return _greys(values[:count].astype(np.float64), most)
    pieces = [np.empty(0, np.uint8), *(_greys(piece, most) for piece in _numbers(body, count))]
    greys = np.concatenate(pieces)
    _check_whole(greys, count, name)
    return greys


def _numbers(body: bytes, count: int) -> Iterator[NDArray[np.float64]]:
    """Yield written numbers in pieces: a list of all takes 60 bytes for each."""
    at = 0
    while at < len(body) and count > 0:
        gap = _GAP.search(body, at + _PIECE)
        end = gap.start() if gap else len(body)
        values = np.array(body[at:end].split()[:count], dtype=np.float64)
        if not np.isfinite(values).all():
            raise ValueError("a value is no number")
        yield values
        at, count = end, count - len(values)


def _greys(values: NDArray[np.float64], most: int) -> GreyBytes:
    return np.round(values * (255.0 / most)).clip(0, 255).astype(np.uint8)


def _check_whole(values: Sized, count: int, name: str) -> None:
    if len(values) < count:
        raise InputError(f"{name}: is cut off after {len(values)} of {count} pixels; copy or save it again")


def _check_size(columns: int, rows: int, name: str) -> None:
    if not 0 < columns * rows <= MOST_PIXELS:
        raise InputError(f"{name}: {columns} x {rows} pixels; a map has 1 to {MOST_PIXELS}")


def _png(data: bytes, name: str) -> GreyPicture:
    # The class itself, as `Image.open` warns of large pictures before their size can be refused.
    image = PngImageFile(io.BytesIO(data))
    _check_size(*image.size, name)
    try:
        image.load()
    except OSError:
        raise InputError(f"{name}: is cut off; copy or save it again") from None
    opaque = np.ones((image.height, image.width), dtype=bool)
    if image.mode in ("LA", "RGBA"):
        opaque = np.asarray(image)[..., -1] > 0
    if image.mode.startswith("I"):
        return GreyPicture((np.asarray(image) >> 8).astype(np.uint8), opaque)
    colours = np.asarray(image.convert("L" if image.mode in ("1", "L", "LA") else "RGB"))
    grey = colours if colours.ndim == 2 else np.round(colours.mean(axis=2)).astype(np.uint8)
    return GreyPicture(grey, opaque)
