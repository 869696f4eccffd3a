"""Proof of a mission by simulation: what was taken for granted, what the scans got, and whether they join."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from msgspec import UnsetType

from stopgo.mission.document import Mission
from stopgo.mission.geometry import BoolArray, FloatArray
from stopgo.mission.stages import Targets
from stopgo.mission.stages.figures import percent

ALLOWED_SHARE = 0.01
"""By how much less than the plan promises may be acquired: what grazes a wall falls between two rays."""
ALLOWED_UNITS = 3
"""Of what a stop claims, as many units, or a fiftieth, may be out of sight: lines that touch corners."""
ALLOWED_OF_STOP = 0.02
ALLOWED_UNITS_OF_PART = 5
"""Of a room or a kind, as many units may be missed, however small it is."""
REGISTERED_M = 0.01
"""A pair is registered if it ends as near to the truth as this, from every start."""
REGISTERED_DEG = 0.1


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """What is taken for granted where a mission is simulated; the scanner stands level."""

    range_m: float
    joining_m: float = 20.0
    """Up to where points count for registration; scanners reach farther than plans ask of them."""
    slant: bool = False
    """Whether the range counts along the rays; else along the floor, as in the plan."""
    fov_deg: float = 360.0
    near_m: float = 0.0
    """What is nearer, along the floor, is not measured."""
    step_deg: float = 0.1
    """Between neighbouring rays, both ways."""
    noise_m: float = 0.002
    """Standard deviation of a distance."""
    height_m: float = 1.3
    """Of the scanner above the floor."""
    ceiling_m: float = 2.7
    """Up to where walls and columns stand."""
    ceiling_known: bool = False
    """Whether the model tells that height."""
    cone_deg: float = 60.0
    """Opening of the cone below the scanner that it does not see."""
    pose_error_m: float = 0.05
    """How far off the robot's pose is from which a pair of scans is registered."""
    pose_error_deg: float = 2.0
    poses: bool = True
    """Whether registration starts from the robot's poses at all."""
    seed: int = 1


@dataclass(frozen=True)
class PromisedShare:
    """What is promised of some targets, in metres or units, and what the simulated scans got of it."""

    name: str
    promised: float
    kept: float
    """Of what is promised, on how much points lie."""
    beyond: float
    """What points lie on though nobody promised it."""
    coverage: float | None = None
    """As promised: of what can be seen; None where that is not known."""
    required: float | None = None

    @property
    def missed(self) -> float:
        return self.promised - self.kept

    @property
    def simulated(self) -> float | None:
        """The coverage that was reached."""
        if self.coverage is None:
            return None
        return self.coverage * (self.kept / self.promised if self.promised else 1.0)


@dataclass(frozen=True)
class StopScan:
    """What one stop got."""

    stop: str
    claimed: int
    """Units it sees, as the mission has it."""
    sighted: int
    """Units whose midpoint it has in sight as was asked, looked at one by one."""
    units: int
    """Units on which its points lie, as well as was asked."""
    points: int

    @property
    def short(self) -> bool:
        """Whether it has less in sight than it claims."""
        return self.sighted < self.claimed - max(ALLOWED_UNITS, ALLOWED_OF_STOP * self.claimed)


@dataclass(frozen=True)
class CloudQuality:
    """Of the targets' area, m²: what has points, how dense, at which angle, and from how many stops."""

    total_m2: float
    seen_m2: float
    by_spacing_mm: dict[int, float]
    """Share of what has points where those of one scan lie at most so far apart, the wider way."""
    by_incidence_deg: dict[int, float]
    """Share that some stop meets at most so far off the perpendicular."""
    by_stops: dict[int, float]
    """Share that at least so many stops met."""


@dataclass(frozen=True)
class ScanPair:
    """Two scans that show some of the same surfaces, registered."""

    a: str
    b: str
    shared: float
    """Share of the upright surfaces of that scan which shows fewer of the other's."""
    free_deg: float | None
    """Direction in which nothing holds the pair, degrees from +x (0 to 180), if there is one."""
    error_m: float
    """At the worse of the starts."""
    error_deg: float

    @property
    def registered(self) -> bool:
        near = self.error_m < REGISTERED_M and self.error_deg < REGISTERED_DEG
        return near and self.free_deg is None


@dataclass(frozen=True)
class ScanNetwork:
    """Which scans join by registration alone."""

    pairs: tuple[ScanPair, ...]
    pieces: tuple[tuple[str, ...], ...]
    """Stops that hang together, the most first."""
    closing_m: float | None
    """Greatest gap round a circle of registered pairs; None where there is no circle."""
    closing_deg: float | None
    adrift_m: float
    """How far the worst stop is off the truth, seen from the first stop of its piece."""

    @property
    def closed(self) -> bool:
        """Whether all scans hang together."""
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
    """What a simulation shows of a mission."""

    mission: Mission
    simulation: Simulation
    targets: Targets
    seen: BoolArray
    """Whether points lie on each unit (n,)."""
    promised: BoolArray | None
    """Whether each unit is promised (n,); None where only their number is."""
    unit: str
    """`m` or `units`."""
    grain: float
    """What one unit counts at most, in that unit."""
    whole: PromisedShare
    rooms: tuple[PromisedShare, ...]
    kinds: tuple[PromisedShare, ...]
    stops: tuple[StopScan, ...]
    quality: CloudQuality
    network: ScanNetwork
    missed: dict[str, float]
    """What of the promise was missed, by reason."""
    clouds: tuple[ScanCloud, ...] = ()

    @cached_property
    def unmet(self) -> tuple[str, ...]:
        """What the plan promises and the simulation does not show, in words."""
        return (*_short_whole(self), *_short_parts(self), *_short_stops(self), *_short_pairs(self))

    @property
    def met(self) -> bool:
        return not self.unmet


def _short_whole(proof: PlanProof) -> list[str]:
    whole = proof.whole
    if whole.simulated is not None and whole.coverage is not None:
        if whole.simulated >= whole.coverage - ALLOWED_SHARE:
            return []
        return [f"coverage: promised {percent(whole.coverage)}, simulated {percent(whole.simulated)}"]
    if whole.kept >= whole.promised * (1 - ALLOWED_SHARE):
        return []
    return [f"targets: {whole.promised:.0f} {proof.unit} promised, {whole.kept:.0f} acquired"]


def _short_parts(proof: PlanProof) -> list[str]:
    return [
        f"{item.name}: {percent(item.required)} asked, simulated {percent(item.simulated)}"
        for item in (*proof.rooms, *proof.kinds)
        if item.required is not None
        and item.simulated is not None
        and item.simulated < min(item.required, item.coverage or 0.0) - ALLOWED_SHARE
        and item.missed > ALLOWED_UNITS_OF_PART * proof.grain
    ]


def _short_pairs(proof: PlanProof) -> list[str]:
    """Pairs of the mission's network that do not register."""
    promised = () if isinstance(proof.mission.network, UnsetType) else proof.mission.network
    good = {frozenset((pair.a, pair.b)) for pair in proof.network.pairs if pair.registered}
    return [
        f"{item.a} and {item.b}: are to register, and do not"
        for item in promised
        if frozenset((item.a, item.b)) not in good
    ]


def _short_stops(proof: PlanProof) -> list[str]:
    return [
        f"{item.stop}: claims to see {item.claimed} units, {item.sighted} are in sight"
        for item in proof.stops
        if item.short
    ]
