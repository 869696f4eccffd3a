"""Reads a building floor from a file: one reader per suffix, one line in `READERS` per new format."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from pathlib import Path

from mission.errors import InputError
from mission.floor import FloorPlan
from planner.floors.dxf import read_dxf

Reader = Callable[..., FloorPlan]
"""`(data: bytes, *, source: Path, digest: str, d_dis: float, layers: Mapping[str, str]) -> FloorPlan`."""

READERS: dict[str, Reader] = {".dxf": read_dxf}
"""Reader of each suffix."""


def read_floor(path: Path, *, d_dis: float, layers: Mapping[str, str] | None = None) -> FloorPlan:
    """The floor drawn in `path`, in metres; circles are cut by Eq. 1 for units of `d_dis` metres.

    `layers` says what layers of other names stand for: names in capitals, kinds as in LAYER_ROLES.

    Raises
    ------
    InputError
        One line naming the file, what is wrong with it, and the way out.
    """
    data = _bytes_of(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(READERS)
        raise InputError(f"{path}: unknown kind of file '{path.suffix}'; floors are read from {known}")
    digest = hashlib.sha256(data).hexdigest()
    return reader(data, source=path, digest=digest, d_dis=d_dis, layers=layers or {})


def _bytes_of(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; name the floor's file in it") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); check the path and its permissions") from None
    if not data.strip():
        raise InputError(f"{path}: is empty ({len(data)} bytes); export the floor again")
    return data
