"""A floor as it was read: outline, rooms, openings, elements, and anomalies of the input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from types import MappingProxyType

from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import FloatArray, Polygon


class Rank(IntEnum):
    """Effect of a finding on a plan, the worst first."""

    GRAVE = 0
    """The plan may be wrong or leave something out; `--strict` refuses it."""
    DOUBT = 1
    """Worth a look at the drawing."""
    NOTE = 2
    """Repaired or left out without harm."""


GRAVE = (
    *("walls_missing", "little_reached", "stray_element", "leg_over_ignored", "units_doubtful"),
    "scans_apart",
    "accuracy_not_met",
    *("no_geometry", "no_body", "kernel_crashed", "damaged_model", "schedule_unrelated"),
    "limits_not_met",
    *("open_outline", "missing_block", "no_outline", "bad_coordinates"),
)
NOTES = (
    *("floor_from_rooms", "floor_from_proxies", "rooms_derived", "spaces_overlap", "beside_floor"),
    *("duplicate", "repeated_points", "no_length", "text_outside_rooms", "gap_closed", "repaired"),
    "joint_closed",
    *("layer_as_told", "exterior_opening", "rooms_overlap"),
)


@dataclass(frozen=True)
class Finding:
    """An anomaly of the input; it is passed on with the results made from the input."""

    code: str
    """A short fixed word per kind of finding, such as `unknown_layer` or `narrow_door`."""
    message: str
    """One sentence for a person, with the object and the value."""
    element: str | None = None
    """Id of the element, opening or room that it concerns."""
    at: tuple[float, float] | None = None
    """Position, in the drawing's metres."""

    @property
    def rank(self) -> Rank:
        """Its effect on a plan, by its code."""
        return Rank.GRAVE if self.code in GRAVE else Rank.NOTE if self.code in NOTES else Rank.DOUBT


@dataclass(frozen=True, eq=False)
class Element:
    """A building element's plan: filled shapes, open lines, or both."""

    id: str
    kind: str
    solids: tuple[Polygon, ...] = ()
    """Closed shapes, filled."""
    lines: tuple[FloatArray, ...] = ()
    """Open polylines, each (n, 2)."""
    global_id: str | None = None
    """IFC GlobalId, where the drawing carries one."""
    occludes: bool = False
    obstacle: bool = False
    target: bool = False
    to_scan: bool = True
    """False if it is no target whatever its kind: it is not built yet, or was scanned before."""
    heights: tuple[float, float] | None = None
    """Lower and upper height above the floor in metres, if the model contains them."""


@dataclass(frozen=True, eq=False)
class IgnoredLine:
    """Line of an unknown layer; it is no obstacle and no element, but it was drawn."""

    layer: str
    points: FloatArray
    """(n, 2)."""


@dataclass(frozen=True, eq=False)
class Room:
    """A room's area, wall face to wall face; `name` is empty when the drawing gives none."""

    id: str
    name: str
    polygons: tuple[Polygon, ...]
    global_id: str | None = None

    @property
    def label(self) -> str:
        return self.name or self.id

    @property
    def area(self) -> float:
        """Area in m²."""
        return sum(polygon.area for polygon in self.polygons)


@dataclass(frozen=True, eq=False)
class Opening:
    """A door or an open passage, as the line across it (2, 2)."""

    id: str
    kind: str
    """`door` or `passage`."""
    line: FloatArray
    global_id: str | None = None


@dataclass(frozen=True, eq=False)
class Georeference:
    """The site's origin: WGS84 degrees, metres, and the bearing of +y clockwise from true north."""

    lat: float
    lon: float
    alt: float
    heading_deg: float


@dataclass(frozen=True, eq=False)
class FloorPlan:
    """A floor in the drawing's own coordinates, in metres."""

    name: str
    source: FloorSource
    outline: tuple[Polygon, ...]
    """The floor layer: every part of it, holes included."""
    rooms: tuple[Room, ...] = ()
    openings: tuple[Opening, ...] = ()
    elements: tuple[Element, ...] = ()
    level: str | None = None
    georeference: Georeference | None = None
    findings: tuple[Finding, ...] = ()
    status: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))
    """Elements on this floor by construction status, on the day in `source`; empty without one."""
    on_robots_map: bool = False
    """True if the coordinates are those of the robot's own map."""
    ceiling_m: float | None = None
    """Height of the next storey's floor above this one, if the model contains it."""
    ignored: tuple[IgnoredLine, ...] = ()
    """Lines of unknown meaning; a plan that crosses one reports it."""
    solids: ModelSolids | None = field(default=None, repr=False)
    """All that stops the laser, if the heights are known."""

    @property
    def digest(self) -> str:
        """sha256 of the file's bytes, hexadecimal."""
        return self.source.digest

    @property
    def area(self) -> float:
        """Area in m² of the outline, holes subtracted."""
        return sum(polygon.area for polygon in self.outline)

    def with_targets(self, kinds: tuple[str, ...]) -> FloorPlan:
        """Return the same floor with exactly the elements of `kinds` as targets."""
        elements = tuple(replace(item, target=item.to_scan and item.kind in kinds) for item in self.elements)
        return replace(self, elements=elements)
