"""Scanner poses of a run -> the coverage they reached, and the smallest follow-up mission for the rest."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from msgspec import UNSET, UnsetType
from msgspec.structs import replace as changed

from stopgo.mission.comparing.as_driven import AsDriven
from stopgo.mission.document import Mission, Stop, with_digest
from stopgo.mission.document.specs import limits_spec_of
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.own_floor import must_be_own_floor
from stopgo.mission.files.plan_toml import recorded_settings
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray, Polygon, frozen
from stopgo.mission.run.events import Pose
from stopgo.mission.run.tolerance import stop_error_text
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, Route, Selection, Visibility
from stopgo.mission.stages.coverage_totals import CoverageTotals, totals_of_plan
from stopgo.planner.candidates import candidates
from stopgo.planner.candidates.added_scans import with_scans
from stopgo.planner.covering_tour import least_time_route
from stopgo.planner.floors import options_of, read_floor
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.routing import route
from stopgo.planner.routing.assemble import assemble
from stopgo.planner.routing.planned_mission import FOLLOW_UP, is_follow_up
from stopgo.planner.selection import select_follow_up
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.reach import reach_of
from stopgo.planner.visibility import visibility
from stopgo.planner.visibility.headings import in_view
from stopgo.planner.visibility.sight.sightlines import SightLines
from stopgo.planner.visibility.unit_ranges import visibility_of

ScanPoses = FloatArray
"""x, y and heading of each scan (n, 3)."""


@dataclass(frozen=True, eq=False)
class PlannedFloor:
    """The floor that a mission was planned on, and the mission's settings."""

    floor: FloorPlan
    settings: Settings
    mission: Mission

    @cached_property
    def space(self) -> NavigableSpace:
        return navigable(self.floor, self.settings)

    @cached_property
    def seen(self) -> Visibility:
        """Visibility from every candidate in the mission's part of the floor."""
        return visibility(candidates(self.space, part=self._part))

    @cached_property
    def stops_see(self) -> BoolArray:
        """True for units that enough of the mission's stops see (n,)."""
        views = _views(self.space, SightLines(self.space), _poses_of(self.mission.stops))
        return _seen_by(views, totals_of_plan(self.seen))

    @property
    def is_part(self) -> bool:
        """True if the mission shares its floor with others: what is required holds for all together."""
        return self.mission.share is not UNSET

    @cached_property
    def is_follow_up(self) -> bool:
        """True if the mission is for what an earlier run left out: nothing is required but its own stops."""
        return not self.is_part and is_follow_up(self.mission, self.space)

    def left_of(self, poses: ScanPoses) -> BoolArray:
        """Return the units of the stops without a pose within tolerance, which no pose sees (n,).

        Raises
        ------
        NegativeResult
            When no candidate sees any of them.
        """
        lines = SightLines(self.space)
        left = [stop for stop in self.mission.stops if not _is_scanned(self.mission, stop, poses)]
        wanted = np.zeros(self.space.targets.total, dtype=bool)
        for units in _views(self.space, lines, _poses_of(left)):
            wanted[units] = True
        for units in _views(self.space, lines, poses):
            wanted[units] = False
        if wanted.any() and not (wanted & self.seen.visible).any():
            raise NegativeResult(f"{self.mission.name}: no candidate sees what its missed stops were to see")
        return frozen(wanted, np.bool_)

    @property
    def _part(self) -> int:
        positions = np.array([(stop.x, stop.y) for stop in self.mission.stops]).reshape(-1, 2)
        parts = reach_of(self.space).part_at(positions - local_origin(self.floor))
        counts = Counter(parts[parts >= 0].tolist())
        if not counts:
            raise NegativeResult(
                f"{self.floor.name}: the robot can reach no stop of the mission; check its radius"
            )
        return int(counts.most_common(1)[0][0])


def planned_floor(path: Path, mission: Mission) -> PlannedFloor:
    """Read the floor from a file, and check that the mission was planned on it.

    Raises
    ------
    OtherFloor
        When the file is not the mission's floor.
    InputError
        When the file cannot be read.
    """
    must_be_own_floor(path, mission)
    settings = recorded_settings(mission.origin.parameters)
    return PlannedFloor(read_floor(path, options_of(settings)), settings, mission)


def as_driven(planned: PlannedFloor, poses: ScanPoses) -> AsDriven:
    """Compare the coverage from the robot's actual scan poses with the coverage from the mission's stops.

    Raises
    ------
    NegativeResult
        When no target on the floor is visible.
    """
    totals = totals_of_plan(planned.seen)
    return AsDriven(
        totals=totals.without_requirements if planned.is_part or planned.is_follow_up else totals,
        planned=planned.stops_see,
        driven=_seen_by(_views(planned.space, SightLines(planned.space), poses), totals),
    )


def _poses_of(stops: Sequence[Stop]) -> ScanPoses:
    """Return the planned poses of stops."""
    return np.array([(stop.x, stop.y, stop.heading) for stop in stops]).reshape(-1, 3)


def _is_scanned(mission: Mission, stop: Stop, poses: ScanPoses) -> bool:
    """True if a pose is within the stop's tolerance."""
    found = (Pose(x=x, y=y, heading=heading) for x, y, heading in poses.tolist())
    return any(not stop_error_text(pose, stop, mission.scanner) for pose in found)


def _seen_by(views: Iterable[IntArray], totals: CoverageTotals) -> BoolArray:
    """True for each unit that enough of the poses see; `views` has the units of each pose."""
    counted = np.zeros(len(totals.weight), dtype=np.int64)
    for units in views:
        counted[units] += 1
    return totals.enough(counted)


def _views(space: NavigableSpace, lines: SightLines, poses: ScanPoses) -> list[IntArray]:
    """Units that each pose sees; within the field of view if it is less than 360 degrees."""
    fov = math.radians(space.settings.fov)
    views = []
    for x, y, heading in poses.tolist():
        units = np.unique(lines.seen_from(np.array([x, y])))
        if space.settings.fov < 360:
            direction = space.targets.unit_xy[units] - (x, y)
            units = units[in_view(direction, heading, fov=fov)]
        views.append(units)
    return views


def top_up(
    planned: PlannedFloor,
    poses: ScanPoses,
    *,
    obstacles: Sequence[Polygon] = (),
    evidence: str = "",
    measured: BoolArray | None = None,
    others: Sequence[Mission] = (),
) -> Mission | None:
    """Return the smallest follow-up mission that reaches the required coverage; None if nothing is missing.

    It begins where the mission began. It keeps clear of obstacles that the plan did not contain; they also
    hide the targets behind them.

    Parameters
    ----------
    evidence
        Added to the text that the follow-up mission's id is hashed from, such as a log's digest.
    measured
        True for units that need no scan (n,), instead of those visible from the poses.
    others
        The other missions that divide the floor with this one; the poses are then those of all their runs.

    Raises
    ------
    NegativeResult
        When the required coverage cannot be reached any more.
    InputError
        When the mission divides its floor with others that were not given.
    """
    _must_be_whole((planned.mission, *others))
    known = replace(planned, floor=_with(planned.floor, obstacles)) if obstacles else planned
    known, wanted = _wanted_on(known, poses) if planned.is_follow_up and measured is None else (known, None)
    if wanted is not None and not wanted.any():
        return None
    seen, done = _with_poses(known, poses, measured, wanted)
    selection = select_follow_up(seen, done)
    return _follow_up(known, selection, done, evidence) if len(selection.chosen) else None


def _wanted_on(follow_up: PlannedFloor, poses: ScanPoses) -> tuple[PlannedFloor, BoolArray]:
    """Return a follow-up mission's floor with all coverage required, and the units for which it is (n,)."""
    known = replace(follow_up, settings=replace(follow_up.settings, coverage=1.0))
    return known, known.left_of(poses)


def _driven(selection: Selection, settings: Settings, done: IntArray) -> Route:
    """Return the route through the selected stops, of least time if the settings ask for it."""
    driven = route(selection)
    return least_time_route(driven, done=done) if settings.minimise == "time" else driven


def _coverage_alone(known: PlannedFloor, mission: Mission) -> float:
    """Return the coverage of a mission's own stops, for one view of each target."""
    once = replace(totals_of_plan(known.seen), asked=frozen([1], np.int64))
    views = _views(known.space, SightLines(known.space), _poses_of(mission.stops))
    return once.coverage(_seen_by(views, once)).whole.coverage or 0.0


def _must_be_whole(missions: Sequence[Mission]) -> None:
    """Raise InputError unless the missions are all of one plan that divide its floor, or one undivided."""
    first = missions[0]
    for mission in missions[1:]:
        if UNSET in (first.share, mission.share) or mission.origin != first.origin:
            raise InputError(f"{mission.name}: is not of the same divided plan as {first.name}")
    shares = [share for one in missions if not isinstance(share := one.share, UnsetType)]
    if not shares:
        return
    given, of = {share.number for share in shares}, shares[0].of
    missing = [str(number) for number in range(1, of + 1) if number not in given]
    if missing:
        raise InputError(
            f"{first.name}: divides its floor with {of - 1} more; give also mission "
            f"{', '.join(missing)} of {of}, each with --mission"
        )


def _with(floor: FloorPlan, obstacles: Sequence[Polygon]) -> FloorPlan:
    """Return the floor with the unplanned obstacles added."""
    found = tuple(
        Element(f"unplanned-{number}", "unplanned", solids=(shape,), occludes=True, obstacle=True)
        for number, shape in enumerate(obstacles, 1)
    )
    return replace(floor, elements=(*floor.elements, *found))


def _with_poses(
    planned: PlannedFloor, poses: ScanPoses, measured: BoolArray | None, wanted: BoolArray | None
) -> tuple[Visibility, IntArray]:
    """Return the visibility with a row added for each scan pose, and the numbers of these rows.

    Where clouds show what was measured, each row has that instead. Only units `wanted` count, if given.
    """
    seen, space = planned.seen, planned.space
    if measured is None:
        views = _views(space, SightLines(space), poses)
    else:
        start = planned.mission.start
        poses = np.tile((start.x, start.y, start.heading), (int(totals_of_plan(seen).asked.max()), 1))
        views = [np.flatnonzero(measured & seen.visible)] * len(poses)
    joined = with_scans(seen.candidates, poses)
    units = [*(seen.seen_by(row) for row in range(seen.rows)), *views]
    if wanted is not None:
        units = [row[wanted[row]] for row in units]
    whole = visibility_of(joined, units, method=seen.method)
    return whole, np.arange(seen.rows, seen.rows + len(poses))


def _follow_up(known: PlannedFloor, selection: Selection, done: IntArray, evidence: str) -> Mission:
    """Return the mission through the selected stops, with the frame and georeference of the mission before.

    It has its own id. Its required coverage is what its own stops reach, for one view of each target.
    """
    mission, before = assemble(_driven(selection, known.settings, done)), known.mission
    coverage = _coverage_alone(known, mission)
    asked = {"coverage": math.floor(coverage * 1e6) / 1e6, "room_coverage": 0.0, "kind_coverage": 0.0}
    parameters = {**mission.origin.parameters, **asked}
    parameters.pop("views", None)
    settings = recorded_settings(parameters)
    basis = f"{before.id}:{before.revision}:{evidence}:{mission.digest}"
    return with_digest(
        changed(
            mission,
            id=hashlib.sha256(basis.encode()).hexdigest()[:32],
            name=f"{before.name}{FOLLOW_UP}",
            frame=before.frame,
            georeference=before.georeference,
            limits=limits_spec_of(settings),
            origin=changed(mission.origin, parameters=parameters),
        )
    )


def hull_of(points: FloatArray, *, margin: float) -> Polygon:
    """Return the convex outline of points (n, 2), widened by a margin in metres."""
    shape = shapely.MultiPoint(points).convex_hull.buffer(margin, quad_segs=4)
    return Polygon.of(shapely.get_coordinates(shape.exterior))
