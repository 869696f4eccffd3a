"""Reader of the pictures of robots' maps: PGM and PNG, as one grey value and one opacity per pixel."""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL.PngImagePlugin import PngImageFile

from stopgo.mission.errors import InputError

GreyBytes = NDArray[np.uint8]
MOST_PIXELS = 100_000_000
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
    if data[:2] == b"P2":
        values = np.array(body.split()[: rows * columns], dtype=np.float64)
    else:
        values = np.frombuffer(body, dtype=">u2" if most > 255 else "u1", count=-1).astype(np.float64)
    values = _whole(values, rows * columns, name).reshape(rows, columns)
    if not np.isfinite(values).all():
        raise ValueError("a value is no number")
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
