"""Mission + floor -> stops and legs that do not fit: every clearance of planning is measured again.

A mission may have been edited, or made elsewhere, or the drawing may have changed since it was planned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from msgspec import UNSET
from shapely.geometry.base import BaseGeometry

from stopgo.mission.document import Mission, Point, Policy, ScannerSpec, Stop
from stopgo.mission.document.problems import Problem
from stopgo.mission.document.specs import limits_spec_of, policy_of, robot_of, scanner_of
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.planner.geometry.shapes import HAIRLINE, SLACK, holds, segments_of
from stopgo.planner.space.gaps import CLEAR_SLACK, Walls
from stopgo.planner.space.ground import Ground
from stopgo.planner.space.ignored_lines import over_ignored
from stopgo.planner.space.targets import solid_of

ALLOWED = SLACK + CLEAR_SLACK
"""Tolerance of clearances in metres: that of planning, and the rounding of missions."""

FASTEST = 10.0
"""Speed in m/s that no scanning robot drives between walls, whatever the parameters are."""
LOOSEST = 1.0
"""Position error in metres with which no scan is where it was planned, whatever the parameters are."""


def misfits_on(floor: FloorPlan, mission: Mission, settings: Settings) -> Iterator[Problem]:
    """Stops and legs that come too near an element, a closed opening or a floor edge, or leave the floor."""
    radius = max(settings.radius, mission.robot.radius)
    fit = _Fit(floor, replace(settings, robot_radius=radius))
    for index, stop in enumerate(mission.stops):
        path = f"$.stops[{index}]"
        yield from fit.stop(path, stop)
        yield from fit.leg(f"{path}.approach", stop.approach)
    yield from fit.leg("$.return", mission.return_ or ())
    yield from fit.over_ignored(mission)


def other_machine(mission: Mission, settings: Settings) -> Iterator[Problem]:
    """Robot and scanner values in the mission that differ from those of the plan."""
    pairs = (
        ("$.robot.radius", mission.robot.radius, "robot_radius", settings.radius),
        ("$.scanner.range", mission.scanner.range, "range", settings.range),
        ("$.scanner.fov_deg", mission.scanner.fov_deg, "fov", settings.fov),
    )
    for path, sent, key, planned in pairs:
        if not math.isclose(sent, planned, rel_tol=1e-9):
            yield Problem(path, f"is {sent:g}, but $.origin.parameters.{key} planned with {planned:g}")
    if mission.limits != limits_spec_of(settings):
        yield Problem("$.limits", "are not those that $.origin.parameters planned with")
    if any(stop.sees.units for stop in mission.stops):  # an imported mission has its own values
        yield from _bolder_than_planned(mission, settings)


def _bolder_than_planned(mission: Mission, settings: Settings) -> Iterator[Problem]:
    """Motion faster, scans shorter or of another scanner, and positions less accurate than planned."""
    planned, robot = robot_of(settings), mission.robot
    yield from _other_scanner(mission.scanner, scanner_of(settings))
    yield from _bolder_policy(mission.policy, policy_of(settings))
    yield from _above("$.robot.speed", robot.speed, min(planned.speed, FASTEST))
    yield from _above("$.robot.turn_rate", robot.turn_rate, planned.turn_rate)
    yield from _above("$.robot.acceleration", robot.acceleration, planned.acceleration)
    for index, stop in enumerate(mission.stops):
        path = f"$.stops[{index}]"
        yield from _above(f"{path}.tolerance_m", stop.tolerance_m, min(settings.tolerance, LOOSEST))
        yield from _hastier_scan(path, stop, settings)


def _other_scanner(sent: ScannerSpec, planned: ScannerSpec) -> Iterator[Problem]:
    """Properties of the scanner that are not the plan's; a mission of an earlier version has fewer."""
    for key in ("profile", "model", "step_deg", "near", "blind_cone_deg", "height"):
        value = getattr(sent, key)
        if value is not UNSET and value != getattr(planned, key):
            yield Problem(f"$.scanner.{key}", f"is {value}, which $.origin.parameters did not plan with")


def _bolder_policy(policy: Policy, planned: Policy) -> Iterator[Problem]:
    """A robot that may leave the legs, of which all clearances are, or that drives with less battery."""
    if policy.own_way is True and planned.own_way is not True:
        yield Problem("$.policy.own_way", "is true, but the plan is of legs that the robot drives")
    if policy.battery_min < planned.battery_min * (1 - 1e-6):
        text = f"is {policy.battery_min:g}; the plan asks for at least {planned.battery_min:g}"
        yield Problem("$.policy.battery_min", text)


def _hastier_scan(path: str, stop: Stop, settings: Settings) -> Iterator[Problem]:
    """A scan that takes or waits less time than planned, or is made with another profile."""
    for key, sent, least, what in (
        ("scan.duration_s", stop.scan.duration_s, settings.scan_time, "scans take"),
        ("settle_s", stop.settle_s, settings.settle, "stops settle for"),
    ):
        if sent < least * (1 - 1e-6):
            yield Problem(f"{path}.{key}", f"is {sent:g}, but the plan's {what} {least:g} s")
    if stop.scan.profile != settings.profile:
        text = f"is {stop.scan.profile!r}, but the plan's scans are {settings.profile!r}"
        yield Problem(f"{path}.scan.profile", text)


def _above(path: str, sent: float, most: float) -> Iterator[Problem]:
    if sent > most * (1 + 1e-6):
        yield Problem(path, f"is {sent:g}; the plan allows at most {most:g}")


@dataclass(frozen=True)
class _Fault:
    """A stop or leg too near a wall: the wall, the point on it, and the distances."""

    wall: int
    at: Point
    distance: float
    clearance: float


class _Fit:
    """A floor, prepared for checking the clearances of stops and legs."""

    def __init__(self, floor: FloorPlan, settings: Settings) -> None:
        self.floor, self.settings = floor, settings
        self.ground = Ground.of(floor, settings)
        self.legs = self.ground.walls(settings)
        self.stops = self.ground.stop_walls(settings)
        self._trees = {walls: shapely.STRtree(walls.shapes()) for walls in (self.legs, self.stops)}
        self._doorways = [item.clear for item in self.ground.crossings if not item.closed_because]

    def stop(self, path: str, stop: Stop) -> Iterator[Problem]:
        """A stop's distance from elements and floor edges; for stops in doorways the legs are checked."""
        point = shapely.Point(np.array([stop.x, stop.y]) - self.ground.origin)
        doorway = stop.doorway and any(point.distance(line) <= ALLOWED for line in self._doorways)
        name = f"{stop.id} at {_point_text((stop.x, stop.y))}"
        if stop.doorway and not doorway:
            yield Problem(f"{path}.doorway", f"is true, but {name} is in no doorway that the robot passes")
        if (off := self._off(point)) is not None:
            yield Problem(path, f"{name} {off}")
        elif not doorway and (fault := self._worst(point, self.stops)) is not None:
            yield Problem(path, f"{name} is {self._shortfall_text(fault, self.stops)}")
        for x, y, radius in self.settings.avoid:
            if math.dist((x, y), (stop.x, stop.y)) < radius - ALLOWED:
                yield Problem(path, f"{stop.id} is in the circle to avoid at {_point_text((x, y))}")

    def leg(self, path: str, leg: tuple[Point, ...]) -> Iterator[Problem]:
        """Every straight segment of a leg, reported at the point where it ends."""
        for index, (a, b) in enumerate(pairwise(leg if len(leg) > 1 else leg * 2), start=1):
            ends = np.array([a, b]) - self.ground.origin
            line = shapely.LineString(ends) if a != b else shapely.Point(ends[0])
            name = f"the segment from {_point_text(a)} to {_point_text(b)}"
            where = f"{path}[{min(index, len(leg) - 1)}]"
            if (off := self._off(line)) is not None:
                yield Problem(where, f"{name} {off}")
            elif (fault := self._worst(line, self.legs)) is not None:
                yield Problem(where, f"{name} is {self._shortfall_text(fault, self.legs)}")

    def over_ignored(self, mission: Mission) -> Iterator[Problem]:
        """Legs over lines of the drawing that were not read."""
        legs = [stop.approach for stop in mission.stops] + ([mission.return_] if mission.return_ else [])
        shapes = [shapely.LineString(self._local(leg)) for leg in legs if leg]
        radius = self.settings.radius
        for item in over_ignored(self.floor, shapes, stops=len(mission.stops), radius=radius):
            yield Problem("$.stops", item.message)

    def _local(self, leg: tuple[Point, ...]) -> FloatArray:
        """A leg in the local frame (n, 2), with two points at least."""
        return np.array(leg if len(leg) > 1 else leg * 2) - self.ground.origin

    def _off(self, shape: BaseGeometry) -> str | None:
        """Problem text if a point or line leaves the floor or lies within an element; else None."""
        if not holds(self.ground.outline, shape, slack=ALLOWED):
            out = shapely.get_coordinates(shape.difference(self.ground.outline))
            far = out[np.argmax(shapely.distance(shapely.points(out), self.ground.outline))]
            away = self.ground.outline.distance(shapely.Point(far))
            return f"is off the floor: {self._at(far)} lies {away:.3f} m outside it"
        if self.ground.obstacles.contains(shape):
            return f"lies within {self._element(shape).id}"
        return None

    def _worst(self, shape: BaseGeometry, walls: Walls) -> _Fault | None:
        """The largest shortfall of a clearance; None if every clearance is kept."""
        if not len(walls.segments):
            return None
        tree = self._trees[walls]
        near = tree.query(shape, predicate="dwithin", distance=float(walls.clearance.max()))
        distance = shapely.distance(shape, tree.geometries[near])
        short = walls.clearance[near] - distance
        if not np.any(short > ALLOWED):
            return None
        worst = int(np.argmax(short))
        wall = int(near[worst])
        at = shapely.get_coordinates(shapely.shortest_line(tree.geometries[wall], shape))[0]
        return _Fault(wall, tuple(at.tolist()), float(distance[worst]), float(walls.clearance[wall]))

    def _shortfall_text(self, fault: _Fault, walls: Walls) -> str:
        """Text of a distance: to which wall, at which point, and the required distance."""
        return (
            f"{fault.distance:.3f} m from {self._name(fault, walls)} at {self._at(np.array(fault.at))}, "
            f"less than {fault.clearance:.3f} m"
        )

    def _name(self, fault: _Fault, walls: Walls) -> str:
        """Name of a wall: an element, a closed opening, or the floor's edge."""
        solid = len(segments_of(self.ground.obstacles))
        if fault.wall < solid:
            return self._element(shapely.Point(fault.at)).id
        if walls is self.legs and fault.wall < solid + len(self.ground.barriers):
            closed = [item for item in self.ground.crossings if item.closed_because]
            item = closed[fault.wall - solid]
            return f"{item.opening.kind} {item.opening.id} ({item.closed_because})"
        return "the floor's edge"

    def _element(self, shape: BaseGeometry) -> Element:
        """The obstacle nearest to a point or line."""
        items, solids = self._obstacles
        return items[int(np.argmin(shapely.distance(solids, shape)))]

    @cached_property
    def _obstacles(self) -> tuple[list[Element], list[BaseGeometry]]:
        items = [item for item in self.floor.elements if item.obstacle]
        return items, [solid_of(item, self.ground.origin, HAIRLINE) for item in items]

    def _at(self, local: FloatArray) -> str:
        return _point_text(tuple((local + self.ground.origin).tolist()))


def _point_text(point: tuple[float, ...]) -> str:
    return f"({point[0]:.3f}, {point[1]:.3f})"
