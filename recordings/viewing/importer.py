"""What Rerun asks of a program that opens files for it: is the file ours, and if so, what is to be shown.

Rerun calls every `rerun-importer-*` on the PATH for every file that is opened, and reads a recording from its
stdout (https://rerun.io/docs/concepts/logging-and-ingestion/importers/overview). The code that says that a
file is another's is 66.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from stopgo.mission.document import SCHEMA, Mission
from stopgo.mission.floor import FloorPlan

NOT_OURS = 66
"""Rerun's EXTERNAL_IMPORTER_INCOMPATIBLE_EXIT_CODE; told without loading Rerun."""
FLOORS = (".dxf", ".ifc", ".ifczip")
"""What is read as a floor, whatever is in it: a damaged one is told of."""
MAPS = (".yaml", ".yml")
"""What is read as a floor if it says that it is a robot's map."""


def is_ours(path: Path) -> bool:
    """Whether a file is a mission or a floor; other JSON and YAML are left to others."""
    suffix = path.suffix.lower()
    if suffix in FLOORS:
        return path.is_file()
    if suffix == ".json":
        return SCHEMA.encode() in _bytes(path)
    return suffix in MAPS and all(key in _bytes(path) for key in (b"image:", b"resolution:", b"origin:"))


def recording_of(path: Path, recording_id: str | None, read_floor: Callable[[Path], FloorPlan]) -> bytes:
    """A mission's stops and route, or a floor, as a recording.

    A mission's has the mission's id, so that it lies on its plan and runs; a floor's has the one asked for.

    Raises
    ------
    InputError
        When the file cannot be read as what it is.
    """
    from stopgo.recordings.plan import PlanRecording

    noun = _noun(path, read_floor)
    own = noun.id if isinstance(noun, Mission) else recording_id or noun.digest
    recording = PlanRecording(own)
    recording.observe(noun)
    return recording.streamed()


def _noun(path: Path, read_floor: Callable[[Path], FloorPlan]) -> Mission | FloorPlan:
    from stopgo.mission.files.mission_json import read

    return read(path) if path.suffix.lower() == ".json" else read_floor(path)


def _bytes(path: Path) -> bytes:
    """Nothing, where it cannot be read: whoever can, may."""
    try:
        return path.read_bytes()
    except OSError:
        return b""
