"""The bytes of a file that a user names, also of a pipe that somebody writes to."""

from __future__ import annotations

import os
from pathlib import Path

from stopgo.mission.errors import InputError

NEVER_ENDS = "is a device, which may never end; name a file"
NOBODY_WRITES = "is a pipe that nobody writes to, and reading it would never end; name a file"


def whole_file(path: Path) -> bytes:
    """Return all bytes of a file, or of a pipe such as that of `<(command)`.

    Raises
    ------
    InputError
        If it is a device, or a pipe without a writer: reading might never end.
    OSError, ValueError
        As of `Path.read_bytes`.
    """
    if path.is_fifo():
        return _whole_pipe(path)
    must_end(path)
    return path.read_bytes()


def must_end(path: Path) -> None:
    """Refuse a device, and a pipe, which can be read only once and may never end.

    Raises
    ------
    InputError
        Naming it.
    """
    if path.is_char_device() or path.is_block_device():
        raise InputError(f"{path}: {NEVER_ENDS}")
    if path.is_fifo():
        raise InputError(f"{path}: is a pipe, which can be read only once; save it as a file")


def _whole_pipe(path: Path) -> bytes:
    """Return what is written to a pipe; a writer that waits for its reader counts as one."""
    pipe = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(pipe, "rb", buffering=0) as file:
        try:
            first = os.read(pipe, 1)
        except BlockingIOError:  # somebody has it open, and has not written yet
            first = b""
        else:
            if not first:
                raise InputError(f"{path}: {NOBODY_WRITES}")
        os.set_blocking(pipe, True)
        return first + file.readall()
