"""Readers of robots' own logs: each returns the log's content as a `FieldLog`.

A reader is a function `(path, reading) -> FieldLog`, and one line in `READERS`. Installed packages add more:
entry points in the group `stopgo.log`, each a `LogFormat`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from stopgo.mission.console.plugins import Variant, loader
from stopgo.mission.errors import InputError
from stopgo.recordings.logs.field_log import FieldLog, Reading
from stopgo.recordings.logs.files import head, must_be_readable
from stopgo.recordings.logs.foreign_logs import foreign_formats, sound_log

LogReader = Callable[[Path, Reading], FieldLog]


@dataclass(frozen=True)
class LogFormat:
    """Format of a log."""

    name: str
    suffixes: tuple[str, ...]
    begins: tuple[bytes, ...]
    """First bytes of such a file; () if they do not identify it."""
    reader: Callable[[], LogReader]
    """Loader of the reader: some readers need libraries that others do not."""


SQLITE = b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"
_ros, _journal = (loader(f"stopgo.recordings.logs.{name}") for name in ("ros:read_ros", "own:read_journal"))
READERS = (
    LogFormat("ROS 1 bag", (".bag",), (b"#ROSBAG V",), _ros),
    LogFormat("ROS 2 MCAP", (".mcap",), (b"\x89MCAP0\r\n",), _ros),
    LogFormat("ROS 2 SQLite", (".db3",), (SQLITE,), _ros),
    LogFormat("ROS 2, compressed", (".zstd",), (ZSTD,), _ros),
    LogFormat("stopgo journal", (".sqlite",), (SQLITE,), _journal),
    LogFormat(
        "stopgo recording", (".rrd",), (b"RRF2",),
        loader("stopgo.recordings.logs.own_recording:read_run_recording"),
    ),
    LogFormat(
        "ArduPilot BIN", (".bin",), (b"\xa3\x95",), loader("stopgo.recordings.logs.dataflash:read_dataflash")
    ),
    LogFormat("PX4 ULog", (".ulg",), (b"ULog\x01\x12\x35",), loader("stopgo.recordings.logs.ulog:read_ulog")),
    LogFormat(
        "MAVLink telemetry", (".tlog",), (),
        loader("stopgo.recordings.logs.telemetry_log:read_telemetry_log"),
    ),
    LogFormat(
        "trajectory", (".tum", ".kitti", ".txt", ".csv", ".tsv"), (),
        loader("stopgo.recordings.logs.tables:read_table"),
    ),
)  # fmt: skip
"""Formats that can be read; a folder is a rosbag2."""


def read_log(path: Path, reading: Reading | None = None) -> FieldLog:
    """Read a log to its end, by its format; the file is opened for reading and never changed.

    Raises
    ------
    InputError
        Naming the file and why it cannot be read.
    """
    must_be_readable(path)
    how = reading or Reading()
    try:
        return _reader_for(path)(path, how)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _reader_for(path: Path) -> LogReader:
    """Return the reader by name and content; by content alone if the name is unknown."""
    if path.is_dir():
        return _of_folder(path)
    begin = head(path, 16)
    named = [form for form in READERS if path.name.lower().endswith(form.suffixes)]
    fitting = [form for form in READERS if form.begins and begin.startswith(form.begins)]
    chosen = [form for form in named if form in fitting or not form.begins] or fitting
    if chosen:
        return chosen[0].reader()
    if named:
        raise InputError(f"{path}: invalid {named[0].suffixes[0]} header; incomplete copy?")
    others = list(foreign_formats(LogFormat))
    for other in others:
        form = other.what
        if path.name.lower().endswith(form.suffixes) or (form.begins and begin.startswith(form.begins)):
            return partial(_read_foreign, other)
    forms = (*READERS, *(other.what for other in others))
    known = ", ".join(suffix for form in forms for suffix in form.suffixes)
    raise InputError(f"{path}: unknown log format; known are {known}")


def _read_foreign(other: Variant[LogFormat], path: Path, how: Reading) -> FieldLog:
    with other.named_errors():
        given = other.what.reader()(path, how)
    return sound_log(other, given)


def _of_folder(path: Path) -> LogReader:
    """Return the reader of a robot's state directory, or of a rosbag2."""
    if not (path / JOURNAL).exists():
        return _ros()
    read = _journal()
    return lambda folder, how: read(folder / JOURNAL, how)


JOURNAL = "journal.sqlite"


__all__ = ["READERS", "FieldLog", "LogFormat", "LogReader", "Reading", "read_log"]
