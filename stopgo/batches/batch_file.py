"""Files that describe a batch (`plans.toml`): floors, storeys, dates, variants, and other such files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from stopgo.mission.console.whole_file import must_end, whole_file
from stopgo.mission.document.decoding import converted
from stopgo.mission.errors import InputError
from stopgo.mission.settings.toml_file import read_toml, with_quotes

AXES = ("file", "storey", "date", "variant")
DEEPEST = 20
"""Files that include one another; more is taken for a mistake."""

EntryOptions = dict[str, Any]


class Override(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """EntryOptions for the entries that match all patterns of `when`."""

    when: dict[str, str]
    options: EntryOptions


class FloorTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table `[[floors]]` as it stands in the file."""

    files: str | list[str]
    name: str = ""
    storeys: list[str] = []
    dates: list[str] = []
    parameters: str | None = None
    options: EntryOptions = {}
    matrix: dict[str, list[Any]] = {}
    exclude: list[dict[str, str]] = []
    override: list[Override] = []


class RobotTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A robot as it stands in the file."""

    name: str
    shift: str = "8h"
    at: str = ""


class DayTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table `[day]`: robots, and the transfers of robots between floors."""

    robots: list[RobotTable]
    transfers: str | None = None
    """CSV of from, to, minutes."""
    transfer: str = "15min"
    """Time between floors that the CSV does not name."""
    setup: str = "10min"
    """Time before each mission."""
    begin: str = "07:00"


class BatchDocument(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A plans.toml as it stands on the disk."""

    include: list[str] = []
    options: EntryOptions = {}
    floors: list[dict[str, Any]] = []
    day: DayTable | None = None


@dataclass(frozen=True)
class FloorGroup:
    """Floors that are planned alike: a table `[[floors]]`, with the options of its file."""

    place: str
    """File and line."""
    folder: Path
    """Folder of the file; patterns and paths start there."""
    files: tuple[str, ...]
    name: str
    storeys: tuple[str, ...]
    dates: tuple[str, ...]
    parameters: Path | None
    options: Mapping[str, Any]
    matrix: Mapping[str, Sequence[Any]]
    exclude: tuple[Mapping[str, str], ...]
    override: tuple[Override, ...]


def read_batch(path: Path) -> tuple[list[FloorGroup], list[str]]:
    """Return the groups of a file and of those that it includes, and one line per problem.

    Raises
    ------
    InputError
        When the file cannot be read, or has no floors.
    """
    problems: list[str] = []
    groups = _groups(path, {}, (), problems)
    if not groups and not problems:
        raise InputError(f'{path}: names no floors; add a table [[floors]] with files = "…"')
    return groups, problems


def read_day(path: Path) -> DayTable:
    """Return the robots and transfers of a batch's file.

    Raises
    ------
    InputError
        When it has none.
    """
    day = _document(path).day
    if day is None:
        raise InputError(
            f'{path}: has no table [day]; add one with robots = [{{ name = "r1", shift = "8h" }}]'
        )
    return day


def _document(path: Path) -> BatchDocument:
    must_end(path)  # the file is read twice, and its paths start at its folder
    try:
        return converted(read_toml(path), BatchDocument)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {_plain(error)}") from None


def _groups(
    path: Path, options: Mapping[str, Any], includers: tuple[Path, ...], problems: list[str]
) -> list[FloorGroup]:
    real = path.resolve()
    if real in includers or len(includers) > DEEPEST:
        circle = " -> ".join(item.name for item in (*includers, real))
        raise InputError(f"{path}: is included by itself ({circle}); remove one include")
    file = _document(path)
    shared = {**options, **file.options}
    groups = []
    for included in file.include:
        try:
            groups += _groups(path.parent / included, shared, (*includers, real), problems)
        except InputError as error:
            problems.append(str(error))
    lines = _lines_of_tables(path)
    for number, table in enumerate(file.floors):
        place = f"{path}: line {lines[number]}" if number < len(lines) else f"{path}: floors {number + 1}"
        try:
            groups.append(_group(place, path.parent, table, shared))
        except InputError as error:
            problems.append(f"{place}: {error}")
    return groups


def _group(place: str, folder: Path, table: Mapping[str, Any], shared: Mapping[str, Any]) -> FloorGroup:
    try:
        group = converted(table, FloorTable)
    except msgspec.ValidationError as error:
        raise InputError(_plain(error)) from None
    for rule in (*group.exclude, *(item.when for item in group.override)):
        unknown = sorted(set(rule) - set(AXES))
        if unknown or not rule:
            raise InputError(f"a rule compares {', '.join(AXES)}; not {', '.join(unknown) or 'nothing'}")
    empty = [key for key, values in group.matrix.items() if not values]
    if empty:
        raise InputError(f"matrix: {empty[0]} has no values; remove it, or give some")
    return FloorGroup(
        place=place,
        folder=folder,
        files=(group.files,) if isinstance(group.files, str) else tuple(group.files),
        name=group.name,
        storeys=tuple(group.storeys),
        dates=tuple(group.dates),
        parameters=None if group.parameters is None else folder / group.parameters,
        options={**shared, **group.options},
        matrix=group.matrix,
        exclude=tuple(group.exclude),
        override=tuple(group.override),
    )


def _lines_of_tables(path: Path) -> list[int]:
    """Line numbers of the tables `[[floors]]`."""
    text = whole_file(path).decode("utf-8-sig")
    return [n for n, line in enumerate(text.splitlines(), 1) if re.match(r"\s*\[\[\s*floors\s*\]\]", line)]


def _plain(error: msgspec.ValidationError) -> str:
    """The library's message with the key first: `storeys[0]: Expected `str`, got `int`; …`."""
    problem, _, where = str(error).partition(" - at `$.")
    named = f"{where.rstrip('`')}: {problem}" if where else problem
    return with_quotes(named)
