"""Track -> mission: values that the file does not contain come from the parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import msgspec

from stopgo.mission import __version__
from stopgo.mission.document import (
    Frame,
    Mission,
    Point,
    RobotSpec,
    Scan,
    Sees,
    Start,
    Stop,
    mission_id,
    with_digest,
)
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.document.problems import problems_of
from stopgo.mission.document.specs import (
    origin_of,
    policy_of,
    robot_of,
    rounded,
    scan_of,
    scanner_of,
    site_origin_of,
)
from stopgo.mission.errors import InputError
from stopgo.mission.files.imports.track import ImportedRoute, Visit
from stopgo.mission.settings import Settings


def mission_of(track: ImportedRoute, settings: Settings, *, name: str, file: str, digest: str) -> Mission:
    """Return the mission of a track; legs are straight between the positions in the file.

    Parameters
    ----------
    file, digest
        Name of the imported file and the sha256 of its bytes.

    Raises
    ------
    InputError
        When it makes no sense, such as two stops with one id.
    """
    legs = list(_legs(track, settings))
    start = _start(track, settings, legs[0], file)
    mission = with_digest(
        Mission(
            id=mission_id(FloorSource(file, digest), settings, __version__),
            revision=1,
            name=name,
            digest="",
            frame=Frame(name="site"),
            georeference=site_origin_of(settings) or track.origin,
            robot=_robot(track, settings),
            scanner=scanner_of(settings),
            start=start,
            stops=tuple(_stops(track.visits, legs, start.heading, settings)),
            return_=tuple(_distinct([legs[-1][-1], *track.back])) if track.back else None,
            policy=policy_of(settings),
            origin=origin_of(replace(settings, register=False), floor=file, digest=digest),
        )
    )
    for problem in problems_of(mission):
        raise InputError(f"{file}: the mission in it is implausible: {problem}; correct the file")
    return mission


def _legs(track: ImportedRoute, settings: Settings) -> Iterator[list[Point]]:
    """Return the approach of each visit; the first begins at the start, if one is known."""
    start = settings.start[:2] if settings.start is not None else track.start
    before = [] if start is None else [start]
    for visit in track.visits:
        leg = _distinct([*before, *visit.via, visit.xy])
        yield leg
        before = [leg[-1]]


def _distinct(leg: Sequence[Point]) -> list[Point]:
    """Round to DECIMALS, and leave out repeated points."""
    points = [(rounded(x), rounded(y)) for x, y in leg]
    return [point for number, point in enumerate(points) if number == 0 or point != points[number - 1]]


def _start(track: ImportedRoute, settings: Settings, leg: Sequence[Point], file: str) -> Start:
    x, y = leg[0]
    if settings.start is not None:
        heading = math.remainder(math.radians(settings.start[2]), math.tau)
        return Start(x=x, y=y, heading=rounded(heading), reason="given")
    ahead = track.visits[0].heading or 0.0
    return Start(x=x, y=y, heading=rounded(_direction(leg[:2], ahead)), reason=f"the first place in {file}")


def _direction(leg: Sequence[Point], otherwise: float) -> float:
    """Return the direction of a polyline's last segment."""
    if len(leg) < 2:
        return otherwise
    (x0, y0), (x1, y1) = leg[-2:]
    return math.atan2(y1 - y0, x1 - x0)


def _stops(
    visits: Sequence[Visit], legs: Sequence[list[Point]], heading: float, settings: Settings
) -> Iterator[Stop]:
    """Return the heading of a stop; an unknown one is the direction of arrival."""
    width = max(2, len(str(len(visits))))
    for number, (visit, leg) in enumerate(zip(visits, legs, strict=True), 1):
        heading = _direction(leg, heading) if visit.heading is None else visit.heading
        yield _stop(visit, visit.id or f"s{number:0{width}d}", leg, rounded(heading), settings)


def _stop(visit: Visit, name: str, leg: list[Point], heading: float, settings: Settings) -> Stop:
    return Stop(
        id=name,
        x=leg[-1][0],
        y=leg[-1][1],
        heading=heading,
        doorway=visit.doorway,
        tolerance_m=_or(visit.tolerance_m, settings.tolerance),
        settle_s=_or(visit.settle_s, settings.settle),
        scan=_scan(visit, settings),
        on_failure=visit.on_failure or settings.on_failure,
        retries=settings.retries if visit.retries is None else visit.retries,
        approach=tuple(leg),
        sees=Sees(units=0, new_units=0),
    )


def _scan(visit: Visit, settings: Settings) -> Scan:
    scan = scan_of(visit.profile or settings.profile, _or(visit.scan_s, settings.scan_time))
    return scan if visit.timeout_s is None else msgspec.structs.replace(scan, timeout_s=visit.timeout_s)


def _robot(track: ImportedRoute, settings: Settings) -> RobotSpec:
    robot = robot_of(settings)
    return robot if track.speed is None else msgspec.structs.replace(robot, speed=track.speed)


def _or(value: float | None, otherwise: float) -> float:
    return otherwise if value is None else value
