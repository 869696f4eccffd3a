"""Refusal of messages and chunks that are too long, by their lengths, before they are read into memory."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, NamedTuple

from stopgo.mission.errors import InputError

LONGEST_MESSAGE = 1 << 20
"""Bytes of one pose, fix or set of transforms at most: ten thousand transforms."""
LARGEST_CHUNK = 256 << 20
"""Bytes of an MCAP's chunk, or of one sweep, at most: a recorder's chunk has a few MB, or one message."""
MCAP_MAGIC = b"\x89MCAP0\r\n"
_LONG = (
    "SELECT topics.name, topics.type, length(messages.data) FROM messages JOIN topics"
    " ON messages.topic_id = topics.id WHERE topics.type = ? AND typeof(messages.data) = 'blob'"
    " AND length(messages.data) > ? LIMIT 1"
)

Longest = Mapping[str, int]
"""Bytes that a message may have at most, by the types that are read."""


def check_rows(connection: Any, path: object, longest: Longest) -> None:
    """Refuse a database with a message that is too long; SQLite knows lengths without reading the data."""
    known = {kind for (kind,) in connection.execute("SELECT DISTINCT type FROM topics")}
    for kind in sorted(known & set(longest)):
        for topic, _, length in connection.execute(_LONG, (kind, longest[kind])):
            raise InputError(_too_long(path, topic, kind, length, longest[kind]))


def _too_long(path: object, topic: str, kind: str, length: int, most: int) -> str:
    return (
        f"{path}: a message of {length} bytes on {topic}, more than {most}, as no {kind} has; "
        "leave that topic out of the bag"
    )


def check_mcap(path: Path, longest: Longest) -> None:
    """Refuse an MCAP with a message or chunk that is too long; chunks that nothing is read from may be."""
    found = _Walk({}, {}, {}, {}, [])
    with path.open("rb") as file:
        if file.read(len(MCAP_MAGIC)) != MCAP_MAGIC:
            return
        with mmap(file.fileno(), 0, access=ACCESS_READ) as data:
            for operation, body, length in _records(data):
                try:
                    found.add(operation, memoryview(data)[body : body + min(length, HEAD)], body, length)
                except (struct.error, UnicodeDecodeError):
                    continue  # rosbags finds the damage
    for channel, (length, _) in found.long_messages.items():
        topic, kind = found.channels.get(channel, ("", ""))
        if length > longest.get(kind, length):
            raise InputError(_too_long(path, topic, kind, length, longest[kind]))
    for start, length in found.large_chunks:
        channels = found.indexed.get(start)
        if channels is None or any(found.channels.get(c, ("", ""))[1] in longest for c in channels):
            raise InputError(
                f"{path}: a chunk of {length} bytes, more than {LARGEST_CHUNK}; write the file with smaller "
                "chunks, or without the large topic: mcap filter"
            )


HEAD = 1 << 16
"""Bytes of a record that are looked at."""


def _records(data: mmap) -> Iterator[tuple[int, int, int]]:
    """Yield operation, begin and length of the records of a file, as far as they are valid."""
    at = len(MCAP_MAGIC)
    while at + 9 <= len(data):
        operation, length = struct.unpack_from("<BQ", data, at)
        if not 0 < operation < 0x80:
            return
        yield operation, at + 9, length
        at += 9 + length


class _Walk(NamedTuple):
    """Lengths and topics that the records of a file name."""

    schemas: dict[int, str]
    channels: dict[int, tuple[str, str]]
    indexed: dict[int, tuple[int, ...]]
    """Channels in each chunk, by the chunk's place."""
    long_messages: dict[int, tuple[int, int]]
    """Longest message of each channel outside of chunks, and its place."""
    large_chunks: list[tuple[int, int]]
    """Place and length of each."""

    def add(self, operation: int, head: memoryview, body: int, length: int) -> None:
        if operation == 0x03:
            self.schemas[_number(head, 0)] = _text(head, 2)[0]
        elif operation == 0x04:
            self.channels[_number(head, 0)] = (_text(head, 4)[0], self.schemas.get(_number(head, 2), ""))
        elif operation == 0x05:
            channel = _number(head, 0)
            self.long_messages[channel] = max(self.long_messages.get(channel, (0, 0)), (length - 22, body))
        elif operation == 0x06:
            unpacked = max(length, struct.unpack_from("<Q", head, 16)[0], _frame(head))
            if unpacked > LARGEST_CHUNK:
                self.large_chunks.append((body - 9, unpacked))
        elif operation == 0x08:
            (start,) = struct.unpack_from("<Q", head, 16)
            (size,) = struct.unpack_from("<I", head, 32)
            self.indexed[start] = tuple(k for k, _ in struct.iter_unpack("<HQ", head[36 : 36 + size]))


def _number(head: memoryview, at: int) -> int:
    return int(struct.unpack_from("<H", head, at)[0])


def _text(head: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", head, at)
    return bytes(head[at + 4 : at + 4 + length]).decode("utf-8"), at + 4 + length


def _frame(head: memoryview) -> int:
    """Length that the compressed data of a chunk states for itself; 0 if it does not."""
    from stopgo.recordings.logs.zstandard import zstd

    compression, at = _text(head, 28)
    if compression != "zstd":
        return 0
    try:
        return zstd.get_frame_info(bytes(head[at + 8 : at + 8 + 18])).decompressed_size or 0
    except zstd.ZstdError:
        return 0


__all__ = ["LARGEST_CHUNK", "LONGEST_MESSAGE", "Longest", "check_mcap", "check_rows"]
