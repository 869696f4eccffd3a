"""Importer for Rerun: checks whether a file is ours, and returns the recording to show.

Rerun calls every `rerun-importer-*` on the PATH for every file that is opened, and reads a recording from its
stdout (https://rerun.io/docs/concepts/logging-and-ingestion/importers/overview). Exit code 66 means that
another importer must read the file.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from stopgo.mission.document import SCHEMA, Mission
from stopgo.mission.floor import FloorPlan

NOT_OURS = 66
"""Rerun's EXTERNAL_IMPORTER_INCOMPATIBLE_EXIT_CODE; known without loading Rerun."""
FLOORS = (".dxf", ".ifc", ".ifczip")
"""Suffixes of files that are read as a floor in any case: a damaged one is reported."""
MAPS = (".yaml", ".yml")
"""Suffixes of files that are read as a floor if they describe a robot's map."""


def is_ours(path: Path) -> bool:
    """True if a file is a mission or a floor; other JSON and YAML files are left to other importers."""
    suffix = path.suffix.lower()
    if suffix in FLOORS:
        return path.is_file()
    if suffix == ".json":
        return SCHEMA.encode() in _bytes(path)
    return suffix in MAPS and all(key in _bytes(path) for key in (b"image:", b"resolution:", b"origin:"))


def recording_of(path: Path, recording_id: str | None, read_floor: Callable[[Path], FloorPlan]) -> bytes:
    """Return a mission's stops and route, or a floor, as a recording.

    A mission's recording has the mission's id, so that it overlays its plan and runs; a floor's has the given
    id.

    Raises
    ------
    InputError
        When the file cannot be read as a mission or a floor.
    """
    from stopgo.recordings.plan import PlanRecording

    content = _content(path, read_floor)
    own = content.id if isinstance(content, Mission) else recording_id or content.digest
    recording = PlanRecording(own)
    recording.observe(content)
    return recording.streamed()


def _content(path: Path, read_floor: Callable[[Path], FloorPlan]) -> Mission | FloorPlan:
    from stopgo.mission.files.mission_json import read

    return read(path) if path.suffix.lower() == ".json" else read_floor(path)


def _bytes(path: Path) -> bytes:
    """Return the file's bytes; none if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError:
        return b""
