"""Kinds of element by layer of a drawing, as a person gives them: in a file, or entry by entry."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from pathlib import Path

from stopgo.mission.errors import InputError
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.settings.toml_file import read_toml

LAYER_ROLES = ("floor", "rooms", "names", "doors", "openings", "passages", *KINDS, "furniture", "ignore")
"""Roles of a layer; `names` are of rooms, `openings` are doors and windows alike."""


def layer_option(layer: str, kind: str = "KIND") -> str:
    """Return the option that gives a layer a kind, quoted so that a shell takes it as it is printed."""
    return f"--layer {shlex.quote(f'{layer}={kind}')}"


def entries_in(given: str) -> tuple[str, ...]:
    """Entries `NAME=KIND` of a file that `stopgo floors --write-map` wrote, or written out, with commas.

    Raises
    ------
    InputError
        Naming the file, the key or layer, the value and what would be right.
    """
    path = Path(given)
    if "=" in given and not path.exists():
        return tuple(entry.strip() for entry in given.split(","))
    document = read_toml(path, remedy=f"write one with: stopgo floors FLOOR.dxf --write-map {path.name}")
    for key in document:
        if key != "layers":
            raise InputError(f"{path}: unknown key {key}; known: [layers]")
    layers = document.get("layers", {})
    if not isinstance(layers, dict) or not layers:
        raise InputError(f'{path}: no table [layers] with lines such as "A-WALL" = "walls"')
    for name, kind in layers.items():
        if kind not in LAYER_ROLES:
            raise InputError(f"{path}: {name} = {kind}: unknown kind; known: {', '.join(LAYER_ROLES)}")
    return tuple(f"{name}={kind}" for name, kind in layers.items())


def kinds_by_name(entries: Iterable[str]) -> dict[str, str]:
    """Kinds by layers' names in capitals."""
    pairs = (entry.rpartition("=") for entry in entries)
    return {name.strip().upper(): kind.strip().lower() for name, _, kind in pairs}


def check_entries(entries: Iterable[str], *, key: str) -> None:
    """Refuse an entry that names no layer or no kind."""
    for entry in entries:
        name, _, kind = entry.rpartition("=")
        if not name.strip() or kind.strip().lower() not in LAYER_ROLES:
            raise InputError(f"{key} {entry}: write NAME=KIND; kinds: {', '.join(LAYER_ROLES)}")
