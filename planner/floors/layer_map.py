"""Reads and writes the file in which a person says what the layers of a drawing stand for."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

from mission.errors import InputError
from mission.settings import LAYER_ROLES
from planner.floors.survey import LayerUse, Survey


def read_layer_map(path: Path) -> dict[str, str]:
    """Kinds by layers' names in capitals.

    Raises
    ------
    InputError
        Naming the file, the key or layer, the value and what would be right.
    """
    document = _read_toml(path)
    for key in document:
        if key != "layers":
            raise InputError(f"{path}: unknown key {key}; known: [layers]")
    layers = document.get("layers", {})
    if not isinstance(layers, dict) or not layers:
        raise InputError(f'{path}: no table [layers] with lines such as "A-WALL" = "walls"')
    for name, kind in layers.items():
        if kind not in LAYER_ROLES:
            raise InputError(f"{path}: {name} = {kind}: unknown kind; known: {', '.join(LAYER_ROLES)}")
    return {name.strip().upper(): str(kind) for name, kind in layers.items()}


def _read_toml(path: Path) -> dict[str, object]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); write one with: "
            f"stopgo floors FLOOR.dxf --write-map {path.name}"
        ) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a TOML file ({error})") from None


def layer_map(found: Survey) -> str:
    """The layers of a surveyed drawing as such a file."""
    return "\n".join(
        [
            f"# What the layers of {found.file} stand for. Correct the kinds, then plan with: --layers FILE",
            f"# kinds: {', '.join(LAYER_ROLES)}",
            "",
            "[layers]",
            *_lines(found.layers),
            "",
        ]
    )


def _lines(layers: tuple[LayerUse, ...]) -> Iterator[str]:
    """A line per layer; one whose content is told apart by the names of its blocks stands as a comment."""
    for name in sorted({item.name for item in layers}):
        uses = [item for item in layers if item.name == name]
        kind = uses[0].role
        why = "; ".join(dict.fromkeys(_told(item) for item in uses))
        mark = "" if len({item.role for item in uses}) == 1 and kind in LAYER_ROLES else "# "
        yield f"{mark}{json.dumps(name, ensure_ascii=False)} = {json.dumps(kind)}  # {why}"


def _told(item: LayerUse) -> str:
    return f"{item.taken + item.ignored} as {item.role}: {item.why}"
