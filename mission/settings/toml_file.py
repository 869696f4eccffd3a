"""TOML files that people write: parameters, kinds of layers, rosters, profiles."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from stopgo.mission.errors import InputError


def read_toml(path: Path, *, remedy: str = "") -> dict[str, Any]:
    """Read a TOML file; `remedy` says how to get one where there is none.

    Raises
    ------
    InputError
        Naming the file and the problem.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None
    except RecursionError:
        raise InputError(f"{path}: TOML is nested too deeply; write a flat file") from None
    except (OSError, ValueError) as error:  # a name that no file can have is a ValueError
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({why}){f'; {remedy}' if remedy else ''}") from None
