"""Presets of options: the robot, its endpoint, the keys and the site need not be typed each time.

An option takes precedence over the environment (STOPGO_ROBOT, STOPGO_CONNECT, …). The environment takes
precedence over `stopgo.toml` in the working folder, and that over the one in the user's configuration folder.
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
"""Names of presets in stopgo.toml; an option is `--NAME`, an environment variable `STOPGO_NAME`."""
FILE = "stopgo.toml"


@dataclass(frozen=True)
class Preset:
    """Value of an option that is not typed."""

    value: str
    source: str
    """Origin of the value, as a message names it."""
    rank: int
    """Rank of its source; 0 takes precedence."""


Profile = Mapping[str, Preset]
"""Presets by name."""


def read_profile(environment: Mapping[str, str] = os.environ, *, folder: Path | None = None) -> Profile:
    """Read the presets; of each name the value of the source that takes precedence.

    Raises
    ------
    InputError
        Names the file, and the unknown key or the wrong value.
    """
    found, faults = read_valid_profile(environment, folder=folder)
    for fault in faults.values():
        raise InputError(fault)
    return found


def read_valid_profile(
    environment: Mapping[str, str] = os.environ, *, folder: Path | None = None
) -> tuple[Profile, Mapping[int, str]]:
    """Read the presets of all sources that are valid, and the fault of each other one by its rank."""
    found: dict[str, Preset] = {}
    faults: dict[int, str] = {}
    sources = (_of_environment(environment), *map(_of_file, profile_files(environment, folder)))
    for rank, source in enumerate(sources):
        try:
            presets = list(source)
        except InputError as error:
            faults[rank] = str(error)
            continue
        for name, value, where in presets:
            found.setdefault(name, Preset(value, where, rank))
    return found, faults


def effective(profile: Profile, typed: Set[str]) -> Profile:
    """Return the presets that apply, given the names of the options that were typed.

    Only one of `robot` and `mavlink` applies: the one whose source takes precedence.

    Raises
    ------
    InputError
        If one source presets both.
    """
    applying = {name: preset for name, preset in profile.items() if name not in typed}
    if typed & {"robot", "mavlink"}:
        return {name: preset for name, preset in applying.items() if name not in ("robot", "mavlink")}
    robot, mavlink = applying.get("robot"), applying.get("mavlink")
    if robot is None or mavlink is None:
        return applying
    if robot.rank == mavlink.rank:
        raise InputError(f"{robot.source}: robot and mavlink are both preset; name one with an option")
    applying.pop("mavlink" if robot.rank < mavlink.rank else "robot")
    return applying


def profile_files(
    environment: Mapping[str, str] = os.environ, folder: Path | None = None
) -> tuple[Path, ...]:
    """Return the paths of the stopgo.toml files that are read; the first takes precedence."""
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
    try:
        is_there = path.exists()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    if not is_there:
        return
    for name, value in read_toml(path).items():
        if name not in NAMES:
            raise InputError(f"{path}: unknown key {name}; known: {', '.join(NAMES)}")
        if not isinstance(value, str) or not value:
            raise InputError(f'{path}: {name} = {value!r}: write a text in quotes, such as {name} = "r1"')
        yield name, str(path.parent / value) if name == "keys" else value, str(path)
