"""Writes the file in which a person says what the layers of a drawing stand for."""

from __future__ import annotations

import json
from collections.abc import Iterator

from stopgo.mission.errors import InputError
from stopgo.mission.settings.layer_kinds import LAYER_ROLES
from stopgo.planner.floors.survey import LayerUse, Survey


def layer_map(found: Survey) -> str:
    """The layers of a surveyed drawing as such a file.

    Raises
    ------
    InputError
        When there are none, as in a robot's map.
    """
    if not found.layers:
        raise InputError(f"{found.file}: has no layers to write down; leave --write-map out")
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
