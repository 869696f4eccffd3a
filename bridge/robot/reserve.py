"""Disk space that is reserved for commands and events, whatever else fills the disk."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

RESERVE_BYTES = 4 * 1024 * 1024
"""Enough for hundreds of commands and events, with the journal's write-ahead log."""
LEAST_FREE_BYTES = 1024 * 1024
"""With less free space than this, the reserve is given up."""


class Reserve:
    """A file that occupies space until the space is needed."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def make(self) -> None:
        """Occupy the space, if the disk has enough of it; else do nothing."""
        if self._is_whole() or self._free() < RESERVE_BYTES + LEAST_FREE_BYTES:
            return
        with contextlib.suppress(OSError), self._path.open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, RESERVE_BYTES)
            else:  # macOS
                file.write(bytes(RESERVE_BYTES))

    def release_if_needed(self) -> None:
        """Give up the space when the disk is nearly full."""
        if self._free() < LEAST_FREE_BYTES:
            with contextlib.suppress(OSError):
                self._path.unlink(missing_ok=True)

    def shortage(self, size: int) -> str:
        """Return why `size` more bytes are too many; empty if they leave the reserve whole."""
        self.make()
        reserved = 0 if self._is_whole() else RESERVE_BYTES
        free = self._free()
        if free >= size + reserved + LEAST_FREE_BYTES:
            return ""
        megabyte = 1024 * 1024
        return (
            f"{size / megabyte:.1f} MB are needed besides the reserve for commands,"
            f" and {free / megabyte:.1f} MB are free; make room on the robot's disk"
        )

    def _is_whole(self) -> bool:
        """True if the file has its full size; one that a killed program began has not."""
        try:
            return self._path.stat().st_size >= RESERVE_BYTES
        except FileNotFoundError:
            return False

    def _free(self) -> int:
        return shutil.disk_usage(self._path.parent).free
