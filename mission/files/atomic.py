"""Writes a file whole or not at all: a reader, a crash or Ctrl-C never meets half of it."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path

from mission.errors import InputError


def write_atomic(path: Path | str, data: bytes) -> None:
    """Write `data` under a temporary name in the same folder, sync it to disk, then rename it.

    A symbolic link is followed; what was there before stays until the rename.

    Raises
    ------
    InputError
        When the folder is missing or cannot be written, or the disk is full; `path` is then untouched.
    """
    target = Path(os.path.realpath(path))
    _check_target(target, shown=path)
    temporary = target.parent / f".stopgo-{secrets.token_hex(6)}.tmp"
    try:
        _write_synced(temporary, data)
        os.replace(temporary, target)
        _sync_folder(target.parent)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be written ({error.strerror}); "
            f"check that the folder {target.parent} is writable and has space, or choose another"
        ) from None
    finally:
        with contextlib.suppress(OSError):  # gone after the rename, and nothing to do if it cannot go
            temporary.unlink(missing_ok=True)


def write_checked(path: Path | str, data: bytes) -> None:
    """Write as `write_atomic`, and see that the file holds what was written."""
    write_atomic(path, data)
    if Path(path).read_bytes() != data:
        raise InputError(f"{path}: does not hold what was written; is another program writing to it?")


def _check_target(target: Path, shown: Path | str) -> None:
    if str(shown) == "-":
        raise InputError("-: results are written to files, checked and whole; give a file's name")
    if not target.parent.is_dir():
        raise InputError(f"{shown}: the folder {target.parent} does not exist; create it first")
    if target.exists() and not target.is_file():
        raise InputError(f"{shown}: is not a regular file; choose another name")


def _write_synced(path: Path, data: bytes) -> None:
    # O_EXCL: never write through something that another process put there.
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _sync_folder(folder: Path) -> None:
    """Make the rename itself survive a power cut; only POSIX lets a folder be opened."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
