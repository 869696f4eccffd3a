"""A file of numbered entries that grows at its end; an entry is read exactly as written, or not at all.

Each entry is on disk when `append` returns. An entry that a killed program or a full disk left incomplete is
removed when the file is opened. An entry that the disk has damaged is skipped.
"""

from __future__ import annotations

import contextlib
import os
import struct
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_HEAD = struct.Struct(">4sIII")
"""Mark, number, length and checksum of what follows."""
_MARK = b"\x91sg\n"
_AT_ONCE = 1 << 20
"""Bytes that are searched for the next entry at once."""
_to_disk = getattr(os, "fdatasync", os.fsync)  # macOS has the second only


class RecordFile:
    """Numbered entries; the methods may be called from any thread."""

    def __init__(self, handle: int, *, writing: bool = True) -> None:
        """`handle` is an open file; if it is opened for `writing`, an incomplete end is removed."""
        self._handle = handle
        self._lock = threading.Lock()
        self._offsets: dict[int, int] = {}  # read once, without damaged entries
        self.size = 0
        """Bytes up to the end of the newest entry."""
        for number, at, size in _entries(handle):
            self._offsets[number] = at
            self.size = at + size
        if writing:
            os.ftruncate(handle, self.size)
        self.newest = max(self._offsets, default=0)

    def append(self, number: int, body: bytes) -> None:
        """Write an entry after the others.

        Raises
        ------
        OSError
            If the disk is full; the file is then unchanged.
        """
        packed = zlib.compress(body, 1)
        whole = _HEAD.pack(_MARK, number, len(packed), _checksum(number, packed)) + packed
        with self._lock:
            try:
                _write(self._handle, whole, self.size)
                _to_disk(self._handle)
            except OSError:
                with contextlib.suppress(OSError):
                    os.ftruncate(self._handle, self.size)
                raise
            self._offsets[number] = self.size
            self.size += len(whole)
            self.newest = number

    def read(self, number: int) -> bytes | None:
        """Return an entry as it was written; `None` if there is none, or it is damaged."""
        with self._lock:
            at = self._offsets.get(number)
            found = None if at is None else _entry_at(self._handle, at)
        return None if found is None else zlib.decompress(found[1])


@contextmanager
def open_record_file(path: Path) -> Iterator[RecordFile]:
    """Open the file at `path`, made if there is none; raises OSError if that fails."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o644)
    try:
        yield RecordFile(handle)
    finally:
        os.close(handle)


@contextmanager
def read_record_file(path: Path) -> Iterator[RecordFile]:
    """Open the file at `path` for reading, also while it grows; raises OSError if there is none."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    try:
        yield RecordFile(handle, writing=False)
    finally:
        os.close(handle)


def _entries(handle: int) -> Iterator[tuple[int, int, int]]:
    """Yield number, offset and size of every sound entry; bytes between two entries are skipped."""
    at, end = 0, os.fstat(handle).st_size
    while at < end:
        found = _entry_at(handle, at)
        if found is None:
            at = _next_mark(handle, at + 1, end)
        else:
            number, packed = found
            yield number, at, _HEAD.size + len(packed)
            at += _HEAD.size + len(packed)


def _next_mark(handle: int, at: int, end: int) -> int:
    """Return the offset where the next entry may begin; the end if there is none."""
    for start in range(at, end, _AT_ONCE):
        found = os.pread(handle, _AT_ONCE + len(_MARK) - 1, start).find(_MARK)
        if found >= 0:
            return start + found
    return end


def _entry_at(handle: int, at: int) -> tuple[int, bytes] | None:
    head = os.pread(handle, _HEAD.size, at)
    if len(head) < _HEAD.size:
        return None
    mark, number, length, checksum = _HEAD.unpack(head)
    if mark != _MARK or length > os.fstat(handle).st_size - at - _HEAD.size:  # the length is damaged
        return None
    packed = os.pread(handle, length, at + _HEAD.size)
    sound = len(packed) == length and _checksum(number, packed) == checksum
    return (number, packed) if sound else None


def _checksum(number: int, packed: bytes) -> int:
    return zlib.crc32(packed, number)


def _write(handle: int, data: bytes, at: int) -> None:
    while data:
        written = os.pwrite(handle, data, at)
        data, at = data[written:], at + written
