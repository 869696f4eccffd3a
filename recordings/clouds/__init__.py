"""Point clouds of the scanner itself -> points in the mission's frame, piece by piece.

A reader is a function `(path) -> pieces`, and one line in `CLOUD_READERS`. Clouds are taken to be registered
to the drawing's metres; only what lies between ankle and head height is of walls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

CloudPieces = Iterator[FloatArray]
"""Points (n, 3), one station or one part of a file at a time."""
CloudReader = Callable[[Path], CloudPieces]
LOW_M, HIGH_M = 0.3, 2.0
"""Heights above the floor between which points count."""
FLOOR_SHARE = 0.5
"""Percent of points that lie below the floor's height: it is told from the first piece."""


def _e57(path: Path) -> CloudPieces:
    from stopgo.recordings.clouds.e57 import read_e57

    return read_e57(path)


def _las(path: Path) -> CloudPieces:
    from stopgo.recordings.clouds.las import read_las

    return read_las(path)


def _ply(path: Path) -> CloudPieces:
    from stopgo.recordings.clouds.ply import read_ply

    return read_ply(path)


CLOUD_READERS: dict[str, CloudReader] = {".e57": _e57, ".las": _las, ".laz": _las, ".ply": _ply}


def clouds_in(folder: Path) -> tuple[Path, ...]:
    """The clouds in a folder, or the one that is named, by name.

    Raises
    ------
    InputError
        When there is none.
    """
    known = ", ".join(CLOUD_READERS)
    if not folder.exists():
        raise InputError(f"--clouds {folder}: no such folder or file")
    files = sorted(folder.iterdir()) if folder.is_dir() else [folder]
    found = tuple(path for path in files if path.suffix.lower() in CLOUD_READERS)
    if not found:
        raise InputError(f"--clouds {folder}: holds no cloud; known are {known}")
    return found


def levels(paths: tuple[Path, ...]) -> Iterator[FloatArray]:
    """Points (n, 2) of every piece of every cloud that lie between ankle and head height.

    Raises
    ------
    InputError
        Naming the file that cannot be read.
    """
    for path in paths:
        floor: float | None = None
        for piece in CLOUD_READERS[path.suffix.lower()](path):
            good = piece[np.isfinite(piece).all(axis=1)]
            if len(good):
                floor = float(np.percentile(good[:, 2], FLOOR_SHARE)) if floor is None else floor
                height = good[:, 2] - floor
                yield good[(height >= LOW_M) & (height <= HIGH_M), :2]
