"""Survey of a floor's file: its storeys or drawings, the meaning of its layers, and its anomalies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.geometry import FloatArray, bounds, closed


@dataclass(frozen=True)
class FloorChoice:
    """One floor of a file that can be planned: a storey of a model, or a drawing in a model space."""

    name: str
    option: str
    """Option that chooses it, such as `--storey EG`; empty if the file has only one."""
    level_m: float | None = None
    area_m2: float | None = None
    bounds: tuple[float, float, float, float] | None = None
    """x0, y0, x1, y1 in metres."""
    elements: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """Elements by kind; `rooms`, `doors` and `passages` are counted with them."""
    notes: tuple[str, ...] = ()
    """Notes for a person, such as `foundation` or `2 duplicates merged`."""
    aside: bool = False
    """True if it is not planned by default: a foundation, a roof, or a level without a floor."""
    reason: str = ""
    """Reason why it is not planned by default."""
    has_rooms: bool = False
    """True if the model has doors or several rooms on it."""
    chosen: bool = False
    """True if a plan with the same options uses this floor."""


def choice_of(floor: FloorPlan) -> FloorChoice:
    """Return a floor that was read, as the choice of a file."""
    kinds = (*(item.kind for item in floor.elements), *(f"{item.kind}s" for item in floor.openings))
    return FloorChoice(
        name=floor.name,
        option="",
        area_m2=floor.area,
        bounds=bounds([part.exterior for part in floor.outline]),
        elements={"rooms": len(floor.rooms), **Counter(kinds)},
        chosen=True,
    )


@dataclass(frozen=True)
class LayerUse:
    """Meaning assigned to a layer of a drawing, or to a class of a model's elements."""

    name: str
    role: str
    """A role of LAYER_ROLES."""
    why: str
    """Source of the role, such as `AIA name A-WALL*` or `as given`."""
    taken: int = 0
    """Entities that were used."""
    ignored: int = 0
    """Entities that were not used."""


@dataclass(frozen=True, eq=False)
class SurveyLine:
    """A line of a drawing, for a picture of the lines used and the lines ignored."""

    points: FloatArray
    """(n, 2) in metres."""
    taken: bool
    closed: bool = False

    @property
    def drawn(self) -> FloatArray:
        """Points (n, 2); a closed line ends where it begins."""
        return closed(self.points) if self.closed else self.points


@dataclass(frozen=True)
class Survey:
    """Contents of a floor's file, for a report before planning."""

    file: str
    kind: str
    """Such as `DXF drawing, AC1032` or `IFC4 model`."""
    digest: str
    units: str | None = None
    """The unit of length and its source, such as `millimetre, as the header says`."""
    floors: tuple[FloorChoice, ...] = ()
    layers: tuple[LayerUse, ...] = ()
    inferred: tuple[str, ...] = ()
    """Elements that the file does not state and the reader inferred, one sentence each."""
    ignored: tuple[str, ...] = ()
    """Elements of the file that were left out, one sentence each."""
    findings: tuple[Finding, ...] = ()
    lines: tuple[SurveyLine, ...] = ()
    """Lines of the file, if it is a drawing …"""
    floor: FloorPlan | None = None
    """… and the floor made from it; None if that is not possible."""
    refusal: str | None = None
    """Reason why these options give no floor, and the remedy."""

    def as_json(self) -> dict[str, Any]:
        """Return the object that `stopgo floors --json` prints."""
        return {
            "file": self.file,
            "kind": self.kind,
            "digest": self.digest,
            "units": self.units,
            "floors": [_as_json(item) for item in self.floors],
            "refusal": self.refusal,
            "layers": [dict(vars(item)) for item in self.layers],
            "inferred": list(self.inferred),
            "ignored": list(self.ignored),
            "findings": [
                {"rank": item.rank.name.lower(), "code": item.code, "message": item.message}
                | {"element": item.element, "at": item.at}
                for item in self.findings
            ],
        }


def _as_json(floor: FloorChoice) -> dict[str, Any]:
    return {**vars(floor), "elements": dict(floor.elements), "notes": list(floor.notes)}
