"""What a floor's file holds: its storeys or drawings, what its layers were taken for, and what is odd."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from stopgo.mission.floor import Finding, FloorPlan
from stopgo.mission.geometry import FloatArray


@dataclass(frozen=True)
class FloorChoice:
    """One floor of a file that can be planned: a storey of a model, or a drawing in a model space."""

    name: str
    option: str
    """What chooses it on the command line, such as `--storey EG`; empty where the file holds but one."""
    level_m: float | None = None
    area_m2: float | None = None
    bounds: tuple[float, float, float, float] | None = None
    """x0, y0, x1, y1 in metres."""
    elements: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """Elements by kind; `rooms`, `doors` and `passages` are counted with them."""
    notes: tuple[str, ...] = ()
    """What a person should know, such as `foundation` or `2 duplicates merged`."""
    aside: bool = False
    """Whether nobody would plan it: a foundation, a roof, or what has no floor."""
    chosen: bool = False
    """Whether this is the floor that is planned with the same options."""


@dataclass(frozen=True)
class LayerUse:
    """What a layer of a drawing, or a class of a model's elements, was taken for."""

    name: str
    role: str
    """A role of LAYER_ROLES."""
    why: str
    """What says so, such as `AIA name A-WALL*` or `as told`."""
    taken: int = 0
    """Entities that were used."""
    ignored: int = 0
    """Entities that were not."""


@dataclass(frozen=True, eq=False)
class SurveyLine:
    """A line of a drawing, for a picture of what was taken and what was ignored."""

    points: FloatArray
    """(n, 2) in metres."""
    taken: bool
    closed: bool = False


@dataclass(frozen=True)
class Survey:
    """What is in a floor's file, told before anybody plans."""

    file: str
    kind: str
    """Such as `DXF drawing, AC1032` or `IFC4 model`."""
    digest: str
    units: str | None = None
    """The unit of length and what says so, such as `millimetre, as the header says`."""
    floors: tuple[FloorChoice, ...] = ()
    layers: tuple[LayerUse, ...] = ()
    inferred: tuple[str, ...] = ()
    """What the file does not say and was worked out, one sentence each."""
    ignored: tuple[str, ...] = ()
    """What is in the file and was left out, one sentence each."""
    findings: tuple[Finding, ...] = ()
    lines: tuple[SurveyLine, ...] = ()
    """What is drawn, where the file is a drawing …"""
    floor: FloorPlan | None = None
    """… and the floor that was made of it; none where that cannot be done."""
    refusal: str | None = None
    """Why no floor can be made of it with these options, and the way out."""

    def as_json(self) -> dict[str, Any]:
        """The object that `stopgo floors --json` prints."""
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
