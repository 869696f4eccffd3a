"""Route -> mission: stops with headings, approaches, tolerances and scans, ready to send."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import shapely
from msgspec import UNSET, UnsetType

from stopgo.mission import __version__
from stopgo.mission.document import (
    Frame,
    Mission,
    MissionAllocation,
    Point,
    Sees,
    Start,
    Stop,
    mission_id,
    stop_names,
    with_digest,
)
from stopgo.mission.document.specs import (
    DECIMALS,
    limits_spec_of,
    origin_of,
    policy_of,
    robot_of,
    rounded,
    scan_of,
    scanner_of,
    site_origin_of,
)
from stopgo.mission.errors import StopgoError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.frames.transform import SAME, SiteOrigin
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, NavigableSpace, Route
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.overlap.registered import error_of_stop, registered_pairs
from stopgo.planner.routing import GRAPHS
from stopgo.planner.space.gaps import CLEAR_SLACK, Walls, keeps_clear
from stopgo.planner.space.reach import walls_of

ROUNDING_M = 4e-6
"""Metres by which a leg of a mission may be shorter than planned, because its points are rounded."""
ROUNDING_RAD = 1e-4
"""Radians by which a turn of a mission may be smaller than planned, for the same reason."""


def assemble(
    route: Route, *, part: int = 0, revision: int = 1, allocation: MissionAllocation | UnsetType = UNSET
) -> Mission:
    """The mission of a route; `part` numbers the missions of a floor that has several.

    `allocation` identifies it among several missions that together reach the coverage of the floor's plan.
    """
    space = route.space
    settings, floor = space.settings, space.floor
    check_legs(route)
    return with_digest(
        Mission(
            id=mission_id(floor.source, settings, __version__, part),
            revision=revision,
            name=_name(floor.name, part, allocation),
            digest="",
            frame=frame_of_floor(floor),
            georeference=georeference_of(space),
            robot=robot_of(settings),
            scanner=scanner_of(settings),
            limits=limits_spec_of(settings),
            share=allocation,
            start=Start(
                x=rounded(route.start[0]),
                y=rounded(route.start[1]),
                heading=_turned(route.start[2]),
                reason=route.start_reason,
            ),
            stops=_stops(route, settings),
            return_=None if route.return_leg is None else _line(route.return_leg),
            policy=policy_of(settings),
            origin=origin_of(settings, floor=floor.name, digest=floor.digest),
            network=registered_pairs(route) if settings.registers else msgspec.UNSET,
        )
    )


def _name(floor: str, part: int, allocation: MissionAllocation | UnsetType) -> str:
    if allocation is not UNSET:
        return f"{floor} {allocation.kind} {allocation.number} of {allocation.of}"
    return floor if part <= 0 else f"{floor}-{part + 1}"


def frame_of_floor(floor: FloorPlan) -> Frame:
    """Return the frame of a floor's coordinates; `align` later places a site's frame in the robot's map."""
    return Frame(name="map", to_map=SAME) if floor.on_robots_map else Frame(name="site")


def georeference_of(space: NavigableSpace) -> SiteOrigin | None:
    """Return the position on earth: the one given, else the floor's."""
    given, known = site_origin_of(space.settings), space.floor.georeference
    if given is not None or known is None:
        return given
    return SiteOrigin(lat=known.lat, lon=known.lon, alt=known.alt, heading_deg=known.heading_deg)


def _stops(route: Route, settings: Settings) -> tuple[Stop, ...]:
    visibility = route.visibility
    rows = route.selection.chosen[route.order]
    doorways = set(visibility.candidates.doorway_rows.tolist())
    views = np.zeros(visibility.targets.total, dtype=np.int64)
    stops = []
    heading = _turned(route.start[2])
    for name, row, approach in zip(stop_names(len(rows)), rows, route.approaches, strict=True):
        units = visibility.seen_by(int(row))
        views[units] += 1
        new = int(np.count_nonzero(views[units] == visibility.asked[units]))
        heading = _scan_heading(visibility.candidates, int(row), _arrival_heading(approach, heading))
        sees = Sees(units=len(units), new_units=new)
        doorway = int(row) in doorways
        stops.append(_stop(name, approach, heading, sees, settings, doorway=doorway))
    if not settings.registers:
        return tuple(stops)
    return tuple(msgspec.structs.replace(stop, error=error_of_stop(route, k)) for k, stop in enumerate(stops))


def _scan_heading(candidates: Candidates, row: int, arrival: float) -> float:
    """The planned heading of the scan; with a field of view of 360° it is the heading of arrival."""
    if not len(candidates.heading):
        return arrival
    return _turned(candidates.heading[candidates.kept[row]])


def _arrival_heading(approach: FloatArray, before: float) -> float:
    """Direction of the approach's last piece; without movement the heading stays."""
    if len(approach) < 2:
        return before
    step = approach[-1] - approach[-2]
    return rounded(math.atan2(rounded(step[1]), rounded(step[0])))


def _stop(
    name: str, approach: FloatArray, heading: float, sees: Sees, settings: Settings, *, doorway: bool
) -> Stop:
    line = _line(approach)
    return Stop(
        id=name,
        x=line[-1][0],
        y=line[-1][1],
        heading=heading,
        doorway=doorway,
        tolerance_m=settings.tolerance,
        settle_s=settings.settle,
        scan=scan_of(settings.profile, settings.scan_time),
        on_failure=settings.on_failure,
        retries=settings.retries,
        approach=line,
        sees=sees,
    )


def _line(points: FloatArray) -> tuple[Point, ...]:
    return tuple((rounded(x), rounded(y)) for x, y in points.tolist())


def _turned(heading: float) -> float:
    """A heading in radians between -π and π."""
    return rounded(math.remainder(heading, math.tau))


def check_legs(route: Route) -> None:
    """Check that every leg, as sent, keeps its distance from obstacles, closed openings and floor edges.

    Raises
    ------
    StopgoError
        If a leg comes too close; no mission is made then.
    """
    space = route.space
    origin = local_origin(space.floor)
    graph = space.settings.graph
    source = space.floor.name if graph in GRAPHS else f"--graph {graph}"
    exact = walls_of(space)
    walls = Walls(exact.segments, exact.clearance - CLEAR_SLACK)
    tree = shapely.STRtree(walls.shapes())
    legs = route.approaches if route.return_leg is None else (*route.approaches, route.return_leg)
    for leg in legs:
        line = np.round(leg, DECIMALS) - origin
        shape = shapely.LineString(line) if len(line) > 1 else shapely.Point(line[0])
        if not keeps_clear(shape, walls, tree):
            x, y = leg[-1]
            raise StopgoError(f"{source}: leg to ({x:.3f}, {y:.3f}) is too close to an obstacle or an edge")
