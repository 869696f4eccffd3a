"""Meaning of each layer of a drawing: given by the user, mapped, by stopgo's own names, or by its name."""

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
"""Role of the shapes on each layer with one of stopgo's own names."""
IGNORE = "ignore"
BY_GEOMETRY = "by the line work: no name shows it"
"""Source of a meaning that trials of the layers found."""
OTHER = LayerReading("other", "no known name")
NEEDED = ("floor", "rooms", "walls")
"""Roles that a layered drawing needs, in addition to doors or passages."""

_NONE: Mapping[str, str] = MappingProxyType({})


@dataclass(frozen=True)
class Layers:
    """Meanings of layers; names are in capitals."""

    given: Mapping[str, str] = field(default_factory=lambda: _NONE)
    """Given by options of the command."""
    mapped: Mapping[str, str] = field(default_factory=lambda: _NONE)
    """Given by a file that a person may have corrected."""
    found: Mapping[str, str] = field(default_factory=lambda: _NONE)
    """Found by the line work."""
    by_name: frozenset[str] = frozenset()
    """Roles for which other names than stopgo's own are read."""

    def reading(self, layer: str, blocks: Sequence[str]) -> LayerReading:
        """Return the meaning of a layer and its source; if the name is unknown, by the blocks around it."""
        name = layer.upper()
        if name in self.given:
            return LayerReading(self.given[name], "as given")
        if name in self.mapped:
            return LayerReading(self.mapped[name], "by the map")
        if name in self.found:
            return LayerReading(self.found[name], BY_GEOMETRY)
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
"""Roles that a block's name can give; a block named after a storey or a view gives none."""


ALL_ROLES = frozenset({*ROLES.values(), "openings", "furniture", "names", IGNORE})
"""Every role that a layer's name can give it."""


def missing_in(roles: frozenset[str]) -> frozenset[str]:
    """Roles to search by other names, if stopgo's own names show only a part of a floor."""
    if "floor" not in roles:
        return ALL_ROLES
    doors = frozenset() if roles & {"doors", "passages"} else frozenset({"doors", "openings", "passages"})
    rooms = frozenset() if "rooms" in roles else frozenset({"rooms", "names"})
    return doors | rooms | ({"walls"} - roles)


def is_layered(roles: frozenset[str]) -> bool:
    """True if layers with stopgo's own names show all of a floor, so that nothing is inferred."""
    return roles >= set(NEEDED) and bool(roles & {"doors", "passages"})
