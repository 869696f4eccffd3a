"""LAS and LAZ files, read with laspy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

CHUNK = 1_000_000
"""Number of points in memory at a time."""


def read_las(path: Path) -> Iterator[FloatArray]:
    """Yield points (n, 3), a million at a time.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    import laspy

    try:
        with laspy.open(path) as file:
            for chunk in file.chunk_iterator(CHUNK):
                yield np.stack([np.asarray(chunk.x), np.asarray(chunk.y), np.asarray(chunk.z)], axis=-1)
    except (laspy.errors.LaspyException, RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{path}: cannot be read as LAS ({' '.join(str(error).split())[:100]})") from None
