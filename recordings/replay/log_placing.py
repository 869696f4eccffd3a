"""Poses of a log in the mission's frame, always with the method that placed them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.frames.geodesy import Geodetic, from_geodetic
from stopgo.mission.frames.transform import Transform
from stopgo.mission.geometry import FloatArray
from stopgo.mission.mavlink.local_frame import is_other_site
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.run.run_log import Alignment, Track
from stopgo.recordings.logs.field_log import FieldLog, Poses
from stopgo.recordings.logs.own import AT_EVENTS, SITE
from stopgo.recordings.replay.fitting import Fit, fitted
from stopgo.recordings.replay.standstills import find_standstills

Align = Literal["first", "stops"]
FAR_M = 20_000.0
"""Distance in metres beyond which a log is of another site."""

FIRST_NS = 3 * 10**8
"""Time after a log's begin within which a first standstill gives a first pose without noise."""


MOST_ASTRAY = 0.4
"""Share of poses that lie far from both neighbours; with more, the log is not that of one robot."""
DIRECTION_M = 0.5
"""Length of the path that gives the first direction of driving."""
LONGEST_TURN_S = 1.0
"""Time without headings during which the robot counts as turning from one to the next."""
BY_EARTH = "georeference"
EMPTY_TRACK = Track.of((), (), ())


@dataclass(frozen=True)
class Placing:
    """The user's choices for placing a log in the mission's frame."""

    to_map: Transform | None = None
    """Pose of the site in the log's frame, as in `robot --map`."""
    align: Align | None = None
    time_offset_s: float = 0.0
    poses: str | None = None
    """Source of the poses."""
    robot: str | None = None
    level_m: float | None = None
    """Height of the mission's floor in the log's frame; None: its zero, or the mission's altitude."""


@dataclass(frozen=True, eq=False)
class PlacedLog:
    """Poses of a log in the mission's frame."""

    track: Track
    alignment: Alignment
    source: Poses
    """The same poses in the log's frame."""
    turns: bool
    """True if headings were measured; else they are the direction of driving."""
    truth: Track | None = None
    """True poses of the robot from a simulator."""
    level_m: float | None = None
    """Height of the mission's floor in the log's frame, as the user gave it."""

    @property
    def by_earth(self) -> bool:
        """True if latitudes and longitudes placed it."""
        return self.alignment.how.startswith(BY_EARTH)

    @property
    def driven_track(self) -> Track:
        """Poses along the driven path; none if the log has poses only with events."""
        return EMPTY_TRACK if self.source.source == AT_EVENTS else self.track


def placed(log: FieldLog, mission: Mission, placing: Placing) -> PlacedLog:
    """Return the log's poses in the mission's frame.

    Raises
    ------
    InputError
        When the log has no pose, several robots, poses that jump, or no transform to the mission frame.
    Undecided
        When its standstills fit the stops by no placing, or by several.
    """
    source = chosen(log, placing)
    if source.astray > MOST_ASTRAY:
        raise InputError(
            f"{log.path}: {source.astray:.0%} of its poses jump away and back, as of two robots in one log; "
            "name each row's robot in a column robot, or give the log of one"
        )
    track, turns = _track(source)
    transform = _transform(log, source, track, turns, mission, placing)
    offset = round(placing.time_offset_s * 1e9)
    moved = _moved(track, transform, offset)
    alignment = replace(transform, time_offset_ns=offset)
    return PlacedLog(moved, alignment, source, turns, _truth(log, source, mission, offset), placing.level_m)


def chosen(log: FieldLog, placing: Placing) -> Poses:
    """Return the requested source of poses, else the one of least rank; all are of one robot.

    Raises
    ------
    InputError
        When the log does not have it; the message names its sources.
    """
    if not log.poses:
        names = ", ".join(channel.name for channel in log.channels)
        why = "; ".join(log.oddities)
        raise InputError(
            f"{log.path}: no pose in it{f' ({why})' if why else ''}; its messages are {names[:300] or 'none'}"
        )
    known = ", ".join(dict.fromkeys(track.source for track in log.poses))
    candidates = [track for track in log.poses if placing.robot is None or track.robot == placing.robot]
    if not candidates:
        names = ", ".join(dict.fromkeys(track.robot or "(without a name)" for track in log.poses))
        raise InputError(f"{log.path}: no poses of robot {placing.robot}; robots in it: {names}")
    if placing.poses is not None:
        candidates = [track for track in candidates if track.source == placing.poses]
        if not candidates:
            raise InputError(f"{log.path}: no poses from --poses {placing.poses}; sources in it: {known}")
    else:
        candidates = [track for track in candidates if not track.truth] or candidates
    least = [track for track in candidates if track.rank == min(item.rank for item in candidates)]
    robots = sorted({track.robot for track in least})
    if len(robots) > 1:
        names = ", ".join(f"{track.source} (robot {track.robot})" for track in least)
        raise InputError(
            f"{log.path}: contains poses of several robots: {names}; choose with --robot-name or --poses"
        )
    return max(least, key=lambda track: len(track.ns))


def _track(source: Poses) -> tuple[Track, bool]:
    """Return the poses as a track; without measured headings, the direction of driving is used."""
    if not len(source.ns):
        return EMPTY_TRACK, False
    measured = np.isfinite(source.heading)
    turns = bool(measured.mean() > 0.5)
    heading = source.heading if measured.all() else _filled_headings(source, measured if turns else None)
    return Track.of(source.ns, source.xy, heading, restarts_ns=source.restarts_ns), turns


def _filled_headings(source: Poses, measured: np.ndarray | None) -> FloatArray:
    """Return headings between measured ones; without any, the directions of driving.

    In a long time without headings the last one stays: a turn that nobody saw ends no standstill.
    """
    seconds = (source.ns - source.ns[0]) / 1e9
    if measured is not None:
        times, headings = seconds[measured], np.unwrap(source.heading[measured])
        late = np.flatnonzero(np.diff(times) > LONGEST_TURN_S)
        ends = np.nextafter(times[late + 1], -np.inf)
        times, headings = np.insert(times, late + 1, ends), np.insert(headings, late + 1, headings[late])
        return np.interp(seconds, times, headings)
    step = np.diff(source.xy, axis=0, prepend=source.xy[:1])
    moving = np.hypot(*step.T) > 1e-3
    if not moving.any():
        return np.zeros(len(seconds))
    rotation_angle = np.unwrap(np.arctan2(step[moving, 1], step[moving, 0]))
    return np.interp(seconds, seconds[moving], rotation_angle)


def _transform(
    log: FieldLog, source: Poses, track: Track, turns: bool, mission: Mission, placing: Placing
) -> Alignment:
    """Return the first transform that applies: the user's, then one from log and mission."""
    if placing.to_map is not None:
        return Alignment.by(placing.to_map.inverse, "given by --map")
    if placing.align == "first":
        return _first(track, turns, mission)
    if placing.align == "stops":
        fit = fitted(find_standstills(track, speed=mission.robot.speed, turns=turns), mission)
        return _of_fit(fit)
    if source.frame == SITE:
        return Alignment(how="the log is in the mission's frame")
    if source.origin is not None and mission.georeference is not None:
        return _by_georeference(log, source, mission)
    if mission.frame.to_map is not None and source.frame in ("map", "world"):
        return Alignment.by(mission.frame.to_map.inverse, f"the mission's own transform to {source.frame}")
    raise InputError(
        f"{log.path}: no transform from frame {source.frame or '(without a name)'} to the mission frame;"
        " give --map X,Y,HEADING, or --align first (the log begins at the mission's start), or --align stops"
    )


def _first(track: Track, turns: bool, mission: Mission) -> Alignment:
    """Return the transform that puts the first pose, averaged if stationary, on the mission's start."""
    standstills = find_standstills(track, speed=mission.robot.speed, turns=turns)
    position, rotation_angle = tuple(track.xy[0].tolist()), float(track.heading[0])
    if standstills and standstills[0].begin_ns - int(track.ns[0]) <= FIRST_NS:
        position, rotation_angle = standstills[0].xy, standstills[0].heading
    wanted = mission.start.heading
    if not turns:  # the driving direction of the first leg is known in both
        position, rotation_angle = tuple(track.xy[0].tolist()), _first_direction(track.xy)
        wanted = _first_direction(np.array([point for leg in legs_of(mission) for point in leg]))
    heading = math.remainder(wanted - rotation_angle, math.tau)
    transform = Transform.bringing(position, (mission.start.x, mission.start.y), heading)
    return Alignment.by(transform, "first pose at the mission's start", pairs=1)


def _first_direction(xy: FloatArray) -> float:
    """Return the direction from the first point to the first one at least DIRECTION_M away."""
    away = np.flatnonzero(np.hypot(*(xy - xy[0]).T) >= DIRECTION_M)
    to = xy[away[0] if len(away) else -1] - xy[0]
    return math.atan2(to[1], to[0])


def _of_fit(fit: Fit) -> Alignment:
    fitted_by = Alignment.by(fit.transform, f"fitted to {fit.pairs} standstills at stops", fit.pairs)
    return replace(fitted_by, residual_rms_m=fit.rms_m, residual_max_m=fit.max_m)


def _by_georeference(log: FieldLog, source: Poses, mission: Mission) -> Alignment:
    """Return the transform from metres east and north of the log's origin."""
    assert source.origin is not None
    assert mission.georeference is not None
    position = Geodetic(lat=source.origin.lat, lon=source.origin.lon)
    if is_other_site(mission.georeference, position):
        raise InputError(
            f"{log.path}: is at {position.lat:.5f}, {position.lon:.5f}, the mission's site at "
            f"{mission.georeference.lat:.5f}, {mission.georeference.lon:.5f}; check the mission"
        )
    x, y = from_geodetic(mission.georeference, position, source.rule)
    heading = math.radians(mission.georeference.heading_deg)
    return Alignment(how=f"{BY_EARTH}, by the rule of {source.rule}", x=x, y=y, heading=heading)


def _moved(track: Track, by: Alignment, offset_ns: int) -> Track:
    restarts = (ns + offset_ns for ns in track.restarts_ns)
    xy = by.transform.points(track.xy)
    return Track.of(track.ns + offset_ns, xy, track.heading + by.heading, restarts_ns=restarts)


def _truth(log: FieldLog, source: Poses, mission: Mission, offset_ns: int) -> Track | None:
    """Return the simulator's true poses in the mission's frame; None without georeference or simulator."""
    found = [track for track in log.poses if track.truth and track is not source]
    if not found or found[0].origin is None or mission.georeference is None:
        return None
    track, _ = _track(found[0])
    return _moved(track, _by_georeference(log, found[0], mission), offset_ns)
