"""LAS and LAZ files, by laspy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray

PIECE = 1_000_000
"""Points that are in memory at a time."""


def read_las(path: Path) -> Iterator[FloatArray]:
    """Points (n, 3), a million at a time.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    import laspy

    try:
        with laspy.open(path) as file:
            for piece in file.chunk_iterator(PIECE):
                yield np.stack([np.asarray(piece.x), np.asarray(piece.y), np.asarray(piece.z)], axis=-1)
    except (laspy.errors.LaspyException, RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{path}: cannot be read as LAS ({' '.join(str(error).split())[:100]})") from None
