"""Opening of a DXF, text or binary, whole or damaged."""

from __future__ import annotations

import io
import logging
import re
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ezdxf
from ezdxf import recover
from ezdxf.document import Drawing
from ezdxf.filemanagement import dxf_stream_info
from ezdxf.lldxf.tagger import binary_tags_loader

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.planner.floors.legible_text import legible

BROKEN_INPUT = (
    ezdxf.DXFError,
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    OSError,
    RecursionError,
    StopIteration,
    TypeError,
    ValueError,
    struct.error,
)
"""Exceptions that ezdxf raises on damaged input: it does not check types and links."""

_BINARY = b"AutoCAD Binary DXF\r\n\x1a\x00"


def open_drawing(data: bytes, *, source: Path) -> tuple[Drawing, list[Finding]]:
    """Return the drawing in `data`, and findings if it had to be repaired.

    Raises
    ------
    InputError
        When `data` is no DXF, is cut off before its entities end, or holds nothing that can be read.
    """
    if data[:4] == b"AC10":
        raise InputError(f"{source}: is a DWG file, which is not read; save it as DXF")
    if not _looks_like_dxf(data):
        raise InputError(
            f"{source}: is not a DXF file (it starts with {data[:16]!r}); export the floor as DXF"
        )
    if not _holds_all_entities(data):
        raise InputError(
            f"{source}: is cut off after {len(data)} bytes, before its ENTITIES section ends; "
            "copy or export it again"
        )
    with _quiet():
        try:
            return _load(data), _without_end(data)
        except BROKEN_INPUT as error:
            return _recover(data, source=source, cause=error)


def _looks_like_dxf(data: bytes) -> bool:
    """True for a binary DXF with its signature, or text whose tags open a section."""
    return data.startswith(_BINARY) or (b"\0" not in data[:1024] and b"SECTION" in data)


def _holds_all_entities(data: bytes) -> bool:
    """True if the ENTITIES section is complete; a file cut off in it may lack walls."""
    start = data.rfind(b"ENTITIES")
    return start >= 0 and data.find(b"ENDSEC", start) >= 0


def _without_end(data: bytes) -> list[Finding]:
    if b"EOF" in data[-64:]:
        return []
    return [Finding("recovered", "the file ends without EOF after its entities; nothing drawn is missing")]


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence ezdxf's log of repairs: the user gets them as findings, not on stderr."""
    logger = logging.getLogger("ezdxf")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)


def _load(data: bytes) -> Drawing:
    if data.startswith(_BINARY):
        return Drawing.load(binary_tags_loader(data, errors="surrogateescape"))
    # Universal newlines, as when the file itself is opened: no tag may end in \r, neither the header's.
    info = dxf_stream_info(io.StringIO(data.decode("utf-8", errors="ignore"), newline=None))
    stream = io.TextIOWrapper(
        io.BytesIO(data), encoding=_encoding(data, info.encoding), errors="surrogateescape"
    )
    return ezdxf.read(stream)


def _encoding(data: bytes, named: str) -> str:
    """The encoding of a text DXF; `named` is that of its header, or Western European if it names none.

    Scripts write UTF-8 under any header, and Japanese programs R12 without a codepage. Hardly a word of
    another language is valid UTF-8, or has kana in it.
    """
    if named != "cp1252" or data.isascii():
        return named
    if _decoded(data, "utf-8") is not None:
        return "utf-8"
    has_codepage = b"$DWGCODEPAGE" in data
    return "cp932" if not has_codepage and _KANA.search(_decoded(data, "cp932") or "") else named


_KANA = re.compile("[\u3041-\u30fe]")
"""Hiragana and katakana of full width."""


def _decoded(data: bytes, encoding: str) -> str | None:
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        return None


def _recover(data: bytes, *, source: Path, cause: BaseException) -> tuple[Drawing, list[Finding]]:
    try:
        drawing, _ = recover.read(io.BytesIO(data))
        count = len(drawing.modelspace())
    except BROKEN_INPUT as error:
        raise InputError(f"{source}: cannot be read as DXF ({_one_line(error)}); export it again") from None
    if not count:
        raise InputError(f"{source}: is damaged and nothing in it can be recovered; export it again")
    message = (
        f"the file is damaged ({_one_line(cause)}); {count} entities were recovered, compare with the drawing"
    )
    return drawing, [Finding("recovered", message)]


def _one_line(error: BaseException) -> str:
    return legible(str(error)) or type(error).__name__
