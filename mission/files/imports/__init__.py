"""Import of missions from other programs' formats: one module per format, one line in `READERS`."""

from __future__ import annotations

import hashlib
from pathlib import Path

from stopgo.mission.document import Mission
from stopgo.mission.document.specs import site_origin_of
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import bytes_of
from stopgo.mission.files.imports import qgc_plan, qgc_waypoints, stops_csv
from stopgo.mission.files.imports.assembling import mission_of
from stopgo.mission.files.imports.track import ImportedRoute, ImportOptions, MissionReader
from stopgo.mission.settings import Settings

READERS: dict[str, MissionReader] = {
    "plan": qgc_plan.read,
    "waypoints": qgc_waypoints.read,
    "csv": stops_csv.read,
}
"""Every readable format by its name, which `--from` takes and which is also its suffix."""

LARGEST = 64_000_000
"""Bytes; no mission is larger."""


def read_mission(
    path: Path, settings: Settings, *, kind: str | None = None, autopilot: str | None = None
) -> tuple[Mission, ImportedRoute]:
    """Return the mission in a file of a format of `READERS`, and the track that was read.

    Raises
    ------
    InputError
        Naming the file, the problem in it, and the action.
    """
    reader = READERS[_kind(path, kind)]
    data = bytes_of(path, "give a file to import", most=LARGEST)
    track = reader(data, str(path), ImportOptions(site_origin_of(settings), autopilot))
    digest = hashlib.sha256(data).hexdigest()
    return mission_of(track, settings, name=path.stem, file=path.name, digest=digest), track


def _kind(path: Path, given: str | None) -> str:
    known = ", ".join(f".{name}" for name in READERS)
    if given is None and path.suffix.lower().removeprefix(".") not in READERS:
        raise InputError(
            f"{path}: files with this suffix are not read; known: {known} (or name one with --from)"
        )
    name = path.suffix.lower().removeprefix(".") if given is None else given
    if name not in READERS:
        raise InputError(f"--from {name}: no such format; known: {', '.join(READERS)}")
    return name
