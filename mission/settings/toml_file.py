"""TOML files that people write: settings, layers' kinds, rosters, profiles."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from stopgo.mission.errors import InputError


def read_toml(path: Path, *, way_out: str = "") -> dict[str, Any]:
    """What stands in the file; `way_out` says how to come by one where there is none.

    Raises
    ------
    InputError
        Naming the file and what is wrong with it.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None
    except RecursionError:
        raise InputError(f"{path}: not a TOML file that people write: it is nested too deeply") from None
    except (OSError, ValueError) as error:  # a name that no file can have is a ValueError
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({why}){f'; {way_out}' if way_out else ''}") from None
