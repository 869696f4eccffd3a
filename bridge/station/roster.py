"""Expected robots of a site: those of a roster, or all that were ever seen from this station.

A robot that does not answer can only be reported as missing if it is expected. `Sightings` store for each
robot the time and state of its last answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec

from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.mission.console.state_folder import state_folder
from stopgo.mission.console.whole_file import must_end
from stopgo.mission.document.decoding import converted, decoded
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


class RosterVehicle(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A vehicle of a roster, which is reached by MAVLink, and what may be done to it."""

    mavlink: str
    """URL, such as `udpout:127.0.0.1:14550`."""
    vehicle: Annotated[int, msgspec.Meta(ge=1, le=255)] | None = None
    """Its system id, if several are at this URL."""
    signing_key: str | None = None
    """File with the key, relative to the roster."""
    arm: bool = False
    set_origin: bool = False
    skip_origin_check: bool = False


def default_sightings_file(endpoint: str, site: str | None) -> Path:
    """Return the file of the robots seen through an endpoint, in `$XDG_STATE_HOME/stopgo/seen`."""
    name = file_name(endpoint if site is None else f"{endpoint} {site}")
    return state_folder() / "seen" / f"{name}.json"


def read_sightings(path: Path) -> Sightings:
    """Read the robots of a file of sightings; none if it does not exist or is damaged."""
    try:
        return decoded(path.read_bytes(), dict[str, LastSeen])
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
    names = document.get("robots", [] if document.get("vehicles") else None)
    if set(document) - {"robots", "vehicles"} or not isinstance(names, list):
        raise InputError(f'{path}: must be one list, as in: robots = ["r1", "r2"]')
    if not names and not document.get("vehicles"):
        raise InputError(f'{path}: must be one list, as in: robots = ["r1", "r2"]')
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"{path}: {name!r} is not a robot's name; write it in quotes")
        KeyExpressions(name)
    return tuple(dict.fromkeys(names))


def read_roster_vehicles(path: Path) -> dict[str, RosterVehicle]:
    """Read the vehicles of a roster file, by name: `[vehicles.rover]` with `mavlink = "udpout:…"`.

    Raises
    ------
    InputError
        Names the file, the vehicle, and its error.
    """
    must_end(path)  # the file is read twice
    robots, given = read_roster(path), read_toml(path).get("vehicles", {})
    if not isinstance(given, dict):
        raise InputError(f"{path}: vehicles must be tables, as in [vehicles.rover]")
    vehicles = {}
    for name, entry in given.items():
        KeyExpressions(name)
        if name in robots:
            raise InputError(f"{path}: {name} is a robot and a vehicle; give one another name")
        try:
            found = converted(entry, RosterVehicle)
        except msgspec.DecodeError as error:
            raise InputError(f"{path}: vehicle {name}: {error}") from None
        key = None if found.signing_key is None else str(path.parent / found.signing_key)
        vehicles[name] = msgspec.structs.replace(found, signing_key=key)
    return vehicles
