"""Disk space that is kept free for stops and events, whatever else fills the disk."""

from __future__ import annotations

import contextlib
import os
import shutil
from pathlib import Path

RESERVE_BYTES = 4 * 1024 * 1024
"""Hundreds of orders and events, with the log that the journal writes them to first."""
LEAST_FREE_BYTES = 1024 * 1024
"""Below this the reserve is let go."""


class Reserve:
    """A file that takes up space until the space is needed."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def make(self) -> None:
        """Take up the space, if there is more than enough of it; else the disk is as full as it is."""
        if self._is_whole() or self._free() < RESERVE_BYTES + LEAST_FREE_BYTES:
            return
        with contextlib.suppress(OSError), self._path.open("wb") as file:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, RESERVE_BYTES)
            else:  # macOS
                file.write(bytes(RESERVE_BYTES))

    def release_if_needed(self) -> None:
        """Let the space go when the disk is nearly full."""
        if self._free() < LEAST_FREE_BYTES:
            with contextlib.suppress(OSError):
                self._path.unlink(missing_ok=True)

    def shortage(self, size: int) -> str:
        """Why `size` more bytes are too many; empty if the reserve stays whole beside them."""
        self.make()
        kept = 0 if self._is_whole() else RESERVE_BYTES
        free = self._free()
        if free >= size + kept + LEAST_FREE_BYTES:
            return ""
        megabyte = 1024 * 1024
        return (
            f"{size / megabyte:.1f} MB are needed beside what is kept free for stops,"
            f" and {free / megabyte:.1f} MB are free: make room on the robot's disk"
        )

    def _is_whole(self) -> bool:
        """Whether the file takes up its space; one that a killed program began does not."""
        try:
            return self._path.stat().st_size >= RESERVE_BYTES
        except FileNotFoundError:
            return False

    def _free(self) -> int:
        return shutil.disk_usage(self._path.parent).free
