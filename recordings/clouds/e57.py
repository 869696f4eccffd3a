"""E57 files, read with pye57: one chunk per station, at the station's own pose."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray


def read_e57(path: Path) -> Iterator[FloatArray]:
    """Yield points (n, 3) of each station.

    Raises
    ------
    InputError
        When it cannot be read.
    """
    import pye57

    try:
        file = pye57.E57(str(path))
        for station in range(file.scan_count):
            points = file.read_scan(station, ignore_missing_fields=True, transform=True)
            axes = (points[f"cartesian{axis}"] for axis in "XYZ")
            yield np.stack([np.asarray(values, float) for values in axes], axis=-1)
    except (pye57.libe57.E57Exception, RuntimeError, KeyError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as E57 ({' '.join(str(error).split())[:100]})") from None
