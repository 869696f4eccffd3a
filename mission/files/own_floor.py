"""Check that a floor's file is the one that a mission was planned on."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from stopgo.mission.errors import OtherFloor
from stopgo.mission.files.given_file import bytes_of

if TYPE_CHECKING:
    from pathlib import Path

    from stopgo.mission.document import Mission


def must_be_own_floor(path: Path, mission: Mission) -> None:
    """Check that a mission was planned on a floor's file.

    Raises
    ------
    OtherFloor
        When the file's digest is not the mission's.
    InputError
        When the file cannot be read.
    """
    digest = hashlib.sha256(bytes_of(path, "give the floor's file")).hexdigest()
    planned = mission.origin
    if digest != planned.floor_digest:
        raise OtherFloor(
            f"{path}: is not the floor that {mission.name} was planned on (sha256 {digest[:12]}…, not "
            f"{planned.floor_digest[:12]}…); give {planned.floor}, or plan again"
        )
