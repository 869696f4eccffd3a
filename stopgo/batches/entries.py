"""Entries of a batch: each a floor's file with all parameters of one plan, and the folder of its result."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

from stopgo.batches.batch_file import FloorGroup
from stopgo.mission.errors import InputError
from stopgo.mission.files.file_name import NOT_TEXT, is_text, legible_name
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.settings import Settings

MOST = 100_000
"""Entries of one batch; more is taken for a mistake in a matrix."""


@dataclass(frozen=True)
class ModelStorey:
    """A storey of a model, as `stopgo floors` lists it."""

    name: str
    planned: bool
    """True if `plan --all-storeys` plans it."""
    reason: str = ""
    """Reason why it is not planned by default."""


@dataclass(frozen=True)
class Entry:
    """One plan of a batch."""

    name: str
    """Folder of the result below the output folder, with `/` between its parts; unique in a batch."""
    site: str
    """The first parts of the name: the floor, whatever the date and variant."""
    floor: Path
    settings: Settings
    place: str
    """Position in the file of the batch, such as `plans.toml: line 12`."""
    axes: tuple[tuple[str, str], ...] = ()
    """File, storey, date and variant, as `exclude` and `override` compare them."""


@dataclass(frozen=True)
class EntryFault:
    """A fault of a batch's file that is known before anything is planned."""

    place: str
    """Position in the file; empty if the text names it."""
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}" if self.place else self.text


@dataclass(frozen=True)
class Expansion:
    """All entries of a batch, and the problems found meanwhile."""

    entries: tuple[Entry, ...]
    problems: tuple[EntryFault, ...]
    left_out: tuple[str, ...]
    """Storeys that no pattern names and that are not planned by default, one sentence each."""


def files_of(group: FloorGroup) -> list[Path]:
    """Return the files that a group's patterns name, sorted and each once.

    Raises
    ------
    InputError
        When a pattern names no file.
    """
    found: dict[Path, None] = {}
    for pattern in group.files:
        if not set(pattern) & set("*?["):
            found[group.folder / pattern] = None
            continue
        matches = sorted(path for path in group.folder.glob(pattern) if path.is_file())
        if not matches:
            raise InputError(f"files = {pattern!r}: no file has such a name; check pattern and folder")
        found.update(dict.fromkeys(matches))
    return list(found)


def expand(
    groups: Sequence[FloorGroup], storeys: Mapping[Path, Sequence[ModelStorey] | InputError]
) -> Expansion:
    """Return the entries of all groups; `storeys` has those of every model, or why it cannot be read."""
    entries: list[Entry] = []
    problems: list[EntryFault] = []
    left_out: dict[str, None] = {}
    for group in groups:
        try:
            files = files_of(group)
        except InputError as error:
            problems.append(EntryFault(group.place, str(error)))
            continue
        for floor in files:
            if not is_text(str(floor)):
                problems.append(EntryFault(group.place, f"{legible_name(str(floor))}: {NOT_TEXT}"))
                continue
            if not floor.is_file():
                problems.append(EntryFault(group.place, f"{floor}: no such file; check the name"))
                continue
            made, faults = _entries_of(group, floor, storeys.get(floor, ()), left_out)
            entries += made
            problems += faults
        if len(entries) > MOST:
            raise InputError(f"{group.place}: more than {MOST} entries; check files and matrix")
    return Expansion(tuple(entries), (*problems, *_same_folder(entries)), tuple(left_out))


def _entries_of(
    group: FloorGroup, floor: Path, storeys: Sequence[ModelStorey] | InputError, left_out: dict[str, None]
) -> tuple[list[Entry], list[EntryFault]]:
    """Entries of one file: its storeys x dates x variants, less those that are excluded."""
    if isinstance(storeys, InputError):
        return [], [EntryFault(group.place, str(storeys))]
    try:
        names = _chosen(group, floor, storeys, left_out)
    except InputError as error:
        return [], [EntryFault(group.place, str(error))]
    made, faults = [], []
    dates: Sequence[str | None] = group.dates or (None,)
    for storey, date, variant in product(names, dates, _variants(group.matrix)):
        axes = {"file": floor.name, "storey": storey or "", "date": date or "", "variant": _named(variant)}
        if any(_matches(rule, axes) for rule in group.exclude):
            continue
        try:
            made.append(_entry(group, floor, axes, variant))
        except InputError as error:
            faults.append(EntryFault(f"{group.place}, {_shown(axes)}", str(error)))
    return made, faults


def _entry(group: FloorGroup, floor: Path, axes: Mapping[str, str], variant: Mapping[str, Any]) -> Entry:
    options = {**group.options, **variant}
    for rule in group.override:
        if _matches(rule.when, axes):
            options |= rule.options
    options |= {key: axes[key] for key in ("storey", "date") if axes[key]}
    settings = read_settings(group.parameters, options)
    if settings.schedule is not None:
        settings = replace(settings, schedule=str(group.folder / settings.schedule))
    site = "/".join(_folder(part) for part in (group.name or floor.stem, axes["storey"]) if part)
    name = "/".join([site, *(_folder(axes[key]) for key in ("date", "variant") if axes[key])])
    return Entry(name, site, floor, settings, group.place, tuple(axes.items()))


def _chosen(
    group: FloorGroup, floor: Path, storeys: Sequence[ModelStorey], left_out: dict[str, None]
) -> list[str | None]:
    """Names of the storeys that the group's patterns choose; without a pattern those planned by default.

    Raises
    ------
    InputError
        When a pattern names no storey of the file.
    """
    if not storeys:
        if group.storeys:
            raise InputError(f"{floor}: has no storeys; remove storeys = {list(group.storeys)}")
        return [None]
    if not group.storeys:
        chosen: list[str | None] = [item.name for item in storeys if item.planned]
        for item in storeys:
            if not item.planned:
                left_out[f"{floor}: {item.name}: {item.reason}"] = None
        if not chosen:
            raise InputError(f"{floor}: has no storey that is planned without storeys; give storeys")
        return chosen
    names: dict[str | None, None] = {}
    for pattern in group.storeys:
        matched = [item.name for item in storeys if fnmatchcase(item.name, pattern) or item.name == pattern]
        if not matched:
            known = ", ".join(item.name for item in storeys)
            raise InputError(f"{floor}: storeys: no storey is called {pattern!r}; it has: {known}")
        names.update(dict.fromkeys(matched))
    return list(names)


def _variants(matrix: Mapping[str, Sequence[Any]]) -> Iterable[dict[str, Any]]:
    """Every combination of the values of a matrix."""
    return (dict(zip(matrix, values, strict=True)) for values in product(*matrix.values()))


def _named(variant: Mapping[str, Any]) -> str:
    return ",".join(f"{key}={_value(value)}" for key, value in variant.items())


def _value(value: object) -> str:
    if isinstance(value, list | tuple):
        return "+".join(map(_value, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _matches(rule: Mapping[str, str], axes: Mapping[str, str]) -> bool:
    return all(fnmatchcase(axes[key], pattern) for key, pattern in rule.items())


def _shown(axes: Mapping[str, str]) -> str:
    return ", ".join(f"{key} {value}" for key, value in axes.items() if value)


def _folder(part: str) -> str:
    """A part of an entry's name as every file system takes it."""
    plain = "".join(letter if letter.isalnum() or letter in "_+=,.-" else "-" for letter in part)
    return plain.strip("-.")[:80] or "unnamed"


def _same_folder(entries: Sequence[Entry]) -> list[EntryFault]:
    """Problems of entries whose results would have the same folder."""
    first: dict[str, Entry] = {}
    problems = []
    for entry in entries:
        other = first.setdefault(entry.name.casefold(), entry)
        if other is not entry:
            text = f"{entry.floor}: its folder {entry.name} is also that of {other.place}, {other.floor}"
            problems.append(EntryFault(entry.place, f"{text}; give one of them another name"))
    return problems
