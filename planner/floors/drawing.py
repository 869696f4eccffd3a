"""Opening of a DXF, text or binary, whole or damaged, and the length of its unit."""

from __future__ import annotations

import io
import logging
import math
import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf import recover
from ezdxf.document import Drawing
from ezdxf.filemanagement import dxf_stream_info
from ezdxf.lldxf.tagger import binary_tags_loader

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Finding
from stopgo.mission.geometry import FloatArray

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

METRES: dict[int, tuple[str, float]] = {
    1: ("inch", 0.0254),
    2: ("foot", 0.3048),
    4: ("millimetre", 0.001),
    5: ("centimetre", 0.01),
    6: ("metre", 1.0),
    7: ("kilometre", 1000.0),
    10: ("yard", 0.9144),
    14: ("decimetre", 0.1),
    21: ("US survey foot", 1200 / 3937),
    22: ("US survey inch", 100 / 3937),
}
"""$INSUNITS code: name and length in metres of the units buildings are drawn in."""

_LIKELY = (6, 4, 5, 1, 2)
_LIKELY_IMPERIAL = (1, 2, 6, 4, 5)
Limits = tuple[float, float]
"""Least and greatest, in metres."""

_FLOOR_EXTENT = (3.0, 400.0)
_HEADER_EXTENT = (1.0, 2000.0)
_DOOR_WIDTH = (0.4, 4.0)
_LEAF_WIDTH = (0.5, 1.7)


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
    info = dxf_stream_info(io.StringIO(data.decode("utf-8", errors="ignore")))
    # Universal newlines, as when the file itself is opened: \r\n must not reach the tags.
    stream = io.TextIOWrapper(io.BytesIO(data), encoding=info.encoding, errors="surrogateescape")
    return ezdxf.read(stream)


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


def legible(text: str, *, most: int = 120) -> str:
    """Return text from a file as one line that every terminal and file accepts."""
    sound = text.encode("utf-8", errors="replace").decode("utf-8")
    line = " ".join(sound.split())
    return "".join(letter if letter.isprintable() else "?" for letter in line)[:most]


def metres_per_unit(
    drawing: Drawing, *, floor: FloatArray, doors: Sequence[float], leaves: bool = False
) -> tuple[float, list[Finding]]:
    """Length of one drawing unit, from the header unless the floor's size contradicts it.

    Parameters
    ----------
    floor : (n, 2)
        Points of the layer FLOOR in drawing units.
    doors
        Lengths of the lines across openings in drawing units.
    leaves
        True if these are the widths of single leaves, which are more reliable.
    """
    widths = _LEAF_WIDTH if leaves else _DOOR_WIDTH
    extent = float(np.ptp(floor, axis=0).max()) if len(floor) else 0.0
    door = float(np.median(doors)) if len(doors) else None
    code = _header_integer(drawing, "$INSUNITS")
    named = METRES.get(code)
    if named and _fits_header(extent * named[1], door and door * named[1], widths):
        return named[1], []
    likely = _LIKELY_IMPERIAL if _header_integer(drawing, "$MEASUREMENT", 1) == 0 else _LIKELY
    fitting = [
        METRES[item]
        for item in likely
        if _fits(extent * METRES[item][1], door and door * METRES[item][1], widths)
    ]
    if not fitting:
        return _as_written(named, extent=extent)
    return _as_measured(named, fitting[0], code=code, extent=extent)


def given_unit(name: str, extent: FloatArray, *, source: Path) -> tuple[float, list[Finding]]:
    """Return the length in metres of a unit given by name, such as `mm`.

    Raises
    ------
    InputError
        When there is no such unit, or the drawing would not have the size of a building.
    """
    code = _NAMED.get(name.strip().lower())
    if code is None:
        raise InputError(f"{source}: --units {legible(name)}: no such unit; known: {', '.join(_NAMED)}")
    word, factor = METRES[code]
    size = float(np.ptp(extent, axis=0).max()) * factor if len(extent) else None
    if size is not None and not _HEADER_EXTENT[0] <= size <= _HEADER_EXTENT[1]:
        raise InputError(
            f"{source}: --units {legible(name)} makes the drawing {size:.4g} m across; name another unit, "
            "or leave it out and stopgo looks at doors and walls"
        )
    return factor, [Finding("units_as_told", f"one unit is a {word}, as given")]


_NAMED = {
    **{"mm": 4, "cm": 5, "dm": 14, "m": 6, "km": 7, "in": 1, "ft": 2, "yd": 10},
    **{name: code for code, (name, _) in METRES.items()},
}
"""Accepted names of units, with their $INSUNITS codes."""


def _header_integer(drawing: Drawing, name: str, default: int = 0) -> int:
    value = drawing.header.get(name, default)
    return int(value) if isinstance(value, int | float) and math.isfinite(value) else default


def _fits(extent: float, door: float | None, widths: Limits, limits: Limits = _FLOOR_EXTENT) -> bool:
    door_fits = door is None or widths[0] <= door <= widths[1]
    return door_fits and limits[0] <= extent <= limits[1]


def _fits_header(extent: float, door: float | None, widths: Limits) -> bool:
    """True if the header's unit fits; for a very small or large floor, only if door widths confirm it."""
    return _fits(extent, door, widths) or (door is not None and _fits(extent, door, widths, _HEADER_EXTENT))


def _as_written(named: tuple[str, float] | None, *, extent: float) -> tuple[float, list[Finding]]:
    name, factor = named or METRES[6]
    source = "as the header says" if named else "the header ($INSUNITS) names no unit"
    message = f"the floor is {extent * factor:.4g} m across, read in {name} ({source}); check the unit"
    return factor, [Finding("units_doubtful", message)]


def _as_measured(
    named: tuple[str, float] | None, fitting: tuple[str, float], *, code: int, extent: float
) -> tuple[float, list[Finding]]:
    name, factor = fitting
    read = f"read in {name}, which makes the floor {extent * factor:.4g} m across"
    if named is None:
        return factor, [Finding("units_missing", f"$INSUNITS = {code} names no unit of length; {read}")]
    message = f"the header says {named[0]}, which makes the floor {extent * named[1]:.4g} m across; {read}"
    return factor, [Finding("units_wrong", message)]
