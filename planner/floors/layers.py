"""Decides what each layer of a drawing stands for: as told, as mapped, by our own names, or by its name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from stopgo.mission.settings.element_kinds import KINDS
from stopgo.planner.floors.layer_names import LayerReading, reading_of

ROLES: dict[str, str] = {
    "FLOOR": "floor",
    "ROOMS": "rooms",
    "DOORS": "doors",
    "PASSAGES": "passages",
    **{kind.upper(): kind for kind in KINDS if kind != "other"},
}
"""What the shapes of a layer of our own names are."""
IGNORE = "ignore"
OTHER = LayerReading("other", "no known name")
NEEDED = ("floor", "rooms", "walls")
"""What a layered drawing has, besides doors or passages."""

_NONE: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class Layers:
    """What layers stand for; names are in capitals."""

    told: Mapping[str, str] = field(default_factory=lambda: _NONE)
    """By options of the command."""
    mapped: Mapping[str, str] = field(default_factory=lambda: _NONE)
    """By a file that a person may have corrected."""
    by_name: frozenset[str] = frozenset()
    """Roles for which names of other kinds than ours are read."""

    def reading(self, layer: str, blocks: Sequence[str]) -> LayerReading:
        """What a layer stands for, and why; where its name says nothing, what the blocks around it do."""
        name = layer.upper()
        if name in self.told:
            return LayerReading(self.told[name], "as told")
        if name in self.mapped:
            return LayerReading(self.mapped[name], "by the map")
        if name in ROLES:
            return LayerReading(ROLES[name], "its name")
        if not self.by_name:
            return OTHER
        found = reading_of(layer) or self._by_blocks(blocks)
        return found if found.role in self.by_name else OTHER

    def _by_blocks(self, blocks: Sequence[str]) -> LayerReading:
        for block in blocks:
            found = reading_of(block)
            if found is not None and found.role in _OF_BLOCKS:
                return LayerReading(found.role, f"{found.why} in its block's name")
        return OTHER


_OF_BLOCKS = ("doors", "windows", "columns", "stairs", "furniture", "walls", "railings")
"""What blocks are drawn of; a block named by a storey or a view is not one of it."""


ALL_ROLES = frozenset({*ROLES.values(), "openings", "furniture", "names", IGNORE})
"""Every role that a layer's name can give it."""


def missing_in(roles: frozenset[str]) -> frozenset[str]:
    """Which roles are looked for by other names, where our own names show some of a floor."""
    if "floor" not in roles:
        return ALL_ROLES
    doors = frozenset() if roles & {"doors", "passages"} else frozenset({"doors", "openings", "passages"})
    rooms = frozenset() if "rooms" in roles else frozenset({"rooms", "names"})
    return doors | rooms | ({"walls"} - roles)


def is_layered(roles: frozenset[str]) -> bool:
    """Whether layers of our own names show all of a floor, so that nothing needs to be worked out."""
    return roles >= set(NEEDED) and bool(roles & {"doors", "passages"})
