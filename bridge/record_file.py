"""A file of numbered entries that grows at its end, and gives back exactly what was written or nothing.

Each entry is on disk when `append` returns. One that a killed program or a full disk has left unfinished is
taken off when the file is opened; one that the disk has changed since is as if it were not there.
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
"""Bytes that are searched for the next entry in one go."""
_to_disk = getattr(os, "fdatasync", os.fsync)  # macOS has the second only


class RecordFile:
    """Numbered entries; the methods may be called from any thread."""

    def __init__(self, handle: int, *, writing: bool = True) -> None:
        """`handle` is of a file that is open; what is unfinished is cut off if it is for `writing` too."""
        self._handle = handle
        self._lock = threading.Lock()
        self._places: dict[int, int] = {}  # read once, so that what is damaged is not among them
        self.size = 0
        """Bytes up to the end of the newest entry."""
        for number, at, size in _entries(handle):
            self._places[number] = at
            self.size = at + size
        if writing:
            os.ftruncate(handle, self.size)
        self.newest = max(self._places, default=0)

    def append(self, number: int, body: bytes) -> None:
        """Write an entry behind the others.

        Raises
        ------
        OSError
            If there is no room; the file is then as it was.
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
            self._places[number] = self.size
            self.size += len(whole)
            self.newest = number

    def read(self, number: int) -> bytes | None:
        """An entry as it was written; none if there is none, or the disk has changed it."""
        with self._lock:
            at = self._places.get(number)
            found = None if at is None else _entry_at(self._handle, at)
        return None if found is None else zlib.decompress(found[1])


@contextmanager
def open_record_file(path: Path) -> Iterator[RecordFile]:
    """The file at `path`, made if there is none; raises OSError if it cannot be."""
    handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o644)
    try:
        yield RecordFile(handle)
    finally:
        os.close(handle)


@contextmanager
def read_record_file(path: Path) -> Iterator[RecordFile]:
    """The file at `path` as it is, also while it grows; raises OSError if there is none."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
    try:
        yield RecordFile(handle, writing=False)
    finally:
        os.close(handle)


def _entries(handle: int) -> Iterator[tuple[int, int, int]]:
    """Number, place and size of every sound entry; what lies between two is passed over."""
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
    """Where the next entry may begin; the end if there is none."""
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
    if mark != _MARK or length > os.fstat(handle).st_size - at - _HEAD.size:  # a length that is none
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
