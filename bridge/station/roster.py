"""Which robots belong to a site: as a roster says, or all that were ever seen from here, and when last.

A robot that is not there is missed only by who knows of it.
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
    """When a robot last told its state, and that state."""

    at: datetime
    state: str


Sightings = Mapping[str, LastSeen]
"""By robot."""


def usual_roster(endpoint: str, site: str | None) -> Path:
    """Where robots that were seen through an endpoint are remembered: in `$XDG_STATE_HOME/stopgo/seen`."""
    home = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    name = file_name(endpoint if site is None else f"{endpoint} {site}")
    return Path(home) / "stopgo" / "seen" / f"{name}.json"


def remembered(path: Path) -> Sightings:
    """Whom the file tells of; nobody if there is none, or it cannot be read any more."""
    try:
        with one_decode_error():
            return msgspec.json.decode(path.read_bytes(), type=dict[str, LastSeen])
    except (OSError, msgspec.DecodeError):
        return {}


def remember(path: Path, seen: Sightings) -> None:
    """Add to what is remembered; raises `InputError` if that cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{path.parent}: robots that were seen cannot be remembered there ({error.strerror});"
            " set XDG_STATE_HOME to a folder that can be written"
        ) from None
    write_atomic(path, msgspec.json.encode({**remembered(path), **seen}, order="sorted"))


def forget(path: Path, names: Iterable[str]) -> None:
    """Miss these robots no more.

    Raises
    ------
    InputError
        If one was never seen.
    """
    known = dict(remembered(path))
    for name in names:
        if name not in known:
            raise InputError(f"--forget {name}: was never seen here; known: {', '.join(known) or 'none'}")
        del known[name]
    write_atomic(path, msgspec.json.encode(known, order="sorted"))


def read_roster(path: Path) -> tuple[str, ...]:
    """The robots that a roster names: `robots = ["r1", "r2"]`.

    Raises
    ------
    InputError
        Naming the file and what is wrong with it.
    """
    document = read_toml(path)
    names = document.get("robots")
    if set(document) != {"robots"} or not isinstance(names, list) or not names:
        raise InputError(f'{path}: must be one list, as in: robots = ["r1", "r2"]')
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"{path}: {name!r} is no robot's name; write it in quotes")
        KeyExpressions(name)
    return tuple(dict.fromkeys(names))
