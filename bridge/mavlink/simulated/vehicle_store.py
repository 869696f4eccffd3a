"""State that outlives the simulated vehicle: its items and its pose; one file, replaced whole."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from stopgo.mission.document.decoding import unpacked
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.items import Item
from stopgo.mission.run.events import Pose

StoredItems = tuple[Item, ...]
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
"""MAV_MISSION_TYPE."""


class StoredState(msgspec.Struct, frozen=True, kw_only=True):
    """All that outlives the vehicle's process."""

    mission: StoredItems = ()
    """Numbered as on the vehicle: item 0 is home where the autopilot has it so."""
    fence: StoredItems = ()
    rally: StoredItems = ()
    pose: Pose | None = None
    """Metres east and north of the origin, radians counter-clockwise from east."""
    images: int = 0
    """Number of scans taken, ever."""


class Store:
    """The stored state, in a file if a folder is given."""

    def __init__(self, folder: Path | None) -> None:
        self._path = None if folder is None else folder / "vehicle.msgpack"
        if folder is not None:
            _make(folder)
        self.stored = _read(self._path)

    def items(self, kind: int) -> StoredItems:
        return {MISSION: self.stored.mission, FENCE: self.stored.fence, RALLY: self.stored.rally}[kind]

    def put(self, kind: int, items: StoredItems) -> None:
        self.update(**{{MISSION: "mission", FENCE: "fence", RALLY: "rally"}[kind]: items})

    def update(self, **changed: object) -> None:
        self.stored = msgspec.structs.replace(self.stored, **changed)
        if self._path is not None:
            new = self._path.with_suffix(".new")
            new.write_bytes(msgspec.msgpack.encode(self.stored))
            os.replace(new, self._path)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--state {folder}: cannot be made ({error.strerror})") from None


def _read(path: Path | None) -> StoredState:
    if path is None or not path.exists():
        return StoredState()
    try:
        return unpacked(path.read_bytes(), StoredState)
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(
            f"{path}: not a simulated vehicle's state ({error}); remove it to begin again"
        ) from None
