"""Files of a log: checks and first bytes. The files are never changed."""

from __future__ import annotations

from pathlib import Path

from stopgo.mission.errors import InputError


def must_be_readable(path: Path) -> None:
    """Refuse a path that does not exist or is empty.

    Raises
    ------
    InputError
        When the path cannot be read; the message gives the reason.
    """
    if not path.exists():
        raise InputError(f"{path}: no such log")
    if path.is_dir():
        return
    if not path.is_file():
        raise InputError(f"{path}: not a regular file; give a log")
    if head(path, 1) == b"":
        raise InputError(f"{path}: is empty")


def head(path: Path, count: int) -> bytes:
    """Return the first bytes of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(count)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
