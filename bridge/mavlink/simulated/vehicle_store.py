"""What the vehicle keeps when switched off: its items, and where it stands; one file, replaced whole."""

from __future__ import annotations

import os
from pathlib import Path

import msgspec

from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.items import Item
from stopgo.mission.run.events import Pose

KeptItems = tuple[Item, ...]
MISSION, FENCE, RALLY, ALL = 0, 1, 2, 255
"""MAV_MISSION_TYPE."""


class Kept(msgspec.Struct, frozen=True, kw_only=True):
    """All that outlives the vehicle's process."""

    mission: KeptItems = ()
    """Numbered as on the vehicle: item 0 is home where the autopilot has it so."""
    fence: KeptItems = ()
    rally: KeptItems = ()
    pose: Pose | None = None
    """Metres east and north of the origin, radians counter-clockwise from east."""
    images: int = 0
    """How many scans were taken, ever."""


class Store:
    """What is kept, in a file if there is one."""

    def __init__(self, folder: Path | None) -> None:
        self._path = None if folder is None else folder / "vehicle.msgpack"
        if folder is not None:
            _make(folder)
        self.kept = _read(self._path)

    def items(self, kind: int) -> KeptItems:
        return {MISSION: self.kept.mission, FENCE: self.kept.fence, RALLY: self.kept.rally}[kind]

    def put(self, kind: int, items: KeptItems) -> None:
        self.keep(**{{MISSION: "mission", FENCE: "fence", RALLY: "rally"}[kind]: items})

    def keep(self, **changed: object) -> None:
        self.kept = msgspec.structs.replace(self.kept, **changed)
        if self._path is not None:
            beside = self._path.with_suffix(".new")
            beside.write_bytes(msgspec.msgpack.encode(self.kept))
            os.replace(beside, self._path)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--state {folder}: cannot be made ({error.strerror})") from None


def _read(path: Path | None) -> Kept:
    if path is None or not path.exists():
        return Kept()
    try:
        return msgspec.msgpack.decode(path.read_bytes(), type=Kept)
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(
            f"{path}: is not what a simulated vehicle keeps ({error}); remove it to begin anew"
        ) from None
