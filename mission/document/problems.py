"""Plausibility of a well-formed mission: meaningful numbers, and legs that join."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import msgspec
from msgspec import UNSET

from stopgo.mission.document import Mission, Point, PositionError, Start, Stop
from stopgo.mission.frames.geodesy import out_of_reach
from stopgo.mission.settings.parameter import HIGHEST_M

JOIN = 1e-3
"""Metres within which the ends of two legs are the same point."""
FAR = 1e8
"""Metres beyond which no site's coordinates lie."""
EXTENT = 20_000.0
"""Metres from its start beyond which no mission on a floor reaches."""


@dataclass(frozen=True)
class Problem:
    """An implausible value, at a JSON path."""

    path: str
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}"


def problems_of(mission: Mission) -> tuple[Problem, ...]:
    """Return all implausible values of the mission, in the order of the document."""
    return (
        *_identity(mission),
        *_georeference(mission),
        *_robot_and_scanner(mission),
        *_start(mission.start),
        *_stops(mission),
        *_legs(mission),
        *_policy(mission),
        *_network(mission),
    )


def _identity(mission: Mission) -> Iterator[Problem]:
    if not mission.id:
        yield Problem("$.id", "is empty")
    if mission.revision < 1:
        yield Problem("$.revision", f"is {mission.revision}; revisions count from 1")


def _georeference(mission: Mission) -> Iterator[Problem]:
    site = mission.georeference
    if site is not None and not (abs(site.lat) <= 90 and abs(site.lon) <= 180):
        yield Problem("$.georeference", f"lat {site.lat}, lon {site.lon} is not a position on Earth")
    if site is not None and abs(site.alt) > HIGHEST_M:
        yield Problem("$.georeference", f"alt is {site.alt:g}; it must be within ±{HIGHEST_M:g} m")
    far = out_of_reach((mission.start.x, mission.start.y))
    if site is not None and far:
        yield Problem("$.georeference", f"the start {far}")
    to_map = mission.frame.to_map
    if to_map is not None:
        yield from _pose("$.frame.to_map", (to_map.x, to_map.y), to_map.heading)


def _robot_and_scanner(mission: Mission) -> Iterator[Problem]:
    robot, scanner = mission.robot, mission.scanner
    for key in ("radius", "speed", "turn_rate", "acceleration"):
        yield from _positive(f"$.robot.{key}", getattr(robot, key))
    yield from _positive("$.scanner.range", scanner.range)
    if not 0 < scanner.fov_deg <= 360:
        yield Problem("$.scanner.fov_deg", f"is {scanner.fov_deg}; it must be above 0 and at most 360")
    known = {f"$.scanner.{key}": getattr(scanner, key) for key in ("step_deg", "height")}
    limits = ("max_incidence_deg", "density_mm", "wall_height", "views")
    known |= {f"$.limits.{key}": getattr(mission.limits, key, UNSET) for key in limits}
    for path, value in known.items():
        if value is not UNSET:
            yield from _positive(path, value)
    near = getattr(mission.limits, "near", UNSET)
    blind = {"$.scanner.near": scanner.near, "$.scanner.blind_cone_deg": scanner.blind_cone_deg}
    for path, value in {**blind, "$.limits.near": near}.items():
        if value is not UNSET:
            yield from _not_negative(path, value)


def _start(start: Start) -> Iterator[Problem]:
    yield from _pose("$.start", (start.x, start.y), start.heading)


def _stops(mission: Mission) -> Iterator[Problem]:
    if not mission.stops:
        yield Problem("$.stops", "is empty; a mission has at least one stop")
    known: dict[str, int] = {}
    for index, stop in enumerate(mission.stops):
        path = f"$.stops[{index}]"
        if stop.id in known:
            yield Problem(f"{path}.id", f"is {stop.id!r}, already used by $.stops[{known[stop.id]}]")
        known.setdefault(stop.id, index)
        yield from _stop(path, stop)
        yield from _far_point(path, (stop.x, stop.y), mission.start)


def _stop(path: str, stop: Stop) -> Iterator[Problem]:
    if not stop.id:
        yield Problem(f"{path}.id", "is empty")
    yield from _pose(path, (stop.x, stop.y), stop.heading)
    yield from _positive(f"{path}.tolerance_m", stop.tolerance_m)
    yield from _not_negative(f"{path}.settle_s", stop.settle_s)
    yield from _not_negative(f"{path}.scan.duration_s", stop.scan.duration_s)
    if stop.scan.timeout_s < stop.scan.duration_s:
        yield Problem(f"{path}.scan.timeout_s", f"is {stop.scan.timeout_s}, shorter than the scan itself")
    yield from _not_negative(f"{path}.retries", stop.retries)
    if not 0 <= stop.sees.new_units <= stop.sees.units:
        seen = stop.sees
        yield Problem(f"{path}.sees", f"{seen.new_units} new units of {seen.units}; new is a part of all")
    if stop.error is not UNSET:
        yield from _error(f"{path}.error", stop.error)


def _legs(mission: Mission) -> Iterator[Problem]:
    here, where = (mission.start.x, mission.start.y), "the start"
    for index, stop in enumerate(mission.stops):
        path = f"$.stops[{index}].approach"
        yield from _leg(path, stop.approach, begin=here, where=where)
        yield from _far_points(path, stop.approach, mission.start)
        here, where = (stop.x, stop.y), f"stop {stop.id}"
        if stop.approach and _apart(stop.approach[-1], here):
            end = len(stop.approach) - 1
            yield Problem(f"{path}[{end}]", f"{_xy(stop.approach[-1])} is not {where} at {_xy(here)}")
    if mission.return_ is not None:
        yield from _leg("$.return", mission.return_, begin=here, where=where)
        yield from _far_points("$.return", mission.return_, mission.start)


def _leg(path: str, leg: tuple[Point, ...], *, begin: Point, where: str) -> Iterator[Problem]:
    if not leg:
        yield Problem(path, "is empty; a leg holds both its ends")
        return
    if _apart(leg[0], begin):
        yield Problem(f"{path}[0]", f"{_xy(leg[0])} is not {where} at {_xy(begin)}")
    for index, point in enumerate(leg):
        yield from _near(f"{path}[{index}]", point)


def _far_points(path: str, leg: tuple[Point, ...], start: Start) -> Iterator[Problem]:
    for index, point in enumerate(leg):
        yield from _far_point(f"{path}[{index}]", point, start)


def _far_point(path: str, point: Point, start: Start) -> Iterator[Problem]:
    """Report a point too far from the start; large survey coordinates alone are allowed."""
    away = math.dist(point, (start.x, start.y))
    if EXTENT < away <= FAR:
        distance = f"{_xy(point)} is {away / 1000:.1f} km from the start"
        yield Problem(path, f"{distance}; the limit is {EXTENT / 1000:g} km")


def _apart(one: Point, other: Point) -> bool:
    return not math.dist(one, other) <= JOIN  # `not <=`, so that NaN is apart


def _xy(point: Point) -> str:
    return f"({point[0]:.3f}, {point[1]:.3f})"


def _policy(mission: Mission) -> Iterator[Problem]:
    policy = mission.policy
    yield from _not_negative("$.policy.link_loss_after_s", policy.link_loss_after_s)
    if not 0 <= policy.battery_min < 1:
        yield Problem("$.policy.battery_min", f"is {policy.battery_min}; it must be at least 0 and below 1")


def _network(mission: Mission) -> Iterator[Problem]:
    overlaps = () if isinstance(mission.network, msgspec.UnsetType) else mission.network
    stops, pairs = {stop.id for stop in mission.stops}, set()
    for index, item in enumerate(overlaps):
        path = f"$.network[{index}]"
        for end in ("a", "b"):
            if getattr(item, end) not in stops:
                yield Problem(f"{path}.{end}", f"is {getattr(item, end)!r}, which is not a stop")
        pair = frozenset((item.a, item.b))
        if len(pair) < 2 or pair in pairs:
            yield Problem(path, f"{item.a} and {item.b} are {'a pair twice' if pair in pairs else 'no pair'}")
        pairs.add(pair)
        for key in ("common_m", "share", "hold_m"):
            yield from _not_negative(f"{path}.{key}", getattr(item, key))


def _error(path: str, error: PositionError) -> Iterator[Problem]:
    """Half axes that are none, or in the wrong order, and a direction that is none."""
    yield from _not_negative(f"{path}.major_m", error.major_m)
    yield from _not_negative(f"{path}.minor_m", error.minor_m)
    if error.minor_m > error.major_m:
        yield Problem(f"{path}.minor_m", f"is {error.minor_m:g}, more than major_m, {error.major_m:g}")
    if not 0 <= error.direction <= math.pi:
        yield Problem(f"{path}.direction", f"is {error.direction:g}; it is from 0 to π radians")


def _pose(path: str, point: Point, heading: float) -> Iterator[Problem]:
    yield from _near(path, point)
    if not abs(heading) <= math.tau:
        yield Problem(f"{path}.heading", f"is {heading}; headings are radians within ±2π")


def _near(path: str, point: Point) -> Iterator[Problem]:
    if not (abs(point[0]) <= FAR and abs(point[1]) <= FAR):
        yield Problem(path, f"({point[0]:g}, {point[1]:g}) is not within {FAR:g} m of the origin")


def _positive(path: str, value: float) -> Iterator[Problem]:
    if not 0 < value < math.inf:
        yield Problem(path, f"is {value}; it must be finite and greater than 0")


def _not_negative(path: str, value: float) -> Iterator[Problem]:
    if not 0 <= value < math.inf:
        yield Problem(path, f"is {value}; it must be finite and not negative")
