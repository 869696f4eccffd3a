"""Description of a robot's map in its map.yaml: picture, pixel size, origin, and meaning of grey values."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.errors import InputError
from stopgo.planner.floors.robot_map.grey_picture import GreyPicture

FREE, UNKNOWN, OCCUPIED = 0, 1, 2
_KNOWN = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
_WRITTEN_UNKNOWN: dict[str, tuple[int, ...]] = {"trinary": (205,), "scale": (127, 128, 205), "raw": ()}
"""Grey values that map savers write for unknown cells, by mode.

Thresholds do not show them: 205 is a probability of 0.196, which the free_thresh of 0.25 of older maps
takes for free. Trinary maps have it for nothing else, and no whole percent gives it in scale. A scale map
saved as PGM loses its transparency, and leaves half grey. Raw values above 100 are unknown in any case.
"""
_MODES = tuple(_WRITTEN_UNKNOWN)


@dataclass(frozen=True)
class MapDescription:
    """The values of a map.yaml that map_server reads."""

    image: str
    resolution: float
    """Metres per pixel."""
    origin: tuple[float, float, float]
    """Where the picture's lower left corner lies in the map's frame: x, y in metres, yaw in radians."""
    negate: bool = False
    occupied_thresh: float = 0.65
    free_thresh: float = 0.196
    mode: str = "trinary"

    def cells(self, picture: GreyPicture) -> NDArray[np.uint8]:
        """FREE, UNKNOWN or OCCUPIED for each pixel (rows, columns), the first row at the bottom.

        Unknown cells are recognised by the value that map savers write, whatever the thresholds are.
        Values between free and occupied of `scale` and `raw` are unknown: not drivable and not a target.
        """
        grey = np.arange(256.0)
        known = ~np.isin(grey, [255 - v if self.negate else v for v in _WRITTEN_UNKNOWN[self.mode]])
        if self.mode == "raw":
            fraction, known = grey / 100.0, known & (grey <= 100)
        else:
            fraction = grey / 255.0 if self.negate else 1.0 - grey / 255.0
        meaning = np.full(256, UNKNOWN, dtype=np.uint8)
        meaning[known & (fraction < self.free_thresh)] = FREE
        meaning[known & (fraction > self.occupied_thresh)] = OCCUPIED
        cells = meaning[picture.grey]
        cells[~picture.opaque] = UNKNOWN
        return cells[::-1]


def read_description(data: bytes, *, name: str) -> MapDescription:
    """The description in the bytes of a map.yaml.

    Raises
    ------
    InputError
        Naming the key, its value, and what would be right.
    """
    values = _flat_yaml(data.decode("utf-8-sig", errors="replace"), name)
    for key in ("image", "resolution", "origin"):
        if key not in values:
            raise InputError(f"{name}: has no {key}; a map.yaml says image, resolution and origin")
    found = MapDescription(
        image=str(values["image"]),
        resolution=_number(values, "resolution", name),
        origin=_origin(values["origin"], name),
        negate=_flag(values.get("negate", "0"), name),
        occupied_thresh=_number(values, "occupied_thresh", name, 0.65),
        free_thresh=_number(values, "free_thresh", name, 0.196),
        mode=str(values.get("mode", "trinary")).lower(),
    )
    _check(found, name)
    return found


def _check(found: MapDescription, name: str) -> None:
    if not 1e-3 <= found.resolution <= 1.0:
        raise InputError(f"{name}: resolution = {found.resolution:g}: metres per pixel, from 0.001 to 1")
    if found.mode not in _MODES:
        raise InputError(f"{name}: mode = {found.mode}: known: {', '.join(_MODES)}")
    if not 0 <= found.free_thresh <= found.occupied_thresh <= 1:
        raise InputError(
            f"{name}: free_thresh = {found.free_thresh:g}, occupied_thresh = {found.occupied_thresh:g}: "
            "write 0 <= free_thresh <= occupied_thresh <= 1"
        )


def _flat_yaml(text: str, name: str) -> dict[str, str | list[str]]:
    """Keys with a word or a list of words: all that a map.yaml holds."""
    values: dict[str, str | list[str]] = {}
    key = ""
    for number, line in enumerate(text.splitlines(), start=1):
        plain = re.sub(r"(^|\s)#.*$", "", line).rstrip()
        if not plain.strip() or plain.strip() == "---":
            continue
        item = re.match(r"\s*-\s+(.*)$", plain)
        entry = re.match(r"(\w+)\s*:\s*(.*)$", plain)
        if item and key:
            values[key] = [*(values[key] if isinstance(values[key], list) else []), _word(item.group(1))]
        elif entry:
            key, value = entry.group(1), entry.group(2).strip()
            listed = re.match(r"\[(.*)\]$", value)
            values[key] = list(map(_word, listed.group(1).split(","))) if listed else _word(value)
        else:
            raise InputError(f"{name}: line {number} is not 'key: value'; a map.yaml has {', '.join(_KNOWN)}")
    return values


def _word(text: str) -> str:
    return text.strip().strip("'\"")


def _number(values: dict[str, str | list[str]], key: str, name: str, default: float | None = None) -> float:
    value = values.get(key, default)
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"{name}: {key} = {value}: must be a number") from None
    if not math.isfinite(number):
        raise InputError(f"{name}: {key} = {value}: must be a finite number")
    return number


def _origin(value: object, name: str) -> tuple[float, float, float]:
    try:
        x, y, yaw = map(float, value)  # type: ignore[call-overload]
    except (TypeError, ValueError):
        raise InputError(f"{name}: origin = {value}: write [x, y, yaw]") from None
    if not all(math.isfinite(item) and abs(item) < 1e9 for item in (x, y, yaw)):
        raise InputError(f"{name}: origin = {value}: must be finite numbers")
    return x, y, yaw


def _flag(value: object, name: str) -> bool:
    known = {"0": False, "1": True, "false": False, "true": True}
    flag = known.get(str(value).lower())
    if flag is None:
        raise InputError(f"{name}: negate = {value}: write 0 or 1")
    return flag
