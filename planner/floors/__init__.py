"""Readers of building floors: one module per kind of file, one entry in `READERS` for each.

A reader's module has two functions, `survey(file, options) -> Survey` and `read(file, options) -> FloorPlan`
(stopgo.planner.floors.reader.ReaderModule). It is found by the file's suffix and by what its bytes look like,
among ours first, then among those of installed packages.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import cast

from stopgo.mission.console.plugins import Variant
from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import FLOOR_PARAMETERS, Settings
from stopgo.mission.settings.given_heights import heights_by_kind
from stopgo.mission.settings.layer_kinds import kinds_by_name
from stopgo.planner.floors.reader import BodiesModule, FloorFile, FloorOptions, Reader
from stopgo.planner.floors.standing_body import StandingBody
from stopgo.planner.floors.survey import Survey
from stopgo.planner.floors.third_party_readers import foreign_readers, sound

READERS: tuple[Reader, ...] = (
    Reader(
        kind="DXF drawing",
        suffixes=(".dxf",),
        holds=lambda data: data.startswith(b"AutoCAD Binary DXF") or b"\nSECTION" in data[:4096],
        module="stopgo.planner.floors.dxf",
        takes=frozenset(
            {"layers", "layer_map", "drawing", "region", "units", "heights", "scan_height", "robot_height"}
        ),
    ),
    Reader(
        kind="robot map",
        suffixes=(".yaml", ".yml"),
        holds=lambda data: all(key in data[:4096] for key in (b"image:", b"resolution:", b"origin:")),
        module="stopgo.planner.floors.robot_map",
        takes=frozenset(),
    ),
    Reader(
        kind="building model",
        suffixes=(".ifc", ".ifczip"),
        holds=lambda data: b"ISO-10303-21" in data[:1024] or _is_zipped_model(data),
        module="stopgo.planner.floors.ifc.storey_reader",
        takes=frozenset(
            {
                *("storey", "level", "scan_height", "robot_height", "date", "since", "schedule"),
                *("schedule_columns", "in_progress", "furniture", "layers", "layer_map"),
            }
        ),
        has_bodies=True,
    ),
)
"""Every kind of file that floors are read from."""


def _is_zipped_model(data: bytes) -> bool:
    return data.startswith(b"PK\x03\x04") and b".ifc" in data[:1024].lower()


def read_floor(path: Path, options: FloorOptions | None = None) -> FloorPlan:
    """Read the floor in a file, in metres.

    Raises
    ------
    InputError
        One line with the file, the problem and the remedy; also for an option that does not apply to
        such a file.
    """
    file, reader, options = _opened(path, options)
    with reader.named_errors():
        floor = reader.what.load().read(file, options)
    return floor if reader.ours else sound(reader, floor, file.digest)


def standing_bodies(path: Path, options: FloorOptions | None = None) -> tuple[StandingBody, ...]:
    """Return the bodies of a model in the robot's height on the floor that `read_floor` reads.

    Other files have none: their floor is all that is known.
    """
    file, reader, options = _opened(path, options)
    if not reader.ours or not reader.what.has_bodies:
        return ()
    return cast("BodiesModule", reader.what.load()).standing(file, options)


def survey_floor(path: Path, options: FloorOptions | None = None) -> Survey:
    """Return the survey of a floor's file: its contents, and the floor that these options give.

    Raises
    ------
    InputError
        As `read_floor` does.
    """
    file, reader, options = _opened(path, options)
    with reader.named_errors():
        found = reader.what.load().survey(file, options)
    return cast("Survey", reader.of_kind(found, Survey))


def options_of(settings: Settings) -> FloorOptions:
    """Return the reader's options from a plan's settings."""
    values = {name: getattr(settings, name) for name in FLOOR_PARAMETERS}
    columns = (entry.partition("=") for entry in values.pop("schedule_columns"))
    schedule = values.pop("schedule")
    values["heights"] = heights_by_kind(settings.heights)
    values["layer_map"] = kinds_by_name(settings.layer_map or ())
    return FloorOptions(
        d_dis=settings.d_dis,
        layers=settings.layer_roles,
        schedule=None if schedule is None else Path(schedule),
        schedule_columns={what.strip(): column.strip() for what, _, column in columns},
        **values,
    )


def _opened(path: Path, options: FloorOptions | None) -> tuple[FloorFile, Variant[Reader], FloorOptions]:
    """Return the file, its reader, and the options; refuse options that do not apply to the reader."""
    options = options or FloorOptions()
    file = FloorFile(path, _bytes_of(path))
    reader = _reader_of(file)
    takes = reader.what.takes
    unknown = [name for name in options.given if name not in takes]
    if unknown:
        raise InputError(
            f"{path}: --{_option(unknown[0])} does not apply to a {reader.what.kind}; "
            f"remove it (known: {_listed(takes)})"
        )
    return file, reader, options


def _reader_of(file: FloorFile) -> Variant[Reader]:
    """Choose the reader by suffix, unless the bytes are clearly those of another kind."""
    suffix = file.path.suffix.lower()
    named = [reader for reader in READERS if suffix in reader.suffixes]
    alike = [reader for reader in READERS if reader.holds(file.data)]
    for reader in (*(item for item in named if item in alike), *alike, *named):
        return Variant(reader.kind, reader.module, reader)
    others = list(foreign_readers())
    for other in others:
        if suffix in other.what.suffixes:
            return other
    if suffix == ".zip" and file.data.startswith(ZIP):
        raise InputError(f"{file.path}: is compressed; unpack it first, and name the floor's file in it")
    readers = (*READERS, *(other.what for other in others))
    known = ", ".join(suffix for reader in readers for suffix in reader.suffixes)
    raise InputError(f"{file.path}: unknown kind of file '{suffix}'; floors are read from {known}")


def _option(name: str) -> str:
    """Return the name of an option on the command line."""
    return {"layers": "layer", "layer_map": "layers", "schedule_columns": "schedule-column"}.get(
        name, name.replace("_", "-")
    )


def _listed(names: Iterable[str]) -> str:
    return ", ".join(sorted(f"--{_option(name)}" for name in names)) or "no such options"


def _bytes_of(path: Path) -> bytes:
    if path.is_char_device() or path.is_block_device():
        raise InputError(f"{path}: is a device, which may never end; name a file")
    if path.is_fifo() or path.is_socket():
        raise InputError(f"{path}: is a pipe, and a floor is read more than once; save it as a file")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a directory; name the floor's file in it") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error}); check the path and its permissions") from None
    if not data.strip():
        raise InputError(f"{path}: is empty ({len(data)} bytes); export the floor again")
    if data.startswith(GZIP):
        raise InputError(f"{path}: is compressed with gzip; unpack it first (gunzip)")
    return data


GZIP, ZIP = b"\x1f\x8b", b"PK\x03\x04"
"""First bytes of compressed files."""


__all__ = [
    "READERS",
    "FloorFile",
    "FloorOptions",
    "Reader",
    "options_of",
    "read_floor",
    "standing_bodies",
    "survey_floor",
]
