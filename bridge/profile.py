"""What need not be typed with every order: which robot, where it listens, the keys, the site.

An option counts most, then the environment (STOPGO_ROBOT, STOPGO_CONNECT, …), then `stopgo.toml` in the
working folder, then the one in the user's own folder for settings.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from pathlib import Path

from stopgo.mission.errors import InputError
from stopgo.mission.settings.toml_file import read_toml

NAMES = ("robot", "mavlink", "connect", "site", "keys", "as")
"""As in stopgo.toml; options have two hyphens before them, the environment STOPGO_."""
FILE = "stopgo.toml"


@dataclass(frozen=True)
class Preset:
    """A value that need not be typed."""

    value: str
    source: str
    """Where it comes from, for a person."""
    rank: int
    """Of its source; 0 counts most."""


Profile = Mapping[str, Preset]
"""What is preset, by name."""


def read_profile(environment: Mapping[str, str] = os.environ, *, folder: Path | None = None) -> Profile:
    """What is preset here; of each name the value that counts.

    Raises
    ------
    InputError
        Naming the file, and the key that it cannot have or its value.
    """
    found: dict[str, Preset] = {}
    sources = (_of_environment(environment), *map(_of_file, files(environment, folder)))
    for rank, source in enumerate(sources):
        for name, value, where in source:
            found.setdefault(name, Preset(value, where, rank))
    return found


def counting(profile: Profile, typed: Set[str]) -> Profile:
    """What counts beside the options that were typed, by their names.

    A robot takes the place of a vehicle whose preset counts less, and the other way round.
    """
    left = {name: preset for name, preset in profile.items() if name not in typed}
    if typed & {"robot", "mavlink"}:
        return {name: preset for name, preset in left.items() if name not in ("robot", "mavlink")}
    robot, mavlink = left.get("robot"), left.get("mavlink")
    if robot is None or mavlink is None:
        return left
    if robot.rank == mavlink.rank:
        raise InputError(f"{robot.source}: robot and mavlink are both preset; name one with an option")
    left.pop("mavlink" if robot.rank < mavlink.rank else "robot")
    return left


def files(environment: Mapping[str, str] = os.environ, folder: Path | None = None) -> tuple[Path, ...]:
    """Where a stopgo.toml is looked for, the one that counts more first."""
    here = (folder or Path()) / FILE
    try:
        return here, _user_folder(environment) / "stopgo" / FILE
    except RuntimeError:  # a user without a home, as in some containers
        return (here,)


def _user_folder(environment: Mapping[str, str]) -> Path:
    if sys.platform == "win32":
        return Path(environment.get("APPDATA") or Path.home())
    return Path(environment.get("XDG_CONFIG_HOME") or Path.home() / ".config")


def _of_environment(environment: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    for name in NAMES:
        variable = f"STOPGO_{name.upper()}"
        if environment.get(variable):
            yield name, environment[variable], f"environment {variable}"


def _of_file(path: Path) -> Iterator[tuple[str, str, str]]:
    if not path.exists():
        return
    for name, value in read_toml(path).items():
        if name not in NAMES:
            raise InputError(f"{path}: unknown key {name}; known: {', '.join(NAMES)}")
        if not isinstance(value, str) or not value:
            raise InputError(f'{path}: {name} = {value!r}: write a text in quotes, such as {name} = "r1"')
        yield name, str(path.parent / value) if name == "keys" else value, str(path)
