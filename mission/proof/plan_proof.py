"""Verification of a mission by simulation: assumptions, acquired targets, and connected scans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from msgspec import UnsetType

from stopgo.mission.document import Mission
from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.stages import Targets
from stopgo.mission.stages.figures import percent
from stopgo.mission.stages.network import error_limits

ALLOWED_FRACTION = 0.01
"""Tolerated loss against the plan's coverage: targets grazed by rays fall between two rays."""
ALLOWED_UNITS = 3
"""Tolerated units of a stop without a line of sight, or a fiftieth: rays that touch corners."""
ALLOWED_OF_STOP = 0.02
ALLOWED_AREA = 0.02
"""Tolerated difference of the plan's area and the model's …"""
ALLOWED_M2 = 1.0
"""… or of a small kind, in m²."""
ALLOWED_UNITS_OF_PART = 5
"""Tolerated missed units of a room or a kind, however small it is."""
REGISTERED_M = 0.01
"""Greatest error of a registered pair, from every start pose."""
REGISTERED_DEG = 0.1


def within_tolerance(error_m: float, error_deg: float) -> bool:
    """Return True if a pose with this error counts as registered."""
    return error_m < REGISTERED_M and error_deg < REGISTERED_DEG


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """Assumptions of the simulation of a mission; the scanner is level."""

    range_m: float
    joining_m: float = 20.0
    """Range of points used for registration; scanners reach farther than plans require."""
    slant: bool = False
    """True if the range counts along the rays; else along the floor, as in the plan."""
    fov_deg: float = 360.0
    near_m: float = 0.0
    """Minimum scanner range, along the floor."""
    step_deg: float = 0.1
    """Angle between neighbouring rays, in both directions."""
    step_known: bool = False
    """True if it is the scanner's or was given; else it is assumed, and the plan did not count on it."""
    noise_m: float = 0.002
    """Standard deviation of a distance."""
    height_m: float = 1.3
    """Height of the scanner above the floor."""
    ceiling_m: float = 2.7
    """Height of walls and columns."""
    ceiling_known: bool = False
    """True if the model contains that height."""
    cone_deg: float = 0.0
    """Opening angle of the blind cone below the scanner; 0: none."""
    pose_error_m: float = 0.05
    """Error of the robot's pose from which a pair of scans is registered."""
    pose_error_deg: float = 2.0
    poses: bool = True
    """True if registration starts from the robot's poses."""
    seed: int = 1
    solids: Literal["extruded", "model"] = "extruded"
    """Solids at which rays are cast: the floor raised to its walls' height, or those of its model."""


@dataclass(frozen=True)
class PromisedCoverage:
    """Promised coverage of some targets, in metres or units, and its simulated part."""

    name: str
    promised: float
    acquired: float
    """Promised amount that has simulated points."""
    beyond: float
    """Amount with points that was not promised."""
    coverage: float | None = None
    """As promised: the fraction of all visible; None where that is not known."""
    required: float | None = None

    @property
    def missed(self) -> float:
        return self.promised - self.acquired

    @property
    def simulated(self) -> float | None:
        """The coverage that was reached."""
        if self.coverage is None:
            return None
        return self.coverage * (self.acquired / self.promised if self.promised else 1.0)


@dataclass(frozen=True)
class StopScan:
    """Simulated result of one stop."""

    stop: str
    claimed: int
    """Units it sees according to the mission."""
    sighted: int
    """Units whose midpoint is visible within the limits, tested one by one."""
    units: int
    """Units that have its points within the limits."""
    points: int

    @property
    def short(self) -> bool:
        """True if fewer units are visible than it claims."""
        return self.sighted < self.claimed - max(ALLOWED_UNITS, ALLOWED_OF_STOP * self.claimed)


@dataclass(frozen=True)
class CloudQuality:
    """Quality of the points on the targets' area in m²: density, incidence, and number of stops."""

    total_m2: float
    seen_m2: float
    by_spacing_mm: dict[int, float]
    """Fraction of the seen area where one scan's points are at most so far apart, the wider direction."""
    by_incidence_deg: dict[int, float]
    """Fraction that some stop hits at most so far off the perpendicular."""
    by_stops: dict[int, float]
    """Fraction that at least so many stops hit."""


@dataclass(frozen=True)
class ProvenArea:
    """Area of promised targets of a kind: the plan's claim, and what rays at the model's solids reach."""

    kind: str
    claimed_m2: float
    """Area of the targets that the plan counts as seen, over their whole height."""
    claimed: float
    """Fraction of it that the plan claims."""
    total_m2: float
    """Area that has a surface in the model."""
    seen_m2: float

    @property
    def shown(self) -> float:
        """Fraction that rays reach."""
        return self.seen_m2 / self.total_m2 if self.total_m2 else 1.0

    @property
    def short(self) -> bool:
        """True if the plan claims more than the model shows."""
        return self.claimed - self.shown > max(ALLOWED_AREA, ALLOWED_M2 / max(self.total_m2, ALLOWED_M2))


@dataclass(frozen=True)
class ScanPair:
    """Registration of two scans that show some of the same surfaces."""

    a: str
    b: str
    shared: float
    """Overlap ratio: fraction of the upright surfaces of the scan that shows fewer of the other's."""
    free_deg: float | None
    """Unconstrained direction of the pair, degrees from +x (0 to 180), if there is one."""
    error_m: float
    """At the worst of the start poses."""
    error_deg: float
    least_error_m: float = 0.0
    """At the best of the start poses."""
    starts: int = 1
    """Start poses tried: all of them, or up to the first that misses."""

    @property
    def registered(self) -> bool:
        return within_tolerance(self.error_m, self.error_deg) and self.free_deg is None


@dataclass(frozen=True)
class ScanNetwork:
    """Network of the scans that registration alone connects."""

    pairs: tuple[ScanPair, ...]
    pieces: tuple[tuple[str, ...], ...]
    """Connected components of the stops, the largest first."""
    closing_m: float | None
    """Greatest closing error round a loop of registered pairs; None without a loop."""
    closing_deg: float | None
    errors_m: dict[str, float]
    """Position error of each stop after the adjustment of all pairs that register; none of a stop that
    nothing connects with the frame."""
    frame: str
    """Stop whose frame the errors are in, or CONTROL_FRAME."""

    @property
    def worst(self) -> str:
        """The stop with the greatest position error."""
        return max(self.errors_m, key=self.errors_m.__getitem__)

    @property
    def adrift_m(self) -> float:
        """Position error of the worst stop."""
        return self.errors_m[self.worst]

    @property
    def closed(self) -> bool:
        """True if all scans are connected."""
        return len(self.pieces) == 1

    @property
    def registered(self) -> int:
        return sum(pair.registered for pair in self.pairs)


@dataclass(frozen=True, eq=False)
class ScanCloud:
    """Some of the points of one simulated scan, in the drawing's metres and metres above the floor."""

    stop: str
    xyz: FloatArray
    """(n, 3)."""


@dataclass(frozen=True, eq=False)
class PlanProof:
    """Result of a mission's simulation."""

    mission: Mission
    simulation: Simulation
    targets: Targets
    seen: BoolArray
    """True for units with points (n,)."""
    promised: BoolArray | None
    """True for promised units (n,); None if only their number is known."""
    unit: str
    """`m` or `units`."""
    grain: float
    """Largest amount of one unit, in that unit."""
    whole: PromisedCoverage
    rooms: tuple[PromisedCoverage, ...]
    kinds: tuple[PromisedCoverage, ...]
    stops: tuple[StopScan, ...]
    quality: CloudQuality
    network: ScanNetwork
    missed: dict[str, float]
    """Missed part of the promise, by reason."""
    between_rays: float
    """Acquired part of the promise that only rays aimed at it show."""
    clouds: tuple[ScanCloud, ...] = ()
    areas: tuple[ProvenArea, ...] = ()
    """By kind, if rays were cast at the model's solids."""
    accuracy_mm: float | None = None
    """Required accuracy; None if none is required of this mission alone."""
    accuracy_of_more: bool = False
    """True if an accuracy is required of these scans together with those of other missions."""

    @cached_property
    def unmet(self) -> tuple[str, ...]:
        """Promises of the plan that the simulation does not meet, in words."""
        parts = (*_short_whole(self), *_short_parts(self), *_short_areas(self))
        return (*parts, *_short_stops(self), *_short_pairs(self), *_short_errors(self))

    @property
    def met(self) -> bool:
        return not self.unmet

    @property
    def within_prediction(self) -> int:
        """Number of stops with a position error of at most the one that the mission predicts (0.99)."""
        limits, errors = error_limits(self.mission), self.network.errors_m
        return sum(errors.get(stop, math.inf) <= limit for stop, limit in limits.items())


def _short_whole(proof: PlanProof) -> list[str]:
    whole = proof.whole
    if whole.simulated is not None and whole.coverage is not None:
        if whole.simulated >= whole.coverage - ALLOWED_FRACTION:
            return []
        return [f"coverage: promised {percent(whole.coverage)}, simulated {percent(whole.simulated)}"]
    if whole.acquired >= whole.promised * (1 - ALLOWED_FRACTION):
        return []
    return [f"targets: {whole.promised:.0f} {proof.unit} promised, {whole.acquired:.0f} acquired"]


def _short_parts(proof: PlanProof) -> list[str]:
    return [
        f"{item.name}: {percent(item.required)} required, simulated {percent(item.simulated)}"
        for item in (*proof.rooms, *proof.kinds)
        if item.required is not None
        and item.simulated is not None
        and item.simulated < min(item.required, item.coverage or 0.0) - ALLOWED_FRACTION
        and item.missed > ALLOWED_UNITS_OF_PART * proof.grain
    ]


def _short_areas(proof: PlanProof) -> list[str]:
    return [
        f"area of {item.kind}: {percent(item.claimed)} claimed, the model's solids show {percent(item.shown)}"
        for item in proof.areas
        if item.short
    ]


def _short_pairs(proof: PlanProof) -> list[str]:
    """Return the pairs of the mission's network that do not register."""
    promised = () if isinstance(proof.mission.network, UnsetType) else proof.mission.network
    good = {frozenset((pair.a, pair.b)) for pair in proof.network.pairs if pair.registered}
    return [
        f"{item.a} and {item.b}: planned to register, but do not"
        for item in promised
        if frozenset((item.a, item.b)) not in good
    ]


def _short_errors(proof: PlanProof) -> list[str]:
    """Return the stops whose position error exceeds the required accuracy, or that have none."""
    network, asked = proof.network, proof.accuracy_mm
    if asked is None:
        return []
    errors = {stop.id: network.errors_m.get(stop.id) for stop in proof.mission.stops}
    return [
        f"{stop}: not connected with {network.frame}, position error of {asked:g} mm required"
        if error is None
        else f"{stop}: position error {1000 * error:.1f} mm, {asked:g} mm required"
        for stop, error in errors.items()
        if error is None or 1000 * error > asked
    ]


def _short_stops(proof: PlanProof) -> list[str]:
    return [
        f"{item.stop}: claims to see {item.claimed} units, {item.sighted} are visible"
        for item in proof.stops
        if item.short
    ]
