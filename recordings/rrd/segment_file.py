"""Recording file written in segments; segments wait in memory while the disk is full."""

from __future__ import annotations

import itertools
import os
import shutil
import struct
from collections import deque
from collections.abc import Callable
from io import FileIO
from pathlib import Path

HEADER = 12
"""Bytes at the start of a recording: Rerun's mark, version and options."""
MESSAGE = struct.Struct("<QQ")
"""Header of each message: its kind, and its length in bytes."""
MOST_WAITING = 256 << 20
"""Limit of the bytes that wait in memory: hours of a run."""
END = 0
"""Kind of a recording's last message; an index of the file follows it."""


def messages(recording: bytes) -> bytes:
    """Return a recording without its header, and without its end, which is valid only for this recording."""
    at = HEADER
    while True:
        kind, size = MESSAGE.unpack_from(recording, at)
        if kind == END:
            return recording[HEADER:at]
        at += MESSAGE.size + size


class SegmentFile:
    """File to which recordings are added one after another; together they form one recording without an end.

    Segments that find no room on the disk wait in memory in their order, up to MOST_WAITING bytes. The file
    contains whole segments only. If it is deleted or moved meanwhile, it is written again. Its name is no
    other file's: other writers may begin at the same time, and earlier ones may have been killed.
    """

    def __init__(self, stem: Path, say: Callable[[str], None]) -> None:
        """`stem` is the path without a suffix; what is taken gets a number."""
        self._stem = stem
        self.path = stem.with_name(f"{stem.name}.rrd")
        self.fault: str | None = None
        """Reason why the file is not complete; None if it is."""
        self._say = say
        self._file: FileIO | None = None
        self._written = 0
        self._waiting: deque[bytes] = deque()
        self._dropped = False

    def add(self, recording: bytes) -> None:
        """Add a recording; segments that wait for room are written first."""
        if recording and not self._dropped:
            first = self._written == 0 and not self._waiting
            self._waiting.append(recording[:HEADER] * first + messages(recording))
        try:
            self._write()
        except OSError as error:
            self._dropped = self._dropped or sum(map(len, self._waiting)) > MOST_WAITING
            self._report(error.strerror or "unknown")
        else:
            self._report("too much data waited for room" if self._dropped else None)

    def close(self) -> None:
        """Try again to write waiting segments, and close the file; delete it if nothing could be written."""
        self.add(b"")
        if self._file is not None:
            self._file.close()
            if not self._written:
                self.path.unlink(missing_ok=True)

    def _write(self) -> None:
        if self._file is None:
            self._file = self._made()
        elif not self._is_at_its_path(self._file):
            self._file = self._copied_back(self._file)
        try:
            self._file.seek(self._written)
            while self._waiting:
                segment = memoryview(self._waiting[0])
                while segment:
                    segment = segment[self._file.write(segment) :]
                self._written = self._file.tell()
                self._waiting.popleft()
        finally:
            self._file.truncate(self._written)  # remove an incomplete segment

    def _made(self) -> FileIO:
        """Make the file with the first name that is free, and return it."""
        for number in itertools.count(2):
            try:
                return self.path.open("x+b", buffering=0)
            except FileExistsError:
                self.path = self._stem.with_name(f"{self._stem.name}-{number}.rrd")
        raise AssertionError  # there is always a free name

    def _is_at_its_path(self, file: FileIO) -> bool:
        """False if somebody has deleted or moved the file; its open descriptor still has what was written."""
        try:
            return os.path.samestat(os.fstat(file.fileno()), self.path.stat())
        except FileNotFoundError:
            return False

    def _copied_back(self, lost: FileIO) -> FileIO:
        """Copy what was written to a new file at the path, and return it; raises OSError on failure."""
        copy = self._made()
        try:
            lost.seek(0)
            with open(copy.fileno(), "wb", closefd=False) as out:
                shutil.copyfileobj(lost, out)
        except OSError:
            copy.close()
            self.path.unlink(missing_ok=True)
            raise
        lost.close()
        return copy

    def _report(self, fault: str | None) -> None:
        """Report once that the disk is full, and once that it has room again."""
        if fault is not None and self.fault is None:
            self._say(f"{self.path}: cannot be written ({fault}); the recording waits in memory for room")
        if fault is None and self.fault is not None:
            self._say(f"{self.path}: the disk has room again; waiting data was written")
        self.fault = fault
