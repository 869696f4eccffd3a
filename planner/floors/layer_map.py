"""Writer of the layer map: the file in which a person sets the meaning of a drawing's layers."""

from __future__ import annotations

import json
from collections.abc import Iterator

from stopgo.mission.errors import InputError
from stopgo.mission.settings.layer_kinds import LAYER_ROLES
from stopgo.planner.floors.survey import LayerUse, Survey


def layer_map(found: Survey) -> str:
    """Return the text of a layer map for a surveyed drawing.

    Raises
    ------
    InputError
        When the file has no layers, such as a robot's map.
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
    """One line per layer; a layer whose blocks have several meanings becomes a comment."""
    for name in sorted({item.name for item in layers}):
        uses = [item for item in layers if item.name == name]
        kind = uses[0].role
        why = "; ".join(dict.fromkeys(_use_text(item) for item in uses))
        mark = "" if len({item.role for item in uses}) == 1 and kind in LAYER_ROLES else "# "
        yield f"{mark}{json.dumps(name, ensure_ascii=False)} = {json.dumps(kind)}  # {why}"


def _use_text(item: LayerUse) -> str:
    return f"{item.taken + item.ignored} as {item.role}: {item.why}"
