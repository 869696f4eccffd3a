"""The folder of an entry's result: the files that `stopgo plan` writes, copied whole from the store."""

from __future__ import annotations

from pathlib import Path

import msgspec

from stopgo.batches.entry_content import ENTRY_FILE, EntryContent
from stopgo.batches.store import Result
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import replacing, write_atomic
from stopgo.mission.files.given_file import file_digest
from stopgo.planner.commands.outputs import NAMES, set_aside_file

LAST = "mission"
"""Files that begin so are replaced last: who sees a new mission sees its companions, too."""


def take_result(source: Path, result: Result, folder: Path, content: EntryContent) -> None:
    """Bring an entry's folder to a result; files of an earlier plan that it does not have get `.old`.

    Raises
    ------
    InputError
        When the folder cannot be written, or the store's files do not arrive whole.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be created ({error.strerror})") from None
    names = sorted(result.files, key=lambda name: (name.startswith(LAST), name))
    stale = [name for name in names if not _has(folder / name, result.files[name])]
    with replacing(*(folder / name for name in stale)) as paths:
        for name, path in zip(stale, paths, strict=True):
            data = (source / name).read_bytes()
            path.write_bytes(data)
            if file_digest(path) != result.files[name][1]:
                raise InputError(f"{source / name}: did not arrive whole; run the batch again")
    _set_aside_others(folder, set(names))
    data = msgspec.json.encode(content)
    if not (folder / ENTRY_FILE).is_file() or (folder / ENTRY_FILE).read_bytes() != data:
        write_atomic(folder / ENTRY_FILE, data)


def _has(path: Path, facts: tuple[int, str]) -> bool:
    size, sha256 = facts
    return path.is_file() and path.stat().st_size == size and file_digest(path) == sha256


def _set_aside_others(folder: Path, names: set[str]) -> None:
    """Rename missions, recordings and pictures of an earlier plan that the present one does not have."""
    for name in NAMES.values():
        stem, _, suffix = name.partition(".")
        for path in sorted(folder.glob(f"{stem}*.{suffix}")):
            if path.name not in names and (path.stem == stem or path.stem.startswith(f"{stem}-")):
                set_aside_file(path)
