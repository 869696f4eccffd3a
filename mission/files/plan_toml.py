"""plan.toml and options -> checked parameters; parameters -> a plan.toml that reads back the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.mission.settings import PARAMETERS, Settings, check_settings
from stopgo.mission.settings.parameter import Parameter
from stopgo.mission.settings.scanners import SCANNERS
from stopgo.mission.settings.toml_file import read_toml


def read_settings(path: Path | None, overrides: dict[str, Any]) -> Settings:
    """Return the parameters from plan.toml (if given) and then `overrides`; both are checked.

    Raises
    ------
    InputError
        Naming the file or option, the key, the value and what would be right.
    """
    import msgspec

    values = {} if path is None else _values_of(path)
    values.update({key: value for key, value in overrides.items() if value is not None})
    for key in values:
        if key not in PARAMETERS:
            raise InputError(f"{key}: no such parameter; known: {', '.join(PARAMETERS)}")
    try:
        typed = msgspec.convert(values, Settings)
    except msgspec.ValidationError as error:
        raise InputError(_said(str(error), values, path)) from None
    given = {key: getattr(typed, key) for key in values}  # typed itself lacks the defaults
    facts = {} if given.get("scanner") is None else SCANNERS[given["scanner"]].values()
    settings = Settings(**{**facts, **given})
    check_settings(settings)
    return settings


def settings_toml(settings: Settings) -> str:
    """Return the parameters as a plan.toml that reads back the same; undecided ones are comments."""
    lines: list[str] = []
    for table, parameters in _tables().items():
        lines.append(f"[{table}]")
        for parameter in parameters:
            value = getattr(settings, parameter.name)
            undecided = f"# {parameter.name} = ({parameter.undecided})"
            lines.append(f"# {parameter.meaning}")
            lines.append(undecided if value is None else f"{parameter.name} = {_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def settings_json(settings: Settings) -> dict[str, dict[str, Any]]:
    """Return the parameters by their table in plan.toml; undecided ones are null."""
    return {
        table: {parameter.name: getattr(settings, parameter.name) for parameter in parameters}
        for table, parameters in _tables().items()
    }


def _said(error: str, values: dict[str, Any], path: Path | None) -> str:
    """Return a refused value as one line: key, value, and the valid values."""
    what, _, where = error.partition(" - at `$.")
    key = where.rstrip("`").partition("[")[0]
    return f"{f'{path}: ' if path else ''}{key} = {_shown(values[key])}: {PARAMETERS[key].right or what}"


def _shown(value: object) -> str:
    if isinstance(value, tuple | list):
        return ",".join(_shown(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _values_of(path: Path) -> dict[str, Any]:
    document = read_toml(path)
    tables = _tables()
    known = ", ".join(f"[{table}]" for table in tables)
    values: dict[str, Any] = {}
    for table, content in document.items():
        if not isinstance(content, dict):
            raise InputError(f"{path}: {table} = {content} is in no table; known: {known}")
        if table not in tables:
            raise InputError(f"{path}: unknown table [{table}]; known: {known}")
        for key in content:
            if key not in PARAMETERS or PARAMETERS[key].section != table:
                raise InputError(f"{path}: unknown key {key} in [{table}]; {_home_of(key, table)}")
        values.update(content)
    return values


def _tables() -> dict[str, list[Parameter]]:
    """Return the tables of plan.toml and the parameters in each."""
    found: dict[str, list[Parameter]] = {}
    for parameter in PARAMETERS.values():
        found.setdefault(parameter.section, []).append(parameter)
    return found


def _home_of(key: str, table: str) -> str:
    if key in PARAMETERS:
        return f"it belongs in [{PARAMETERS[key].section}]"
    return f"known there: {', '.join(parameter.name for parameter in _tables()[table])}"


def _toml(value: object) -> str:
    if isinstance(value, tuple):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
