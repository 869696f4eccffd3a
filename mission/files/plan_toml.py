"""plan.toml and options -> checked parameters; parameters -> a plan.toml that reads back the same."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.settings.coverage_parameters import ANY_INCIDENCE
from stopgo.mission.settings.parameter import Parameter
from stopgo.mission.settings.parameter_checks import check_settings
from stopgo.mission.settings.scanners import SCANNERS
from stopgo.mission.settings.toml_file import read_toml, with_quotes


def read_settings(
    path: Path | None, overrides: dict[str, Any], *, notify: Callable[[str], None] = lambda line: None
) -> Settings:
    """Settings from plan.toml (if given) and then `overrides`; both are checked.

    A parameter may have the name that missions give it, or the word that people use for it. Its value may be
    a text as on the command line, such as `30min`. `notify` gets a line for every key of plan.toml that has
    a newer name.

    Raises
    ------
    InputError
        Naming the file or option, the key, the value and what would be right.
    """
    values = {} if path is None else _values_of(path, notify)
    for key, value in overrides.items():
        if key not in _NAMES:
            raise _unknown(key)
        if value is not None:
            values[_NAMES[key]] = value
    return _checked({name: PARAMETERS[name].as_option(value) for name, value in values.items()}, path)


def _checked(values: dict[str, Any], path: Path | None = None) -> Settings:
    """Settings with these values by their names in missions, of the right types and within their limits."""
    import msgspec

    from stopgo.mission.document.decoding import converted

    try:
        typed = converted(values, Settings)
    except msgspec.ValidationError as error:
        raise InputError(_refused(str(error), values, path)) from None
    given = {key: getattr(typed, key) for key in values}  # typed itself lacks the defaults
    facts = {} if given.get("scanner") is None else SCANNERS[given["scanner"]].values()
    settings = Settings(**{**facts, **given})
    check_settings(settings)
    return settings


def recorded_settings(parameters: dict[str, Any]) -> Settings:
    """Settings from the parameters that a mission records, also from one of an earlier version.

    Scans of missions without `register` must register only if they give an overlap ratio. In those without
    `max_incidence` any angle counts.

    Raises
    ------
    InputError
        As in `read_settings`.
    """
    earlier = {"register": bool(parameters.get("overlap")), "max_incidence": ANY_INCIDENCE}
    values = {key: value for key, value in {**earlier, **parameters}.items() if value is not None}
    for key in values:
        if key not in _NAMES:
            raise _unknown(key)
    return _checked({_NAMES[key]: value for key, value in values.items()})


def _unknown(key: str) -> InputError:
    return InputError(f"{key}: no such parameter; known: {', '.join(_known())}")


_NAMES = {**{item.key: name for name, item in PARAMETERS.items()}, **{name: name for name in PARAMETERS}}
"""Names in missions, by these names and by the words for people."""


def _known() -> list[str]:
    return [parameter.key for parameter in PARAMETERS.values()]


def settings_toml(settings: Settings) -> str:
    """Return the parameters as a plan.toml that reads back the same; undecided ones are comments."""
    lines: list[str] = []
    for table, parameters in _tables().items():
        lines.append(f"[{table}]")
        for parameter in parameters:
            value = getattr(settings, parameter.name)
            undecided = f"# {parameter.key} = ({parameter.undecided})"
            lines.append(f"# {parameter.meaning}")
            lines.append(undecided if value is None else f"{parameter.key} = {_toml(value)}")
        lines.append("")
    return "\n".join(lines)


def settings_json(settings: Settings) -> dict[str, dict[str, Any]]:
    """Return the parameters by their table in plan.toml; undecided ones are null."""
    return {
        table: {parameter.key: getattr(settings, parameter.name) for parameter in parameters}
        for table, parameters in _tables().items()
    }


def _refused(error: str, values: dict[str, Any], path: Path | None) -> str:
    """A refused value as one line: file and key, or option; the value; and what would be right."""
    problem, _, where = error.partition(" - at `$.")
    key = where.rstrip("`").partition("[")[0]
    parameter, value = PARAMETERS[key], values[key]
    if path is None:
        return f"{parameter.flag} {_shown(value)}: {parameter.right or problem}"
    return f"{path}: {parameter.key} = {_toml(value)}: {parameter.right or with_quotes(problem)}"


def _shown(value: object) -> str:
    if isinstance(value, tuple | list):
        return ",".join(_shown(item) for item in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _values_of(path: Path, notify: Callable[[str], None]) -> dict[str, Any]:
    """The values in a plan.toml, by their names in missions."""
    document = read_toml(path)
    tables = _tables()
    known = ", ".join(f"[{table}]" for table in tables)
    values: dict[str, Any] = {}
    for table, content in document.items():
        if not isinstance(content, dict):
            raise InputError(f"{path}: {table} = {content} is in no table; known: {known}")
        if table not in tables:
            raise InputError(f"{path}: unknown table [{table}]; known: {known}")
        for key, value in content.items():
            name = _NAMES[key] if key in _NAMES else str(key)
            if name not in PARAMETERS or PARAMETERS[name].section != table:
                raise InputError(f"{path}: unknown key {key} in [{table}]; {_home_of(name, table)}")
            if name in values:
                raise InputError(f"{path}: {key} in [{table}] is given by its old and new name; remove one")
            if key != PARAMETERS[name].key:
                notify(f"{path}: {key} is now called {PARAMETERS[name].key}; the old name ends with 0.3")
            values[name] = value
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
    return f"known there: {', '.join(parameter.key for parameter in _tables()[table])}"


def _toml(value: object) -> str:
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
