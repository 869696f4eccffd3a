"""A recording that is written piece by piece, and waits in memory while the disk has no room for it."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable
from io import FileIO
from pathlib import Path

HEADER = 12
"""Bytes at the start of a recording: Rerun's mark, its version and options."""
MESSAGE = struct.Struct("<QQ")
"""What stands before each message: its kind, and how many bytes it has."""
MOST_WAITING = 256 << 20
"""Bytes that may wait in memory: hours of a run, and less than any machine that watches one has."""
END = 0
"""The kind of a recording's last message; what follows tells where things stand in the file."""


def messages(recording: bytes) -> bytes:
    """A recording without its header, and without its end, which holds for this recording alone."""
    at = HEADER
    while True:
        kind, size = MESSAGE.unpack_from(recording, at)
        if kind == END:
            return recording[HEADER:at]
        at += MESSAGE.size + size


class Pieces:
    """A file that recordings are added to, one after another; together they are one without an end.

    Pieces that find no room on the disk wait in memory, in their order, as long as they are not too much for
    it. The file holds whole pieces only.
    """

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self.path = path
        self.fault: str | None = None
        """Why the file does not hold all that was added to it, if it does not."""
        self._say = say
        self._file: FileIO | None = None
        self._whole = 0
        self._waiting: deque[bytes] = deque()
        self._lost = False

    def add(self, recording: bytes) -> None:
        """Add a recording, and before it what has waited for room."""
        if recording and not self._lost:
            first = self._whole == 0 and not self._waiting
            self._waiting.append(recording[:HEADER] * first + messages(recording))
        try:
            self._write()
        except OSError as error:
            self._lost = self._lost or sum(map(len, self._waiting)) > MOST_WAITING
            self._tell(error.strerror or "unknown")
        else:
            self._tell("too much waited for room" if self._lost else None)

    def close(self) -> None:
        """Try once more to write what waits, and close the file, which goes if nothing could be written."""
        self.add(b"")
        if self._file is not None:
            self._file.close()
        if not self._whole:
            self.path.unlink(missing_ok=True)

    def _write(self) -> None:
        if self._file is None:
            self._file = self.path.open("xb", buffering=0)
        try:
            self._file.seek(self._whole)
            while self._waiting:
                piece = memoryview(self._waiting[0])
                while piece:
                    piece = piece[self._file.write(piece) :]
                self._whole = self._file.tell()
                self._waiting.popleft()
        finally:
            self._file.truncate(self._whole)  # a piece that was only begun is taken back

    def _tell(self, fault: str | None) -> None:
        """Say once that there is no room, and once that there is again."""
        if fault is not None and self.fault is None:
            self._say(f"{self.path}: cannot be written ({fault}); the recording waits in memory for room")
        if fault is None and self.fault is not None:
            self._say(f"{self.path}: there is room again; what waited is written")
        self.fault = fault
