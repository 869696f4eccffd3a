"""Reader of stopgo's own logs, which are in the mission's frame: a robot's journal."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec
import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.geometry import frozen
from stopgo.mission.run.events import AnyEvent, event_of
from stopgo.recordings.logs.field_log import Channel, FieldLog, Poses, Reading, Remark, poses_of

SITE = "site"
"""Name of the mission's own frame in a log."""
AT_EVENTS = "events"
"""Source of poses that events contain: stationary poses, without the path between them."""
NO_POSES = Poses(AT_EVENTS, SITE, frozen((), np.int64), frozen(np.empty((0, 2))), frozen(()), rank=1)
SQLITE_SUFFIXES = ("-wal", "-shm")


def read_journal(path: Path, reading: Reading) -> FieldLog:
    """Read a robot's journal with its write-ahead log; the file stays unchanged.

    Raises
    ------
    InputError
        When it is not a journal of stopgo, or has no events.
    """
    with _copied(path) as connection:
        try:
            events = tuple(_decoded(connection.execute("SELECT body FROM events ORDER BY number")))
            missions = tuple(_missions(_documents(connection)))
        except sqlite3.DatabaseError as error:
            raise InputError(f"{path}: not a journal of stopgo, or damaged ({error})") from None
    if not events:
        raise InputError(f"{path}: the journal has no events yet")
    return own_log(path, "stopgo journal", events, missions, poses_of_events(events))


@contextmanager
def _copied(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a copy: SQLite writes to a file that it opens if the last writer was killed."""
    with TemporaryDirectory(prefix="stopgo-") as folder:
        copy = Path(folder) / "journal.sqlite"
        shutil.copyfile(path, copy)
        for suffix in SQLITE_SUFFIXES:
            companion = path.with_name(path.name + suffix)
            if companion.exists():
                shutil.copyfile(companion, f"{copy}{suffix}")
        connection = sqlite3.connect(copy)
        try:
            yield connection
        finally:
            connection.close()


def _decoded(rows: Iterable[tuple[bytes]]) -> Iterator[AnyEvent]:
    for (body,) in rows:
        with suppress(msgspec.DecodeError):
            yield event_of(body)


def _documents(connection: sqlite3.Connection) -> Iterator[bytes]:
    """Yield each mission's JSON: in numbered chunks, or whole in journals of formats 1 and 2."""
    chunks = "SELECT COALESCE(CAST(data AS BLOB), x'') FROM chunks WHERE document = ? ORDER BY number"
    for (document,) in connection.execute("SELECT document FROM missions ORDER BY revision").fetchall():
        whole = isinstance(document, bytes)
        yield document if whole else b"".join(data for (data,) in connection.execute(chunks, (document,)))


def _missions(documents: Iterable[bytes]) -> Iterator[Mission]:
    for document in documents:
        with suppress(msgspec.DecodeError):
            yield decoded(document, Mission)


def poses_of_events(events: Iterable[AnyEvent]) -> Poses:
    """Return the poses in events; an empty track if every stop was skipped."""
    posed = [(event.robot_ns, pose) for event in events if (pose := getattr(event, "pose", None)) is not None]
    if not posed:
        return NO_POSES
    xy = [(pose.x, pose.y) for _, pose in posed]
    found = poses_of(
        AT_EVENTS, SITE, [ns for ns, _ in posed], xy, [pose.heading for _, pose in posed], rank=1
    )
    return found or NO_POSES


def own_log(
    path: Path, form: str, events: tuple[AnyEvent, ...], missions: tuple[Mission, ...], *tracks: Poses | None
) -> FieldLog:
    """Return one of stopgo's logs as a `FieldLog`."""
    counts: dict[str, int] = {}
    for event in events:
        counts[type(event).__name__] = counts.get(type(event).__name__, 0) + 1
    poses = tuple(track for track in tracks if track is not None)
    times = [event.robot_ns for event in events] + [
        int(edge) for track in poses if len(track.ns) for edge in track.ns[[0, -1]]
    ]
    return FieldLog(
        path=str(path),
        format=form,
        digest=file_digest(path),
        messages=len(events) + sum(len(track.ns) for track in poses if track.source != AT_EVENTS),
        clock="wall",
        begin_ns=min(times, default=0),
        end_ns=max(times, default=0),
        channels=tuple(Channel(name, "", count) for name, count in sorted(counts.items())),
        poses=poses,
        remarks=tuple(_remarks(events)),
        events=events,
        missions=missions,
    )


def _remarks(events: Iterable[AnyEvent]) -> Iterator[Remark]:
    for event in events:
        stop = getattr(event, "stop", "")
        yield Remark(event.robot_ns, "text", f"{type(event).__name__} {stop}".strip())
