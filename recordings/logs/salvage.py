"""Recovery of damaged bags: they are read record by record, without their index, up to invalid bytes.

Of ROS 1 bags (format 2.0) and MCAP, every chunk that can be decompressed is used, of a truncated one its
readable part. Of SQLite, every reachable row is used. Skipped bytes or rows are counted.
"""

from __future__ import annotations

import bz2
import os
import shutil
import sqlite3
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple
from urllib.parse import quote

from stopgo.mission.errors import InputError
from stopgo.recordings.logs.bag_sizes import LARGEST_CHUNK
from stopgo.recordings.logs.bag_tables import check_salvaged

Raw = tuple[int, int, bytes]
"""Number of the connection, time of logging (ns), and the bytes."""

BAG_MAGIC = b"#ROSBAG V2.0\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
SQLITE_MAGIC = b"SQLite format 3\0"


class BagConnection(NamedTuple):
    """Topic as the bag describes it."""

    number: int
    topic: str
    msgtype: str
    """Message type with `/msg/` in the middle, as ROS 2 writes it."""
    definition: str
    encoding: str = ""
    """Encoding of the messages, where the bag names it: `cdr`, `json`, `protobuf`."""


@dataclass
class Salvaged:
    """Readable content of damaged files."""

    ros2: bool
    connections: tuple[BagConnection, ...]
    messages: Callable[[], Iterator[Raw]]
    lost: Callable[[], str]


@dataclass
class _Loss:
    """Skipped data, collected during reading."""

    why: str
    lines: list[str] = field(default_factory=list)

    def add(self, line: str) -> None:
        if line not in self.lines:
            self.lines.append(line)

    def __str__(self) -> str:
        more = len(self.lines) - LOSSES_NAMED
        rest = [f"and {more} more losses"] if more > 0 else []
        return "; ".join(line for line in (self.why, *self.lines[:LOSSES_NAMED], *rest) if line)


LOSSES_NAMED = 3


class _FoundChunk(NamedTuple):
    """Reader of one kind of file: its records, each a connection or a message."""

    ros2: bool
    records: Callable[[Path, _Loss], Iterator[BagConnection | Raw]]


@contextmanager
def salvage(paths: Sequence[Path], why: str) -> Iterator[Salvaged]:
    """Read the readable part of a bag's files; `why` is the error of the regular reader.

    Raises
    ------
    InputError
        When a file is of none of these kinds.
    """
    loss = _Loss(why)
    parts = [(path, _part(path)) for path in paths]
    if len({part.ros2 for _, part in parts}) > 1:
        raise InputError(f"{paths[0].parent}: contains bags of ROS 1 and of ROS 2; give one of them")

    def read() -> Iterator[BagConnection | Raw]:
        for number, (path, part) in enumerate(parts):
            for record in part.records(path, loss):
                yield _shifted(record, number * FILES_APART)

    def messages() -> Iterator[Raw]:
        return (record for record in read() if not isinstance(record, BagConnection))

    found = {record.number: record for record in read() if isinstance(record, BagConnection)}
    yield Salvaged(parts[0][1].ros2, tuple(found.values()), messages, lambda: str(loss))


FILES_APART = 1 << 32
"""Distance of connection numbers between files: each file numbers its own from 0."""


def _shifted(record: BagConnection | Raw, by: int) -> BagConnection | Raw:
    if isinstance(record, BagConnection):
        return record._replace(number=record.number + by)
    return (record[0] + by, *record[1:])


def is_mcap(path: Path) -> bool:
    """True if a file begins as MCAP does."""
    with path.open("rb") as file:
        return file.read(len(MCAP_MAGIC)) == MCAP_MAGIC


def _part(path: Path) -> _FoundChunk:
    with path.open("rb") as file:
        begin = file.read(16)
    kinds = {
        BAG_MAGIC: _FoundChunk(ros2=False, records=_bag_records),
        MCAP_MAGIC: _FoundChunk(ros2=True, records=_mcap_records),
        SQLITE_MAGIC: _FoundChunk(ros2=True, records=_db3_records),
    }
    for magic, part in kinds.items():
        if begin.startswith(magic):
            return part
    raise InputError(f"{path}: invalid .bag, .mcap or .db3 header; nothing in it can be read")


Bytes = bytes | mmap
"""Sliceable bytes."""


@contextmanager
def _mapped(path: Path) -> Iterator[mmap]:
    """Map a file's bytes without reading them all."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as mapped:
        yield mapped


def _bag_records(path: Path, loss: _Loss) -> Iterator[BagConnection | Raw]:
    with _mapped(path) as data:
        yield from _bag_stream(data, len(BAG_MAGIC), path.name, loss)


def _bag_stream(data: Bytes, at: int, name: str, loss: _Loss) -> Iterator[BagConnection | Raw]:
    """Yield records of a file, or of a decompressed chunk: header fields, then data, each with its length."""
    while at < len(data):
        record = _bag_record(data, at)
        if record is None:
            loss.add(f"{name}: the last {len(data) - at} bytes are invalid")
            return
        fields, body, at = record
        operation = fields.get(b"op", b"\0")[:1]
        if operation == b"\x05":
            plain = _unpacked(fields.get(b"compression", b"").decode("ascii", "replace"), body)
            if plain is None:
                loss.add(f"{name}: a chunk of {len(body)} bytes cannot be decompressed")
            else:
                yield from _bag_stream(plain, 0, f"{name}, a chunk", loss)
        elif operation == b"\x07":
            yield from _bag_connection(fields, body)
        elif (
            operation == b"\x02" and len(fields.get(b"time", b"")) == 8 and len(fields.get(b"conn", b"")) == 4
        ):
            seconds, rest = struct.unpack("<II", fields[b"time"])
            yield struct.unpack("<I", fields[b"conn"])[0], seconds * 10**9 + rest, body


def _bag_record(data: Bytes, at: int) -> tuple[dict[bytes, bytes], bytes, int] | None:
    """Return a record's header fields, its data and the begin of the next one; None if it is invalid.

    A chunk that is truncated at the end of the file is returned as far as it goes.
    """
    if at + 4 > len(data):
        return None
    (length,) = struct.unpack_from("<I", data, at)
    begin = at + 4 + length
    if length > LONGEST_HEADER or begin + 4 > len(data):
        return None
    fields = _fields(data[at + 4 : begin])
    (size,) = struct.unpack_from("<I", data, begin)
    end = begin + 4 + size
    if b"op" not in fields or (end > len(data) and fields[b"op"][:1] != b"\x05"):
        return None
    return fields, data[begin + 4 : end], end


LONGEST_HEADER = 1 << 20


def _fields(header: bytes) -> dict[bytes, bytes]:
    """Return a header's valid fields by name."""
    fields: dict[bytes, bytes] = {}
    offset = 0
    while offset + 4 <= len(header):
        (size,) = struct.unpack_from("<I", header, offset)
        name, equals, value = header[offset + 4 : offset + 4 + size].partition(b"=")
        if not equals:
            break
        fields[name] = value
        offset += 4 + size
    return fields


def _bag_connection(fields: dict[bytes, bytes], body: bytes) -> Iterator[BagConnection]:
    about = _fields(body)
    if len(fields.get(b"conn", b"")) == 4 and b"type" in about:
        package, _, kind = _words(about[b"type"]).partition("/")
        yield BagConnection(
            struct.unpack("<I", fields[b"conn"])[0],
            _words(fields.get(b"topic") or about.get(b"topic", b"")),
            f"{package}/msg/{kind}",
            _words(about.get(b"message_definition", b"")),
        )


def _words(value: bytes) -> str:
    return value.decode("utf-8", "replace")


def _mcap_records(path: Path, loss: _Loss) -> Iterator[BagConnection | Raw]:
    with _mapped(path) as data:
        yield from _mcap_stream(data, len(MCAP_MAGIC), path.name, loss, {})


def _mcap_stream(
    data: Bytes, at: int, name: str, loss: _Loss, schemas: dict[int, tuple[str, str]]
) -> Iterator[BagConnection | Raw]:
    """Yield records of a file, or of a decompressed chunk: operation, length, body."""
    while at + 9 <= len(data):
        operation, length = struct.unpack_from("<BQ", data, at)
        begin, end = at + 9, at + 9 + length
        if operation == 0x0F or (operation == 0x89 and end > len(data)):  # the data's end, or of the file
            return
        if not 0 < operation < 0x80 or (end > len(data) and operation != 0x06):
            break
        at = end
        if length > LARGEST_CHUNK:
            loss.add(f"{name}: a record of {length} bytes is too long and was not read")
            continue
        body = data[begin:end]
        try:
            yield from _mcap_record(operation, body, name, loss, schemas)
        except (struct.error, UnicodeDecodeError):
            loss.add(f"{name}: a record of {length} bytes is invalid")
    if at < len(data):
        loss.add(f"{name}: the last {len(data) - at} bytes are invalid")
    elif at > len(data):
        loss.add(f"{name}: {at - len(data)} bytes are missing at its end")


def _mcap_record(
    operation: int, body: bytes, name: str, loss: _Loss, schemas: dict[int, tuple[str, str]]
) -> Iterator[BagConnection | Raw]:
    if operation == 0x05:
        number, _, logged = struct.unpack_from("<HIQ", body)
        yield number, logged, body[22:]
    elif operation == 0x03:
        (number,) = struct.unpack_from("<H", body)
        kind, at = _text(body, 2)
        _, at = _text(body, at)
        schemas[number] = (kind, body[at + 4 :].decode("utf-8", "replace"))
    elif operation == 0x04:
        number, schema = struct.unpack_from("<HH", body)
        kind, definition = schemas.get(schema, ("", ""))
        topic, at = _text(body, 4)
        yield BagConnection(number, topic, kind, definition, _text(body, at)[0])
    elif operation == 0x06:
        compression, at = _text(body, 28)
        plain = _unpacked(compression, body[at + 8 :])
        if plain is None:
            loss.add(f"{name}: a chunk of {len(body)} bytes cannot be decompressed")
        else:
            yield from _mcap_stream(plain, 0, f"{name}, a chunk", loss, schemas)


def _text(body: bytes, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", body, at)
    return body[at + 4 : at + 4 + length].decode("utf-8"), at + 4 + length


def _unpacked(compression: str, body: bytes) -> bytes | None:
    """Return a chunk's bytes as far as possible; None if not even their beginning can be decompressed."""
    if compression in ("", "none"):
        return body
    try:
        return _UNPACKING[compression](body) or None
    except (KeyError, OSError, RuntimeError, EOFError, ValueError):
        return None


def _lz4(body: bytes) -> bytes:
    from lz4.frame import LZ4FrameDecompressor

    return _piecewise(LZ4FrameDecompressor().decompress, body)


def _zstd(body: bytes) -> bytes:
    from stopgo.recordings.logs.zstandard import zstd

    return _piecewise(zstd.ZstdDecompressor().decompress, body)


def _bz2(body: bytes) -> bytes:
    return _piecewise(bz2.BZ2Decompressor().decompress, body)


def _piecewise(unpack: Callable[[bytes], bytes], body: bytes) -> bytes:
    """Return the output before the first error, and of no more than a chunk may have."""
    from stopgo.recordings.logs.zstandard import zstd

    plain = bytearray()
    for at in range(0, len(body), STEP_BYTES):
        if len(plain) > LARGEST_CHUNK:
            break
        try:
            plain += unpack(body[at : at + STEP_BYTES])
        except (OSError, RuntimeError, EOFError, ValueError, zstd.ZstdError):
            break
    return bytes(plain)


STEP_BYTES = 4096
_UNPACKING: dict[str, Callable[[bytes], bytes]] = {"lz4": _lz4, "zstd": _zstd, "bz2": _bz2}


def _db3_records(path: Path, loss: _Loss) -> Iterator[BagConnection | Raw]:
    with TemporaryDirectory(prefix="stopgo-") as folder:
        whole = _of_full_length(path, Path(folder))
        connection = sqlite3.connect(f"file:{quote(str(whole))}?immutable=1", uri=True)
        try:
            check_salvaged(connection, path)
            topics = _rows(connection, "SELECT id, name, type FROM topics", path, loss)
            yield from (BagConnection(int(number), str(name), str(kind), "") for number, name, kind in topics)
            yield from _db3_messages(connection, path, loss)
        finally:
            connection.close()


def _of_full_length(path: Path, folder: Path) -> Path:
    """Yield the file, or if truncated a copy of its full length: SQLite opens no shorter file."""
    with path.open("rb") as file:
        begin = file.read(32)
    size, pages = (int.from_bytes(begin[a:b], "big") for a, b in ((16, 18), (28, 32)))
    length = (65_536 if size == 1 else size) * pages
    if path.stat().st_size >= length:
        return path.resolve()
    copy = folder / "copy.db3"
    shutil.copyfile(path, copy)
    os.truncate(copy, length)
    return copy


def _rows(connection: sqlite3.Connection, statement: str, path: Path, loss: _Loss) -> list[tuple]:
    try:
        return connection.execute(statement).fetchall()
    except sqlite3.DatabaseError as error:
        reason = " ".join(str(error).split())[:120]
        loss.add(f"{path.name}: {reason}")
        return []


def _db3_messages(connection: sqlite3.Connection, path: Path, loss: _Loss) -> Iterator[Raw]:
    """Yield rows in order; after an unreadable one, the search continues in growing steps.

    Damaged pages return rows again, or out of order: each row is used once, so that the search ends.
    """
    after, step, last = 0, 1, 0
    while step < FARTHEST_ROW:
        try:
            for row in connection.execute(_ROWS, (LARGEST_CHUNK, after)):
                if not after < row[0] < LAST_ROW:
                    raise sqlite3.DatabaseError("rows out of order")
                if step > 1:
                    loss.add(f"{path.name}: rows {last + 1} to {row[0] - 1} cannot be read")
                after, step, last = row[0], 1, row[0]
                if tuple(map(type, row)) == MESSAGE_ROW:
                    yield row[1:]
                elif row[3] is None:
                    loss.add(f"{path.name}: messages that are no bytes, or too long, were not read")
        except sqlite3.DatabaseError:
            after, step = after + step, step * 2
        else:
            break
    if step > 1:
        loss.add(f"{path.name}: rows from {last + 1} on cannot be read")


_ROWS = (
    "SELECT id, topic_id, timestamp, CASE WHEN typeof(data) = 'blob' AND length(data) <= ? THEN data END"
    " FROM messages WHERE id > ? ORDER BY id"
)
"""Rows with their data, where these are bytes and no longer than a sweep's."""
FARTHEST_ROW = 1 << 40
LAST_ROW = 1 << 62
MESSAGE_ROW = (int, int, int, bytes)
