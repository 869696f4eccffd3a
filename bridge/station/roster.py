"""Expected robots of a site: those of a roster, or all that were ever seen from this station.

A robot that does not answer can only be reported as missing if it is expected. `Sightings` store for each
robot the time and state of its last answer.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path

import msgspec

from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.mission.document.decoding import one_decode_error
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import file_name
from stopgo.mission.settings.toml_file import read_toml


class LastSeen(msgspec.Struct, frozen=True, kw_only=True):
    """Time and state of a robot's last answer."""

    at: datetime
    state: str


Sightings = Mapping[str, LastSeen]
"""Last answers, by robot."""


def default_sightings_file(endpoint: str, site: str | None) -> Path:
    """Return the file of the robots seen through an endpoint, in `$XDG_STATE_HOME/stopgo/seen`."""
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    name = file_name(endpoint if site is None else f"{endpoint} {site}")
    return Path(home) / "stopgo" / "seen" / f"{name}.json"


def read_sightings(path: Path) -> Sightings:
    """Read the robots of a file of sightings; none if it does not exist or is damaged."""
    try:
        with one_decode_error():
            return msgspec.json.decode(path.read_bytes(), type=dict[str, LastSeen])
    except (OSError, msgspec.DecodeError):
        return {}


def remember(path: Path, seen: Sightings) -> None:
    """Add sightings to the file; raises `InputError` if it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path.parent}: cannot store the known robots ({error.strerror});"
            " set XDG_STATE_HOME to a writable folder"
        ) from None
    write_atomic(path, msgspec.json.encode({**read_sightings(path), **seen}, order="sorted"))


def forget(path: Path, names: Iterable[str]) -> None:
    """Remove robots from the file, so that they are expected no more.

    Raises
    ------
    InputError
        If one was never seen.
    """
    known = dict(read_sightings(path))
    for name in names:
        if name not in known:
            raise InputError(f"--forget {name}: unknown here; known: {', '.join(known) or 'none'}")
        del known[name]
    write_atomic(path, msgspec.json.encode(known, order="sorted"))


def read_roster(path: Path) -> tuple[str, ...]:
    """Read the robots of a roster file: `robots = ["r1", "r2"]`.

    Raises
    ------
    InputError
        Names the file, and its error.
    """
    document = read_toml(path)
    names = document.get("robots")
    if set(document) != {"robots"} or not isinstance(names, list) or not names:
        raise InputError(f'{path}: must be one list, as in: robots = ["r1", "r2"]')
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"{path}: {name!r} is not a robot's name; write it in quotes")
        KeyExpressions(name)
    return tuple(dict.fromkeys(names))
