"""Access to ROS bags: complete ones by rosbags, damaged ones record by record."""

from __future__ import annotations

import lzma
import re
import sqlite3
import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.recordings.logs.bag_sizes import Longest, check_mcap
from stopgo.recordings.logs.bag_tables import tables_checked
from stopgo.recordings.logs.salvage import Salvaged, salvage


@dataclass(frozen=True)
class Topic:
    """Connection of a bag."""

    number: int
    name: str
    msgtype: str
    count: int | None
    """Number of messages; None if it is known only at the end."""


BagMessage = tuple[Topic, int, bytes]
"""Topic, time of logging (ns), and bytes of a message."""


@dataclass(frozen=True)
class Bag:
    """Open bag."""

    ros2: bool
    topics: tuple[Topic, ...]
    messages: Callable[[Sequence[Topic]], Iterator[BagMessage]]
    """Messages of these topics, in the order of logging."""
    decode: Callable[[Topic, bytes], Any]
    """Decoder of a message into an object; raises UnknownType for unknown types."""
    lost: Callable[[], str] = lambda: ""
    """Unreadable part of the bag; complete only after all messages were read."""
    form: str = ""
    """Name of its format, if it is no ROS bag."""
    notes: tuple[str, ...] = ()
    """Content that is not read, one line each."""


class UnknownType(Exception):
    """Message type that is not described anywhere."""


class Damaged(Exception):
    """Bag that rosbags cannot read to its end."""


def files_of(path: Path) -> list[Path]:
    """Return the files of a bag."""
    if not path.is_dir():
        return [path]
    found = [p for p in sorted(path.iterdir(), key=lambda p: _natural(p.name)) if _is_part(p)]
    if not found:
        raise InputError(f"{path}: contains no .mcap, .db3 or .bag; give a log, or the folder of a rosbag2")
    return found


def _is_part(path: Path) -> bool:
    return path.name.removesuffix(".zstd").rpartition(".")[2] in ("mcap", "db3", "bag")


def _natural(name: str) -> list[tuple[int, str]]:
    """Sort key by which bag_2 comes before bag_10."""

    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


@contextmanager
def whole_bag(path: Path, longest: Longest = MappingProxyType({})) -> Iterator[Bag]:
    """Open a bag with rosbags.

    Parameters
    ----------
    longest
        Bytes that a message may have at most, by the types that are read.

    Raises
    ------
    Damaged
        With the reason, when it is opened or while its messages are read.
    InputError
        When a table of a database is none, or a message that is read is too long.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with ExitStack() as stack:
        with _raising_damage():
            described = path.is_dir() and (path / METADATA).exists()
            paths = [path] if described else stack.enter_context(_unpacked(files_of(path)))
            for file in files_of(path) if described else paths:
                check_mcap(file, longest)
            reader = AnyReader(paths, default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            with tables_checked(longest):
                stack.enter_context(reader)
        yield _bag(reader)


METADATA = "metadata.yaml"


@contextmanager
def _unpacked(files: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield the files; compressed ones (`.zstd`) are decompressed into a temporary folder."""
    with TemporaryDirectory(prefix="stopgo-") as folder:
        yield [_plain(file, Path(folder)) if file.suffix == ".zstd" else file for file in files]


def _plain(file: Path, folder: Path) -> Path:
    """Decompress a file as far as possible."""
    from stopgo.recordings.logs.zstandard import zstd

    target = folder / file.stem
    unpack = zstd.ZstdDecompressor()
    with file.open("rb") as packed, target.open("wb") as plain:
        while chunk := packed.read(1 << 20):
            try:
                plain.write(unpack.decompress(chunk))
            except (zstd.ZstdError, EOFError):
                break
    return target


@contextmanager
def _raising_damage() -> Iterator[None]:
    try:
        yield
    except _damage() as error:
        raise Damaged(_reason(error)) from error


def _damage() -> tuple[type[Exception], ...]:
    """Return the exceptions that reading a damaged file raises, also those of rosbags' own SQLite."""
    from rosbags.highlevel import AnyReaderError
    from rosbags.rosbag1 import ReaderError as Error1
    from rosbags.rosbag2 import ReaderError as Error2
    from rosbags.typesys import TypesysError

    from stopgo.recordings.logs.zstandard import zstd

    apsw = sys.modules.get("apsw")
    of_database = () if apsw is None else (apsw.Error,)
    odd = (TypeError, AttributeError)  # of columns whose values are of another type
    return (AnyReaderError, Error1, Error2, TypesysError, zstd.ZstdError, *odd, *LOW_LEVEL, *of_database)


LOW_LEVEL = (
    AssertionError, OSError, sqlite3.DatabaseError, struct.error, EOFError, RuntimeError, ValueError,
    IndexError, KeyError, lzma.LZMAError, MemoryError, OverflowError,
)  # fmt: skip
"""Exceptions that readers of damaged files raise besides their own."""


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__


def _bag(reader: Any) -> Bag:
    topics = {_key(c): Topic(k, c.topic, c.msgtype, c.msgcount) for k, c in enumerate(reader.connections)}

    def messages(wanted: Sequence[Topic]) -> Iterator[BagMessage]:
        chosen = [c for c in reader.connections if topics[_key(c)] in wanted]
        with _raising_damage():  # exceptions of the consumer are not raised in here
            for connection, ns, raw in reader.messages(connections=chosen) if chosen else ():
                yield topics[_key(connection)], ns, raw

    def decode(topic: Topic, raw: bytes) -> Any:
        return decoded(reader.typestore, topic.msgtype, raw, ros2=reader.is2)

    return Bag(reader.is2, tuple(topics.values()), messages, decode)


def _key(connection: Any) -> tuple[int, str, int]:
    return connection.id, connection.topic, id(connection.owner)


def decoded(store: Any, msgtype: str, raw: bytes, *, ros2: bool) -> Any:
    """Return a message's bytes as an object.

    Raises
    ------
    UnknownType
        If the type is not described, or the bytes are not of it.
    """
    from rosbags.serde import SerdeError

    try:
        return store.deserialize_cdr(raw, msgtype) if ros2 else store.deserialize_ros1(raw, msgtype)
    except (KeyError, SerdeError, struct.error, ValueError, IndexError) as error:
        raise UnknownType(f"{msgtype}: {_reason(error)}") from None


@contextmanager
def salvaged_bag(path: Path, why: str) -> Iterator[Bag]:
    """Open the readable part of a damaged bag."""
    with _unpacked(files_of(path)) as files, salvage(files, why) as found:
        yield _salvaged(found)


def _salvaged(found: Salvaged) -> Bag:
    store = _store_of(found)
    topics = {c.number: Topic(c.number, c.topic, c.msgtype, None) for c in found.connections}

    def messages(wanted: Sequence[Topic]) -> Iterator[BagMessage]:
        numbers = {topic.number for topic in wanted}
        for number, ns, raw in found.messages():
            if number in numbers:
                yield topics[number], ns, raw

    def decode(topic: Topic, raw: bytes) -> Any:
        return decoded(store, topic.msgtype, raw, ros2=found.ros2)

    return Bag(found.ros2, tuple(topics.values()), messages, decode, found.lost)


def _store_of(found: Salvaged) -> Any:
    """Return ROS's own types, and those that the bag describes."""
    from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE if found.ros2 else Stores.ROS1_NOETIC)
    for connection in found.connections:
        if connection.definition and connection.msgtype not in store.fielddefs:
            try:
                types = get_types_from_msg(connection.definition, connection.msgtype)
                store.register({name: item for name, item in types.items() if name not in store.fielddefs})
            except TypesysError:
                continue  # messages of this type are then reported as unknown
    return store
