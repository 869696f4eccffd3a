"""Mission + its floor -> its proof: every stop scanned in the order of driving, measured, and registered."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module

import numpy as np
import shapely
from msgspec import UNSET

from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.limits import limits_of
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import Coverage
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, frozen
from stopgo.mission.proof.plan_proof import (
    CloudQuality,
    PlanProof,
    PromisedShare,
    ScanCloud,
    Simulation,
    StopScan,
)
from stopgo.mission.stages import NavigableSpace, Targets, weights_of
from stopgo.mission.stages.coverage_totals import OUTSIDE
from stopgo.planner.scan_simulation.casting import SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor, extruded, heights_of
from stopgo.planner.scan_simulation.registration import registered, surface_of
from stopgo.planner.scan_simulation.scan_network import joined
from stopgo.planner.scan_simulation.scanning import ScanCount, ScannerPose, scanned, stand_of
from stopgo.planner.scan_simulation.strips import Strips, strips_of
from stopgo.planner.scan_simulation.unit_requirements import AskedPoints

SPACINGS_MM = (2, 5, 10, 20, 50)
INCIDENCES_DEG = (45, 60, 70, 80)
STOPS = (1, 2, 3)
IN_DOORWAY_M = 0.1
"""A stop so near a door's line stands in it."""
SAME_PLACE_M = 1e-4
"""Ends of segments in coverage.json are rounded."""
MOST_DRAWN = 1_000_000
"""Points that a proof keeps to be drawn, of all scans together."""
BELOW_M = 0.05
"""What is drawn ends so far below the ceiling."""
Say = Callable[[str], None]
"""Told what has been done, for watching."""
REACH_SLACK_M = 1e-4
"""A midpoint exactly at the range is within it, as in the plan."""
GRAZED, HIDDEN = "in sight, but so flat that it falls between two rays", "hidden from every stop"
"""Why something is missed."""
NOT_AS_ASKED = "in sight, but too flat, too far apart or from too few stops"


def prove(
    mission: Mission,
    space: NavigableSpace,
    simulation: Simulation,
    coverage: Coverage | None,
    say: Say = lambda line: None,
) -> PlanProof:
    """Scan a floor from every stop, and hold what comes of it against what the plan promises.

    `coverage` is the mission's own coverage.json; without it only the mission's counts are held against it.

    Raises
    ------
    AnswerIsNo
        When the mission has no stops.
    InputError
        When coverage.json is of another reading of the floor.
    """
    for library in ("embreex", "small_gicp", *(() if simulation.poses else ("kiss_matcher",))):
        import_module(library)  # whatever is missing is told before anything is done
    if not mission.stops:
        raise NegativeResult(f"{mission.name}: has no stops; there is nothing to prove")
    doors = _closed_doors(space)
    solids = extruded(space.floor, doors, simulation.ceiling_m)
    strips = strips_of(solids, space.targets, space.floor, simulation.ceiling_m)
    tally = _PointTally(strips, AskedPoints.of(space.settings, strips), simulation)
    stands = [
        replace(
            stand_of(stop, origin=solids.origin, height=simulation.height_m, number=index),
            open_door=_own_door(stop, doors),
        )
        for index, stop in enumerate(mission.stops)
    ]
    surfaces, clouds = [], []
    for stop, stand in zip(mission.stops, stands, strict=True):  # of a scan little is kept: there may be many
        scan = scanned(solids, strips, stand, simulation)
        tally.take(scan, _sighted(space, solids, stand, simulation.ceiling_m))
        surfaces.append(surface_of(scan.cloud))
        most = MOST_DRAWN // len(stands)
        points = _drawn(stand, scan, most, simulation.ceiling_m, solids.origin)
        clouds.append(ScanCloud(stop.id, points))
        say(f"{stop.id} scanned, {len(clouds)} of {len(stands)}")
    places = frozen([stand.place for stand in stands])
    seen = frozen(tally.views >= np.clip(tally.sights, 1, space.settings.least_views), np.bool_)
    names = [stop.id for stop in mission.stops]
    pairs = []
    for pair in registered(names, places, surfaces, simulation):
        pairs.append(pair)
        say(f"{pair.pair.a} and {pair.pair.b} registered")
    promise = _Promise.of(mission, space, coverage)
    return PlanProof(
        mission=mission,
        simulation=simulation,
        targets=space.targets,
        seen=seen,
        promised=promise.units,
        grain=float(promise.weight.max()),
        missed=promise.missed(seen, frozen(tally.sights > 0, np.bool_)),
        unit="units" if space.settings.coverage_rule == "paper" else "m",
        whole=promise.whole(seen),
        rooms=promise.rooms(seen),
        kinds=promise.kinds(seen),
        stops=tuple(
            StopScan(stop.id, stop.sees.units, *counts)
            for stop, counts in zip(mission.stops, tally.of_stop, strict=True)
        ),
        quality=tally.quality(),
        network=joined(names, places, pairs),
        clouds=tuple(clouds),
    )


def _closed_doors(space: NavigableSpace) -> list[FloatArray]:
    if space.settings.doors == "open":
        return []
    return [item.line for item in space.floor.openings if item.kind == "door"]


def _own_door(stop: Stop, doors: list[FloatArray]) -> int:
    """The closed door in which a stop stands, if it does."""
    if not (stop.doorway and doors):
        return NONE
    away = shapely.distance(shapely.linestrings(doors), shapely.Point(stop.x, stop.y))
    nearest = int(np.argmin(away))
    return nearest if away[nearest] <= IN_DOORWAY_M else NONE


def _drawn(stand: ScannerPose, scan: ScanCount, most: int, ceiling: float, origin: FloatArray) -> FloatArray:
    """A scan's points, thinned evenly to about `most`; without the ceiling, that hides the rooms."""
    every = max(1, -(-len(scan.cloud) // max(1, most)))
    points = scan.cloud[::every] + stand.place + np.append(origin, 0.0)
    return frozen(points[points[:, 2] < ceiling - BELOW_M])


class _PointTally:
    """What all scans came to, cell by cell."""

    def __init__(self, strips: Strips, asked: AskedPoints, simulation: Simulation) -> None:
        self._strips, self._asked = strips, asked
        self._step = math.radians(simulation.step_deg)
        self.views = np.zeros(len(strips.low), np.int16)
        """Stops that show each unit as well as was asked."""
        self._spacing = np.full(strips.cells, np.inf)
        self._unit = strips.unit_of_cell
        self._points = np.zeros(strips.cells)
        self._stops = np.zeros(strips.cells, np.int16)
        self._incidence = np.full(strips.cells, np.inf)
        self.sights = np.zeros(len(strips.low), np.int64)
        """Stops that have each unit's midpoint in sight as was asked; more views are asked of none."""
        self.of_stop: list[tuple[int, int, int]] = []
        """Units in sight, units with points, and points of each scan."""

    def take(self, scan: ScanCount, sighted: BoolArray) -> None:
        self.sights += sighted
        self._points[scan.cell] += scan.points
        self._stops[scan.cell] += 1
        self._incidence[scan.cell] = np.minimum(self._incidence[scan.cell], scan.incidence)
        spacing = scan.away * self._step / np.maximum(np.cos(scan.incidence), 1e-9)
        self._spacing[scan.cell] = np.minimum(self._spacing[scan.cell], spacing)
        shown = self._asked.shown(scan)
        self.views += shown
        self.of_stop.append((int(sighted.sum()), int(shown.sum()), int(scan.points.sum())))

    def quality(self) -> CloudQuality:
        area, hit = self._strips.area, self._points > 0
        spacing = 1000 * self._spacing[hit]
        incidence = np.degrees(self._incidence[hit])
        seen = float(area[hit].sum())

        def share(mask: BoolArray) -> float:
            return float(area[hit][mask].sum() / seen) if seen else 0.0

        return CloudQuality(
            total_m2=float(area.sum()),
            seen_m2=seen,
            by_spacing_mm={limit: share(spacing <= limit) for limit in SPACINGS_MM},
            by_incidence_deg={limit: share(incidence <= limit) for limit in INCIDENCES_DEG},
            by_stops={limit: share(self._stops[hit] >= limit) for limit in STOPS},
        )


@dataclass(frozen=True, eq=False)
class _Promise:
    """What the plan promises, unit by unit where its coverage.json tells."""

    space: NavigableSpace
    coverage: Coverage | None
    alone: bool
    """Whether the mission sees the floor by itself; of one of several no room's or kind's share is asked."""
    weight: FloatArray
    """Metres, or 1, of each unit."""
    units: BoolArray | None
    """Whether each unit is promised; None where only their number is known."""
    claimed: int

    @classmethod
    def of(cls, mission: Mission, space: NavigableSpace, coverage: Coverage | None) -> _Promise:
        paper = space.settings.coverage_rule == "paper"
        weight = frozen(weights_of(space.targets, space.settings) * (1.0 if paper else 1e-6))
        units = None if coverage is None else _promised(coverage, space.targets, space.floor)
        return cls(
            space,
            coverage,
            mission.share is UNSET,
            weight,
            units,
            sum(stop.sees.new_units for stop in mission.stops),
        )

    def whole(self, seen: BoolArray) -> PromisedShare:
        every = np.ones(len(seen), dtype=bool)
        if self.units is None:
            mean = float(self.weight.mean())
            got = int(seen.sum())
            kept, beyond = min(got, self.claimed) * mean, max(0, got - self.claimed) * mean
            return PromisedShare("all", self.claimed * mean, kept, beyond)
        told = None if self.coverage is None else self.coverage.total.coverage
        return self._share(
            "all", every, seen, coverage=told, required=self._asked(self.space.settings.coverage)
        )

    def rooms(self, seen: BoolArray) -> tuple[PromisedShare, ...]:
        """Rooms of which something is promised or acquired, in the floor's order."""
        told = {} if self.coverage is None else {row.room: row.coverage for row in self.coverage.rooms}
        names = [room.name for room in self.space.rooms]
        shares = [
            self._share(
                name,
                self.space.unit_room == k,
                seen,
                coverage=told.get(name) if names.count(name) == 1 else None,
                required=self._asked(self.space.settings.least_of_room),
            )
            for k, name in enumerate(names)
        ]
        shares.append(self._share(OUTSIDE, self.space.unit_room < 0, seen))
        return tuple(share for share in shares if share.promised or share.kept or share.beyond)

    def kinds(self, seen: BoolArray) -> tuple[PromisedShare, ...]:
        targets, elements = self.space.targets, self.space.floor.elements
        kind = np.array([item.kind for item in elements])[targets.element[targets.unit_segment]]
        told = {} if self.coverage is None else self.coverage.kinds
        return tuple(
            self._share(
                str(name),
                kind == name,
                seen,
                coverage=told[name].coverage if name in told else None,
                required=self._asked(self.space.settings.least_of_kind),
            )
            for name in np.unique(kind)
        )

    def _asked(self, share: float | None) -> float | None:
        return share if self.alone else None

    def missed(self, seen: BoolArray, sighted: BoolArray) -> dict[str, float]:
        """What of the promised units was missed, by reason; `sighted` have their midpoint in sight."""
        if self.units is None:
            return {}
        why = GRAZED if limits_of(self.space.settings).none else NOT_AS_ASKED
        masks = {why: self.units & ~seen & sighted, HIDDEN: self.units & ~seen & ~sighted}
        return {name: float(self.weight[mask].sum()) for name, mask in masks.items() if mask.any()}

    def _share(
        self,
        name: str,
        member: BoolArray,
        seen: BoolArray,
        *,
        coverage: float | None = None,
        required: float | None = None,
    ) -> PromisedShare:
        promised = member & (self.units if self.units is not None else False)

        def amount(mask: BoolArray) -> float:
            return float(self.weight[mask].sum())

        kept, beyond = amount(promised & seen), amount(member & seen & ~promised)
        return PromisedShare(name, amount(promised), kept, beyond, coverage, required)


def _sighted(space: NavigableSpace, solids: ExtrudedFloor, stand: ScannerPose, ceiling: float) -> BoolArray:
    """Whether a stop has each unit's midpoint in sight, at its own height or the nearest to it (units,)."""
    targets, elements = space.targets, space.floor.elements
    spans = np.array([heights_of(item, ceiling) for item in elements]).reshape(-1, 2)
    low, high = spans[targets.element[targets.unit_segment]].T
    z = np.clip(stand.place[2], low, high)
    points = np.column_stack([targets.unit_xy - solids.origin, z]) - stand.place
    near = np.hypot(points[:, 0], points[:, 1]) <= space.settings.range + REACH_SLACK_M
    along = (targets.b - targets.a)[targets.unit_segment]
    before = along[:, 0] * points[:, 1] - along[:, 1] * points[:, 0] < 0  # the stop is left of a -> b
    wanted = near & (before | ~targets.occluding[targets.unit_segment])
    wanted &= _in_view(space, stand, points) & _as_asked(space, points, along)
    found = np.zeros(targets.total, dtype=bool)
    if wanted.any():
        scene = SolidScene(solids, stand.place, see_through=False, open_door=stand.open_door)
        found[wanted] = scene.in_sight(frozen(points[wanted]))
    return found


def _as_asked(space: NavigableSpace, points: FloatArray, along: FloatArray) -> BoolArray:
    """Whether midpoints, told from the scanner, are steep, far and dense enough, at the scanner's height."""
    limits = limits_of(space.settings)
    away = np.hypot(points[:, 0], points[:, 1])
    across = np.abs(along[:, 0] * points[:, 1] - along[:, 1] * points[:, 0])
    cosine = across / np.maximum(away * np.hypot(*along.T), 1e-12)
    good: BoolArray = away >= limits.near - REACH_SLACK_M
    if limits.max_incidence is not None:
        good &= cosine >= math.cos(limits.max_incidence) - 1e-9
    if limits.spacing is not None and limits.step is not None:
        good &= away * limits.step <= limits.spacing * cosine + 1e-9
    return good


def _in_view(space: NavigableSpace, stand: ScannerPose, points: FloatArray) -> BoolArray:
    """Whether points, told from the scanner, lie within its field of view."""
    aside = np.arctan2(points[:, 1], points[:, 0]) - stand.heading
    turned = np.abs(np.remainder(aside + np.pi, 2 * np.pi) - np.pi)
    found: BoolArray = turned <= math.radians(space.settings.fov) / 2 + 1e-9
    return found


def _promised(coverage: Coverage, targets: Targets, floor: FloorPlan) -> BoolArray:
    """Units that coverage.json says are seen."""
    promised = np.zeros(targets.total, dtype=bool)
    told = {item.id: list(item.segments) for item in coverage.elements}
    for segment, element in enumerate(targets.element.tolist()):
        name = floor.elements[element].id
        if not told.get(name):
            raise _other_reading(name)
        row = told[name].pop(0)
        ends = np.array([row.a, row.b]) - np.array([targets.a[segment], targets.b[segment]])
        if np.abs(ends).max() > SAME_PLACE_M:
            raise _other_reading(name)
        first, count = int(targets.first_unit[segment]), int(targets.units[segment])
        for begin, end in row.seen:
            promised[first + round(begin * count) : first + round(end * count)] = True
    return promised


def _other_reading(element: str) -> InputError:
    return InputError(f"coverage.json: {element} is not where this floor has it; plan again")
