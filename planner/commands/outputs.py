"""Names of a plan's files in their folder, and renaming of the files that an earlier plan left there."""

from __future__ import annotations

import os
import re
from itertools import count
from pathlib import Path

from stopgo.mission import __version__
from stopgo.mission.document import mission_id
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.errors import InputError
from stopgo.mission.files.mission_json import read
from stopgo.mission.settings import Settings

NAMES = {
    "mission": "mission.json",
    "recording": "plan.rrd",
    "picture": "plan.svg",
    "coverage": "coverage.json",
    "sheets": "plan.pdf",
}


def names(folder: Path, number: int) -> dict[str, Path]:
    """Return the paths of a part's files: the first part's as in NAMES, then with -2, -3 …"""
    suffix = "" if number == 0 else f"-{number + 1}"
    paths = {key: folder / name for key, name in NAMES.items()}
    return {key: path.with_name(f"{path.stem}{suffix}{path.suffix}") for key, path in paths.items()}


def set_aside(folder: Path, parts: int, source: FloorSource, settings: Settings) -> list[Path]:
    """Rename the files of other plans, so that nobody takes them for parts of this plan.

    This plan has `parts` parts. A mission with a higher number stays if the same floor and settings would
    give it again. Otherwise it and its companion files get the suffix `.old`. A file that is not a mission
    stays. Returns the new names.
    """
    moved = []
    for number in _other_parts(folder, parts):
        files = names(folder, number)
        if _is_other(files["mission"], mission_id(source, settings, __version__, number)):
            moved += [_renamed(path) for path in files.values() if path.exists()]
    return moved


def set_aside_file(path: Path) -> Path | None:
    """Rename a file of an earlier plan that the new plan does not have; returns its new name."""
    return _renamed(path) if path.exists() else None


def _other_parts(folder: Path, parts: int) -> list[int]:
    """Numbers of the parts beyond `parts` for which the folder has a mission."""
    found = (re.fullmatch(r"mission-([1-9]\d*)\.json", path.name) for path in folder.iterdir())
    return sorted(int(match[1]) - 1 for match in found if match and int(match[1]) > max(parts, 1))


def _is_other(path: Path, expected: str) -> bool:
    try:
        return read(path).id != expected
    except InputError:
        return False


def _renamed(path: Path) -> Path:
    """Move a file to the first free name of `NAME.old`, `NAME.old2`, …"""
    old = next(
        old for n in count(1) if not (old := path.with_name(f"{path.name}.old{n if n > 1 else ''}")).exists()
    )
    os.replace(path, old)
    return old
