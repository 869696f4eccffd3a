"""Mission + floor -> verification result: scans from every stop in driving order, measured and registered."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import shapely
from msgspec import UNSET

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.limits import ViewLimits, limits_of, section_height
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import Coverage
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, frozen
from stopgo.mission.proof.plan_proof import (
    CloudQuality,
    PlanProof,
    PromisedCoverage,
    ProvenArea,
    ScanCloud,
    ScanNetwork,
    Simulation,
    StopScan,
)
from stopgo.mission.stages import NavigableSpace, weights_of
from stopgo.mission.stages.coverage_totals import OUTSIDE
from stopgo.planner.checking.coverage_claims import claimed_units
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.overlap.control import seen_control
from stopgo.planner.routing.planned_mission import is_follow_up
from stopgo.planner.scan_simulation.casting import SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor, extruded, heights_of
from stopgo.planner.scan_simulation.model_scans import ModelScene, scanned_model, sloped
from stopgo.planner.scan_simulation.narrow_units import Reaching, aimed_scan
from stopgo.planner.scan_simulation.registration import OrientedCloud, registered, surface_of
from stopgo.planner.scan_simulation.scan_network import scan_network
from stopgo.planner.scan_simulation.scanning import ScanCount, ScannerPose, pose_of, scanned, scene_at
from stopgo.planner.scan_simulation.strips import Strips, strips_of
from stopgo.planner.scan_simulation.unit_requirements import UnitRequirements

SPACINGS_MM = (2, 5, 10, 20, 50)
INCIDENCES_DEG = (45, 60, 70, 80)
STOPS = (1, 2, 3)
IN_DOORWAY_M = 0.1
"""A stop this close to a door's line is in the doorway."""
MOST_DRAWN = 1_000_000
"""Points kept for drawing, of all scans together."""
BELOW_M = 0.05
"""Points closer to the ceiling than this are not drawn."""
Say = Callable[[str], None]
"""Callback for progress messages."""
REACH_SLACK_M = 1e-4
"""A midpoint exactly at the range is within it, as in the plan."""
GRAZED, HIDDEN = "in line of sight, but so flat that it falls between two rays", "hidden from every stop"
"""Reasons for a missed target, as in proof.json."""
NOT_AS_ASKED = "in line of sight, but too flat, too far apart or from too few stops"


def verify(
    mission: Mission,
    space: NavigableSpace,
    simulation: Simulation,
    coverage: Coverage | None,
    say: Say = lambda line: None,
    *,
    model: ModelSolids | None = None,
) -> PlanProof:
    """Scan a floor from every stop of a mission, and compare the scans with the plan's promised coverage.

    `coverage` is the mission's own coverage.json; without it only the mission's counts are compared. With the
    solids of a `model` the rays are cast at these, and the plan's area is compared too.

    Raises
    ------
    NegativeResult
        If the mission has no stops.
    InputError
        If coverage.json belongs to another reading of the floor.
    """
    _check_libraries(simulation)
    if not mission.stops:
        raise NegativeResult(f"{mission.name}: no stops; nothing to verify")
    site = _ScanSite.of(space, simulation, model)
    poses = [site.pose_of(stop, number) for number, stop in enumerate(mission.stops)]
    tally = _PointTally(site.strips, UnitRequirements.of(space.settings, site.strips), simulation)
    surfaces, clouds = _scans(mission, site, poses, tally, say)
    names = [stop.id for stop in mission.stops]
    positions = frozen([pose.position for pose in poses])
    pairs = []
    say("registering pairs of scans")
    for pair in registered(names, positions, surfaces, simulation):
        pairs.append(pair)
        say(f"registering pairs of scans, {len(pairs)} done")
    promise = _PromisedCoverage.of(mission, space, coverage)
    xy = np.array([(stop.x, stop.y) for stop in mission.stops]) - local_origin(space.floor)
    network = scan_network(mission, xy, pairs, seen_control(space, xy))
    proof = _proof(mission, site, tally, promise, network, clouds)
    return proof if site.scene is None else replace(proof, areas=_areas(site, site.scene, tally, promise))


def _areas(
    site: _ScanSite, scene: ModelScene, tally: _PointTally, promise: _PromisedCoverage
) -> tuple[ProvenArea, ...]:
    """Area of the promised targets by kind: as the plan claims, and as the model's solids show.

    Like the plan's, the area is that of upright surfaces; sloping ones count by their length alone.
    """
    surface = None if promise.coverage is None else promise.coverage.surface
    if surface is None or promise.units is None:
        return ()
    strips, targets = site.strips, site.space.targets
    unit = strips.unit_of_cell
    upright = np.abs(strips.normal[:, 2]) < 0.5
    there = scene.existing(strips) & upright & promise.units[unit]
    if site.sloping is not None:
        there &= ~site.sloping[unit]
    kind = np.array([item.kind for item in site.space.floor.elements])
    of_cell = kind[targets.element[targets.unit_segment]][unit]
    found = []
    for name, claimed in surface.kinds.items():
        own = there & (of_cell == name)
        seen = float(strips.area[own & tally.hit].sum())
        fraction = claimed.seen_m2 / claimed.total_m2 if claimed.total_m2 else 1.0
        found.append(ProvenArea(name, claimed.total_m2, fraction, float(strips.area[own].sum()), seen))
    return tuple(found)


def _check_libraries(simulation: Simulation) -> None:
    """Report a missing library before any work starts."""
    for library in ("embreex", "small_gicp"):
        import_module(library)
    if not simulation.poses and find_spec("kiss_matcher") is None:
        raise InputError(
            "--without-poses: kiss-matcher is not installed; stopgo[prove] brings it for Python up to 3.12 "
            "on Linux (x86-64) and macOS (Apple silicon); leave the option out, or build kiss-matcher"
        )


@dataclass(frozen=True, eq=False)
class _ScanSite:
    """A floor prepared for simulated scans: its solids, and its targets as strips of cells."""

    space: NavigableSpace
    simulation: Simulation
    doors: list[FloatArray]
    """Lines of the doors that are closed for the laser."""
    solids: ExtrudedFloor
    strips: Strips
    scene: ModelScene | None = None
    """The model's solids, if rays are cast at these."""
    sloping: BoolArray | None = None
    """True for units on sloping surfaces of these solids (units,)."""

    @classmethod
    def of(cls, space: NavigableSpace, simulation: Simulation, model: ModelSolids | None) -> _ScanSite:
        doors = _closed_doors(space)
        solids = extruded(space.floor, doors, simulation.ceiling_m)
        strips = strips_of(solids, space.targets, space.floor, simulation.ceiling_m)
        if model is None:
            return cls(space, simulation, doors, solids, strips)
        scene = ModelScene(model, solids.origin)
        strips, sloping = sloped(strips, scene, section_height(space.settings))
        return cls(space, simulation, doors, solids, strips, scene, sloping)

    @cached_property
    def unit_xy(self) -> FloatArray:
        """Midpoint of each unit, from the solids' origin (units, 2)."""
        return frozen(self.space.targets.unit_xy - self.solids.origin)

    @cached_property
    def unit_heights(self) -> FloatArray:
        """Lower and upper height of each unit (units, 2)."""
        targets, ceiling = self.space.targets, self.simulation.ceiling_m
        spans = np.array([heights_of(item, ceiling) for item in self.space.floor.elements]).reshape(-1, 2)
        return frozen(spans[targets.element[targets.unit_segment]])

    def scanned(self, scene: SolidScene, pose: ScannerPose) -> ScanCount:
        """Simulate one scan in the scene around a pose, or at the model's solids if they are known."""
        if self.scene is None:
            return scanned(scene, self.strips, pose, self.simulation)
        return scanned_model(self.scene, self.strips, pose, self.simulation)

    def reaching(self, scene: SolidScene, pose: ScannerPose) -> Reaching:
        """The test if rays from a pose reach points, at the same solids."""
        if self.scene is None:
            return lambda towards, normal: scene.unobstructed(towards)
        return partial(self.scene.reached, pose.position)

    def pose_of(self, stop: Stop, number: int) -> ScannerPose:
        """The scanner's pose at a stop."""
        pose = pose_of(stop, origin=self.solids.origin, height=self.simulation.height_m, number=number)
        return replace(pose, open_door=_own_door(stop, self.doors))


def _scans(
    mission: Mission, site: _ScanSite, poses: Sequence[ScannerPose], tally: _PointTally, say: Say
) -> tuple[list[OrientedCloud], list[ScanCloud]]:
    """Scan from every pose into the tally; of each scan only a thinned cloud and a drawing remain."""
    surfaces: list[OrientedCloud] = []
    clouds: list[ScanCloud] = []
    ceiling, origin = site.simulation.ceiling_m, site.solids.origin
    for stop, pose in zip(mission.stops, poses, strict=True):
        say(f"scanning from {stop.id}, {len(clouds) + 1} of {len(poses)}")
        scene = scene_at(site.solids, pose)
        scan = site.scanned(scene, pose)
        sighted = _sighted(site, scene, pose)
        narrow = _narrow(site, pose, sighted & ~tally.take(scan, sighted))
        tally.take_aimed(aimed_scan(narrow, site.strips, pose, site.simulation, site.reaching(scene, pose)))
        surfaces.append(surface_of(scan.cloud, site.simulation))
        clouds.append(ScanCloud(stop.id, _drawn(pose, scan, MOST_DRAWN // len(poses), ceiling, origin)))
    return surfaces, clouds


def _proof(
    mission: Mission,
    site: _ScanSite,
    tally: _PointTally,
    promise: _PromisedCoverage,
    network: ScanNetwork,
    clouds: Sequence[ScanCloud],
) -> PlanProof:
    """The result of the simulation: what was promised, what was acquired, and how scans register."""
    settings, alone = site.space.settings, _is_alone(mission, site.space)
    needed = np.clip(tally.sights, 1, settings.least_views)
    seen = frozen(tally.views + tally.aimed_views >= needed, np.bool_)
    return PlanProof(
        mission=mission,
        simulation=site.simulation,
        targets=site.space.targets,
        seen=seen,
        promised=promise.units,
        grain=float(promise.weight.max()),
        missed=promise.missed(seen, frozen(tally.sights > 0, np.bool_)),
        between_rays=promise.amount(seen & (tally.views < needed)),
        unit="units" if settings.coverage_rule == "paper" else "m",
        whole=promise.whole(seen),
        rooms=promise.rooms(seen),
        kinds=promise.kinds(seen),
        stops=tuple(
            StopScan(stop.id, stop.sees.units, *counts)
            for stop, counts in zip(mission.stops, tally.of_stop, strict=True)
        ),
        quality=tally.quality(),
        network=network,
        clouds=tuple(clouds),
        accuracy_mm=settings.accuracy if alone else None,
        accuracy_of_more=settings.accuracy is not None and not alone,
    )


def _is_alone(mission: Mission, space: NavigableSpace) -> bool:
    """True if a mission's scans are all that register with one another.

    Those of a share register with the other missions' scans, those of a follow-up mission with the run's.
    """
    return mission.share is UNSET and not is_follow_up(mission, space)


def _closed_doors(space: NavigableSpace) -> list[FloatArray]:
    if space.settings.doors == "open":
        return []
    return [item.line for item in space.floor.openings if item.kind == "door"]


def _own_door(stop: Stop, doors: list[FloatArray]) -> int:
    """Index of the closed door in whose doorway the stop is, else NONE."""
    if not (stop.doorway and doors):
        return NONE
    away = shapely.distance(shapely.linestrings(doors), shapely.Point(stop.x, stop.y))
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= IN_DOORWAY_M else NONE


def _drawn(pose: ScannerPose, scan: ScanCount, most: int, ceiling: float, origin: FloatArray) -> FloatArray:
    """A scan's points, thinned evenly to about `most`, without the ceiling, which would hide the rooms."""
    every = max(1, -(-len(scan.cloud) // max(1, most)))
    points = scan.cloud[::every] + pose.position + np.append(origin, 0.0)
    return frozen(points[points[:, 2] < ceiling - BELOW_M])


class _PointTally:
    """Totals of all scans, cell by cell."""

    def __init__(self, strips: Strips, asked: UnitRequirements, simulation: Simulation) -> None:
        self._strips, self._asked = strips, asked
        self._step = math.radians(simulation.step_deg)
        self.views = np.zeros(len(strips.low), np.int16)
        """Stops that show each unit as well as required (units,)."""
        self.aimed_views = np.zeros(len(strips.low), np.int16)
        """Stops that show it only by rays aimed at it (units,)."""
        self._spacing = np.full(strips.cells, np.inf)
        self._points = np.zeros(strips.cells)
        self._stops = np.zeros(strips.cells, np.int16)
        self._incidence = np.full(strips.cells, np.inf)
        self.sights = np.zeros(len(strips.low), np.int64)
        """Stops that see each unit's midpoint as required; no unit needs more views than these (units,)."""
        self.of_stop: list[tuple[int, int, int]] = []
        """Visible units, units with points, and points of each scan."""

    def take(self, scan: ScanCount, sighted: BoolArray) -> BoolArray:
        """Count a scan; true for each unit that it shows as required (units,)."""
        self.sights += sighted
        self._points[scan.cell] += scan.points
        self._stops[scan.cell] += 1
        self._incidence[scan.cell] = np.minimum(self._incidence[scan.cell], scan.incidence)
        spacing = scan.away * self._step / np.maximum(np.cos(scan.incidence), 1e-9)
        self._spacing[scan.cell] = np.minimum(self._spacing[scan.cell], spacing)
        shown = self._asked.shown(scan)
        self.views += shown
        self.of_stop.append((int(sighted.sum()), int(shown.sum()), int(scan.points.sum())))
        return shown

    def take_aimed(self, scan: ScanCount) -> None:
        """Count the units that rays aimed at them show; these add nothing to the quality of the cloud."""
        shown = self._asked.shown(scan)
        self.aimed_views += shown
        sighted, own, points = self.of_stop[-1]
        self.of_stop[-1] = sighted, own + int(shown.sum()), points

    @property
    def hit(self) -> BoolArray:
        """True for cells with points (cells,)."""
        found: BoolArray = self._points > 0
        return found

    def quality(self) -> CloudQuality:
        area, hit = self._strips.area, self._points > 0
        spacing = 1000 * self._spacing[hit]
        incidence = np.degrees(self._incidence[hit])
        seen = float(area[hit].sum())

        def fraction(mask: BoolArray) -> float:
            return float(area[hit][mask].sum() / seen) if seen else 0.0

        return CloudQuality(
            total_m2=float(area.sum()),
            seen_m2=seen,
            by_spacing_mm={limit: fraction(spacing <= limit) for limit in SPACINGS_MM},
            by_incidence_deg={limit: fraction(incidence <= limit) for limit in INCIDENCES_DEG},
            by_stops={limit: fraction(self._stops[hit] >= limit) for limit in STOPS},
        )


@dataclass(frozen=True, eq=False)
class _PromisedCoverage:
    """The plan's promised coverage, unit by unit if its coverage.json is given."""

    space: NavigableSpace
    coverage: Coverage | None
    alone: bool
    """True if one mission covers the floor; one of several need not reach a room's or kind's fraction."""
    weight: FloatArray
    """Weight of each unit: its metres, or 1."""
    units: BoolArray | None
    """True for each promised unit; None if only their number is known."""
    claimed: int

    @classmethod
    def of(cls, mission: Mission, space: NavigableSpace, coverage: Coverage | None) -> _PromisedCoverage:
        paper = space.settings.coverage_rule == "paper"
        weight = frozen(weights_of(space.targets, space.settings) * (1.0 if paper else 1e-6))
        units = None if coverage is None else claimed_units(coverage, space.targets, space.floor)
        return cls(
            space,
            coverage,
            mission.share is UNSET,
            weight,
            units,
            sum(stop.sees.new_units for stop in mission.stops),
        )

    def whole(self, seen: BoolArray) -> PromisedCoverage:
        every = np.ones(len(seen), dtype=bool)
        if self.units is None:
            mean = float(self.weight.mean())
            got = int(seen.sum())
            acquired, beyond = min(got, self.claimed) * mean, max(0, got - self.claimed) * mean
            return PromisedCoverage("all", self.claimed * mean, acquired, beyond)
        stated = None if self.coverage is None else self.coverage.total.coverage
        return self._coverage(
            "all", every, seen, coverage=stated, required=self._required(self.space.settings.coverage)
        )

    def rooms(self, seen: BoolArray) -> tuple[PromisedCoverage, ...]:
        """Rooms with promised or acquired targets, in the floor's order."""
        stated = {} if self.coverage is None else {row.room: row.coverage for row in self.coverage.rooms}
        names = [room.name for room in self.space.rooms]
        groups = [
            self._coverage(
                name,
                self.space.unit_room == k,
                seen,
                coverage=stated.get(name) if names.count(name) == 1 else None,
                required=self._required(self.space.settings.least_of_room),
            )
            for k, name in enumerate(names)
        ]
        groups.append(self._coverage(OUTSIDE, self.space.unit_room < 0, seen))
        return tuple(group for group in groups if group.promised or group.acquired or group.beyond)

    def kinds(self, seen: BoolArray) -> tuple[PromisedCoverage, ...]:
        targets, elements = self.space.targets, self.space.floor.elements
        kind = np.array([item.kind for item in elements])[targets.element[targets.unit_segment]]
        stated = {} if self.coverage is None else self.coverage.kinds
        return tuple(
            self._coverage(
                str(name),
                kind == name,
                seen,
                coverage=stated[name].coverage if name in stated else None,
                required=self._required(self.space.settings.least_of_kind),
            )
            for name in np.unique(kind)
        )

    def _required(self, fraction: float | None) -> float | None:
        return fraction if self.alone else None

    def amount(self, units: BoolArray) -> float:
        """Amount of these units (units,) that are promised."""
        return 0.0 if self.units is None else float(self.weight[self.units & units].sum())

    def missed(self, seen: BoolArray, sighted: BoolArray) -> dict[str, float]:
        """Amount of promised units missed, by reason; `sighted` units have visible midpoints."""
        if self.units is None:
            return {}
        reason = GRAZED if limits_of(self.space.settings).none else NOT_AS_ASKED
        masks = {reason: self.units & ~seen & sighted, HIDDEN: self.units & ~seen & ~sighted}
        return {name: self.amount(mask) for name, mask in masks.items() if mask.any()}

    def _coverage(
        self,
        name: str,
        member: BoolArray,
        seen: BoolArray,
        *,
        coverage: float | None = None,
        required: float | None = None,
    ) -> PromisedCoverage:
        promised = member & (self.units if self.units is not None else False)

        def amount(mask: BoolArray) -> float:
            return float(self.weight[mask].sum())

        acquired, beyond = amount(promised & seen), amount(member & seen & ~promised)
        return PromisedCoverage(name, amount(promised), acquired, beyond, coverage, required)


def _sighted(site: _ScanSite, scene: SolidScene, pose: ScannerPose) -> BoolArray:
    """True for each unit whose midpoint the stop sees, at the scanner's height or the nearest (units,)."""
    space, targets = site.space, site.space.targets
    reach = space.settings.range + REACH_SLACK_M
    unit = np.flatnonzero((np.abs(site.unit_xy - pose.position[:2]) <= reach).all(axis=1))
    segment = targets.unit_segment[unit]
    z = np.clip(pose.position[2], *site.unit_heights[unit].T)
    points = np.column_stack([site.unit_xy[unit], z]) - pose.position
    near = np.hypot(points[:, 0], points[:, 1]) <= reach
    along = (targets.b - targets.a)[segment]
    before = along[:, 0] * points[:, 1] - along[:, 1] * points[:, 0] < 0  # the stop is left of a -> b
    wanted = near & (before | ~targets.occluding[segment])
    wanted &= _in_view(space, pose, points) & _within_limits(limits_of(space.settings), points, along)
    found = np.zeros(targets.total, dtype=bool)
    if wanted.any():
        found[unit[wanted]] = scene.unobstructed(frozen(points[wanted]))
    return found


def _narrow(site: _ScanSite, pose: ScannerPose, units: BoolArray) -> IntArray:
    """The units, of those in sight without points, whose neighbouring points are close enough (n,).

    If the angular step is not known, any are.
    """
    found, settings, step = np.flatnonzero(units), site.space.settings, site.simulation.step_deg
    if settings.angular_step is None and not site.simulation.step_known:
        return found
    targets = site.space.targets
    along = (targets.b - targets.a)[targets.unit_segment[found]]
    limits = limits_of(replace(settings, angular_step=step))
    return found[_within_limits(limits, site.unit_xy[found] - pose.position[:2], along)]


def _within_limits(limits: ViewLimits, points: FloatArray, along: FloatArray) -> BoolArray:
    """True for midpoints, relative to the scanner, within limits at the scanner's height."""
    away = np.hypot(points[:, 0], points[:, 1])
    across = np.abs(along[:, 0] * points[:, 1] - along[:, 1] * points[:, 0])
    cosine = across / np.maximum(away * np.hypot(*along.T), 1e-12)
    good: BoolArray = away >= limits.near - REACH_SLACK_M
    if limits.max_incidence is not None:
        good &= cosine >= math.cos(limits.max_incidence) - 1e-9
    if limits.spacing is not None and limits.step is not None:
        good &= away * limits.step <= limits.spacing * cosine + 1e-9
    return good


def _in_view(space: NavigableSpace, pose: ScannerPose, points: FloatArray) -> BoolArray:
    """True for points, relative to the scanner, within its field of view."""
    aside = np.arctan2(points[:, 1], points[:, 0]) - pose.heading
    turned = np.abs(np.remainder(aside + np.pi, 2 * np.pi) - np.pi)
    found: BoolArray = turned <= math.radians(space.settings.fov) / 2 + 1e-9
    return found
