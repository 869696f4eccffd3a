"""Point clouds of the scanner itself, as points in the mission's frame, chunk by chunk.

A reader is a function `(path) -> chunks`, and one line in `CLOUD_READERS`. Clouds must be registered to the
drawing's metres; only points between ankle and head height count as walls.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from stopgo.mission.console.plugins import loader
from stopgo.mission.console.whole_file import must_end
from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

CloudChunks = Iterator[FloatArray]
"""Points (n, 3), one station or one part of a file at a time."""
CloudReader = Callable[[Path], CloudChunks]
LOW_M, HIGH_M = 0.3, 2.0
"""Heights above the floor between which points count."""
FLOOR_PERCENTILE = 0.5
"""Percentile of point heights that is the floor; it is measured in the first chunk."""


def _reader(name: str) -> CloudReader:
    load = loader(f"stopgo.recordings.clouds.{name}:read_{name}")

    def read(path: Path) -> CloudChunks:
        chunks: CloudChunks = load()(path)
        return chunks

    return read


CLOUD_READERS = {
    ".e57": _reader("e57"),
    ".las": _reader("las"),
    ".laz": _reader("las"),
    ".ply": _reader("ply"),
}


def clouds_in(folder: Path) -> tuple[Path, ...]:
    """Return the clouds in a folder, or the given file, sorted by name.

    Raises
    ------
    InputError
        When there is none, or one is a pipe.
    """
    known = ", ".join(CLOUD_READERS)
    if not folder.exists():
        raise InputError(f"--clouds {folder}: no such folder or file")
    files = sorted(folder.iterdir()) if folder.is_dir() else [folder]
    found = tuple(path for path in files if path.suffix.lower() in CLOUD_READERS)
    if not found:
        raise InputError(f"--clouds {folder}: contains no cloud; give files of {known}")
    for path in found:
        must_end(path)
    return found


def levels(paths: tuple[Path, ...]) -> Iterator[FloatArray]:
    """Yield points (n, 2) between ankle and head height, of every chunk of every cloud.

    Raises
    ------
    InputError
        Naming the file that cannot be read.
    """
    for path in paths:
        floor: float | None = None
        for chunk in CLOUD_READERS[path.suffix.lower()](path):
            finite = chunk[np.isfinite(chunk).all(axis=1)]
            if len(finite):
                floor = float(np.percentile(finite[:, 2], FLOOR_PERCENTILE)) if floor is None else floor
                height = finite[:, 2] - floor
                yield finite[(height >= LOW_M) & (height <= HIGH_M), :2]
