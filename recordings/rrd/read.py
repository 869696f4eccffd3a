"""Read a recording to its end, and report its contents or the reason why it cannot be read."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rerun.chunk import Chunk, RrdReader, StoreEntry

from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import NOT_TEXT, UNREADABLE, is_text, legible_name
from stopgo.recordings.drawing import entities

MARK = b"RRF2"
"""First bytes of a recording that this Rerun can read."""


@dataclass(frozen=True)
class Contents:
    """Contents of a recording."""

    application: str
    recording_id: str
    complete: bool
    """False if the writer was killed before it closed the file."""
    rows: dict[str, int]
    """Rows per entity; all static rows of an entity count as one."""
    timelines: tuple[str, ...]
    properties: dict[str, dict[str, Any]]
    """Values of each property, by the property's name."""

    @property
    def total_rows(self) -> int:
        return sum(self.rows.values())


def check(path: Path, *, take: Callable[[Chunk], None] = lambda chunk: None) -> Contents:
    """Read every chunk of the file, and pass each to `take`.

    Raises
    ------
    InputError
        When the file is missing, empty, no recording, truncated, or damaged anywhere.
    """
    reader, stores = _open(path)
    if len(stores) != 1:
        raise InputError(f"{path}: contains {len(stores)} recordings; expected one")
    counts: Counter[str] = Counter()
    timelines: set[str] = set()
    properties: dict[str, dict[str, Any]] = {}
    fixed: set[str] = set()
    for chunk in chunks(path, reader):
        take(chunk)
        entity = str(chunk.entity_path)
        if not chunk.is_static:
            counts[entity] += chunk.num_rows
        elif entity not in fixed:  # viewers show only the last static row, and compacting drops the others
            fixed.add(entity)
            counts[entity] += 1
        timelines.update(chunk.timeline_names)
        _take_property(properties, chunk)
    return Contents(
        application=stores[0].application_id,
        recording_id=stores[0].recording_id,
        complete=_has_footer(reader),
        rows=dict(sorted(counts.items())),
        timelines=tuple(sorted(timelines)),
        properties=properties,
    )


def chunks(path: Path, reader: RrdReader | None = None) -> Iterator[Chunk]:
    """Yield every chunk of the recording to its end; damage is found only when its chunk is read."""
    reader = reader or _open(path)[0]
    try:
        yield from reader.stream()
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{path}: damaged ({_reason(error)})") from None


def rows(chunk: Chunk) -> Iterator[tuple[float | None, dict[str, Any]]]:
    """Yield mission time in seconds, where a row has one, and the row's values by component."""
    batch = chunk.to_record_batch()
    timed = entities.MISSION_TIME in batch.schema.names
    times = batch.column(entities.MISSION_TIME).cast("int64").to_pylist() if timed else [None] * len(batch)
    data = [name for name in batch.schema.names if name not in _INDEXES and not name.startswith("rerun.")]
    for time, cells in zip(times, batch.select(data).to_pylist(), strict=True):
        present = {name: cell for name, cell in cells.items() if cell is not None}
        values = {name.rpartition(":")[2]: _unwrapped(cell) for name, cell in present.items()}
        yield None if time is None else time / 1e9, values


_INDEXES = (
    entities.STEP,
    entities.CANDIDATE,
    entities.STOP_NUMBER,
    entities.MISSION_TIME,
    entities.ROBOT_TIME,
)


def _unwrapped(cell: list[Any]) -> Any:
    return cell[0] if len(cell) == 1 else cell


def _take_property(properties: dict[str, dict[str, Any]], chunk: Chunk) -> None:
    parent, _, name = str(chunk.entity_path).rpartition("/")
    if parent == entities.PROPERTIES:
        for _, values in rows(chunk):
            properties.setdefault(name, {}).update(values)


def _open(path: Path) -> tuple[RrdReader, list[StoreEntry]]:
    _check_is_recording(path)
    try:
        with warnings.catch_warnings():
            # `Contents.complete` shows whether the file has a footer.
            warnings.simplefilter("ignore")
            reader = RrdReader(path)
            return reader, reader.recordings()
    except (RuntimeError, ValueError) as error:
        raise InputError(f"{path}: {_read_problem(path, error)}") from None


def looks_like_one(path: Path) -> bool:
    """True if a file begins as a recording does."""
    try:
        _check_is_recording(path)
    except InputError:
        return False
    return True


def _check_is_recording(path: Path) -> None:
    if not is_text(str(path)):
        raise InputError(f"{legible_name(str(path))}: {NOT_TEXT}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name the recordings in it, as {path}/*.rrd")
    if not path.is_file():
        raise InputError(f"{path}: {_why_no_file(path)}")
    try:
        with path.open("rb") as file:
            begin = file.read(len(MARK))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if not begin:
        raise InputError(f"{path}: is empty")
    if begin != MARK:
        raise InputError(f"{path}: is not a Rerun recording")


def _why_no_file(path: Path) -> str:
    if UNREADABLE in path.name:
        return NOT_TEXT
    if path.is_symlink() and not path.exists():
        return "is a link to a file that does not exist"
    return "is a pipe, a socket or a device, not a file" if path.exists() else "no such file"


def _read_problem(path: Path, error: Exception) -> str:
    if "Not an RRD file" in str(error) or "too small" in str(error):
        return "is not a Rerun recording"
    problem = "is truncated" if "exceeds file size" in str(error) else "is damaged"
    return f"{problem}; save the rest with: rerun rrd optimize {path.name} -o repaired.rrd"


def _reason(error: Exception) -> str:
    return str(error).partition("\n")[0][:120]


def _has_footer(reader: RrdReader) -> bool:
    try:
        reader.store()
    except RuntimeError:
        return False
    return True
