"""Check that a floor's file is the one that a mission was planned on."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from stopgo.mission.errors import InputError, OtherFloor

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
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the floor's file") from None
    planned = mission.origin
    if digest != planned.floor_digest:
        raise OtherFloor(
            f"{path}: is not the floor that {mission.name} was planned on (sha256 {digest[:12]}…, not "
            f"{planned.floor_digest[:12]}…); give {planned.floor}, or plan again"
        )
