"""TOML files that people write: parameters, kinds of layers, rosters, profiles."""

from __future__ import annotations

import io
import re
from datetime import date, time
from pathlib import Path
from typing import Any

from stopgo.mission.console.whole_file import whole_file
from stopgo.mission.errors import InputError


def read_toml(path: Path, *, remedy: str = "") -> dict[str, Any]:
    """Read a TOML file; `remedy` says how to get one where there is none.

    Dates and times without quotes are read as their text: no key takes anything else.

    Raises
    ------
    InputError
        Naming the file and the problem.
    """
    import tomllib

    try:
        text = io.TextIOWrapper(io.BytesIO(whole_file(path)), encoding="utf-8-sig").read()
        if max(map(_dots, text.splitlines()), default=0) > MOST_DOTS:
            raise InputError(f"{path}: a key has more than {MOST_DOTS} dots; write a flat file")
        return {key: _as_text(value) for key, value in tomllib.loads(text).items()}
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None
    except RecursionError:
        raise InputError(f"{path}: TOML is nested too deeply; write a flat file") from None
    except (OSError, ValueError) as error:  # a name that no file can have is a ValueError
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({why}){f'; {remedy}' if remedy else ''}") from None


def _dots(line: str) -> int:
    """Dots before the value in a line: keys of very many parts take memory as the square of their number."""
    return 0 if line.lstrip().startswith("#") else line.partition("=")[0].count(".")


MOST_DOTS = 1000
"""Dots that a key may have, or a table's name."""


def with_quotes(problem: str) -> str:
    """Return msgspec's problem with a value, and whether quotes are missing or too many."""
    found = re.search(r"Expected `([^`]+)`.*, got `(\w+)`", problem)
    if found is None:
        return problem
    wanted, given = set(found[1].split(" | ")), found[2]
    if "str" in wanted and given in PLAIN:
        return f"{problem}; write it in quotes"
    if given == "str" and wanted & PLAIN:
        return f"{problem}; write it without quotes"
    return problem


PLAIN = frozenset({"int", "float", "bool"})
"""msgspec's names of values that stand without quotes."""


def _as_text(value: Any) -> Any:
    """Return a value with the text of every date and time in it."""
    if isinstance(value, date | time):  # a datetime is a date
        return value.isoformat()
    if isinstance(value, dict):
        return {key: _as_text(item) for key, item in value.items()}
    return [_as_text(item) for item in value] if isinstance(value, list) else value
