"""A log's poses -> the mission's frame: never silently, always with how it was done."""

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
from stopgo.mission.run.run_log import Alignment, Track
from stopgo.recordings.logs.field_log import FieldLog, Poses
from stopgo.recordings.logs.own import AT_EVENTS, SITE
from stopgo.recordings.replay.fitting import Fit, fitted, turning
from stopgo.recordings.replay.standstills import standings

Align = Literal["first", "stops"]
FAR_M = 20_000.0
"""A log that lies farther from the mission's site than this is of another site."""

FIRST_NS = 3 * 10**8
"""A robot that halts as soon after a log's beginning has its first pose where it halted, noise apart."""


BY_EARTH = "georeference"
NO_WAY = Track.of((), (), ())


@dataclass(frozen=True)
class Placing:
    """How the user wants a log to be laid on the mission."""

    to_map: Transform | None = None
    """Where the log's frame sees the site: as `robot --map`."""
    align: Align | None = None
    time_offset_s: float = 0.0
    poses: str | None = None
    """The source of poses to be taken."""
    robot: str | None = None


@dataclass(frozen=True, eq=False)
class PlacedLog:
    """A log's poses in the mission's frame."""

    track: Track
    alignment: Alignment
    source: Poses
    """What they were, in the log's frame."""
    turns: bool
    """Whether headings were measured; else they are the direction of driving."""
    truth: Track | None = None
    """Where a simulator says the robot was."""

    @property
    def by_earth(self) -> bool:
        """Whether latitudes and longitudes have placed it."""
        return self.alignment.how.startswith(BY_EARTH)

    @property
    def way(self) -> Track:
        """The poses that tell how the robot drove; none where it told its poses with events alone."""
        return NO_WAY if self.source.source == AT_EVENTS else self.track


def placed(log: FieldLog, mission: Mission, how: Placing) -> PlacedLog:
    """The log's poses in the mission's frame.

    Raises
    ------
    InputError
        When the log has no pose, several robots, or nothing tells how its frame lies to the mission's.
    NegativeResult
        When its halts fit the stops in no way or in several.
    """
    source = chosen(log, how)
    track, turns = _track(source)
    transform = _transform(log, source, track, turns, mission, how)
    offset = round(how.time_offset_s * 1e9)
    moved = _moved(track, transform, offset)
    alignment = replace(transform, time_offset_ns=offset)
    return PlacedLog(moved, alignment, source, turns, _truth(log, source, mission, offset))


def chosen(log: FieldLog, how: Placing) -> Poses:
    """The source of poses that is asked for, else the one of least rank; of one robot.

    Raises
    ------
    InputError
        Naming what the log has instead.
    """
    if not log.poses:
        held = ", ".join(channel.name for channel in log.channels)
        why = "; ".join(log.oddities)
        raise InputError(
            f"{log.path}: no pose in it{f' ({why})' if why else ''}; its messages are {held[:300] or 'none'}"
        )
    known = ", ".join(dict.fromkeys(track.source for track in log.poses))
    fits = [track for track in log.poses if how.robot is None or track.robot == how.robot]
    if not fits:
        names = ", ".join(dict.fromkeys(track.robot or "(without a name)" for track in log.poses))
        raise InputError(f"{log.path}: no poses of robot {how.robot}; it has those of {names}")
    if how.poses is not None:
        fits = [track for track in fits if track.source == how.poses]
        if not fits:
            raise InputError(f"{log.path}: --poses {how.poses} is not in it; it has {known}")
    else:
        fits = [track for track in fits if not track.truth] or fits
    least = [track for track in fits if track.rank == min(item.rank for item in fits)]
    robots = sorted({track.robot for track in least})
    if len(robots) > 1:
        names = ", ".join(f"{track.source} (robot {track.robot})" for track in least)
        raise InputError(
            f"{log.path}: has poses of several robots: {names}; choose with --robot-name or --poses"
        )
    return max(least, key=lambda track: len(track.ns))


def _track(source: Poses) -> tuple[Track, bool]:
    """As a track; where no headings were measured they are made from the way."""
    if not len(source.ns):
        return NO_WAY, False
    measured = np.isfinite(source.heading)
    turns = bool(measured.mean() > 0.5)
    heading = source.heading if measured.all() else _filled(source, measured if turns else None)
    return Track.of(source.ns, source.xy, heading), turns


def _filled(source: Poses, measured: np.ndarray | None) -> FloatArray:
    """Headings between those that were measured; where none were, the directions of driving."""
    seconds = (source.ns - source.ns[0]) / 1e9
    if measured is not None:
        return np.interp(seconds, seconds[measured], np.unwrap(source.heading[measured]))
    step = np.diff(source.xy, axis=0, prepend=source.xy[:1])
    moving = np.hypot(*step.T) > 1e-3
    if not moving.any():
        return np.zeros(len(seconds))
    turn = np.unwrap(np.arctan2(step[moving, 1], step[moving, 0]))
    return np.interp(seconds, seconds[moving], turn)


def _transform(
    log: FieldLog, source: Poses, track: Track, turns: bool, mission: Mission, how: Placing
) -> Alignment:
    """The first way that applies: what the user says, then what log and mission both tell."""
    if how.to_map is not None:
        return _from_map(how.to_map, "given by --map")
    if how.align == "first":
        return _first(track, turns, mission)
    if how.align == "stops":
        fit = fitted(standings(track, speed=mission.robot.speed, turns=turns), mission)
        return _of_fit(fit)
    if source.frame == SITE:
        return Alignment(how="the log is in the mission's frame")
    if source.origin is not None and mission.georeference is not None:
        return _by_georeference(log, source, mission)
    if mission.frame.to_map is not None and source.frame in ("map", "world"):
        return _from_map(mission.frame.to_map, f"the mission's own transform to {source.frame}")
    raise InputError(
        f"{log.path}: nothing tells how its frame {source.frame or '(without a name)'} lies to the mission's;"
        " give --map X,Y,HEADING, or --align first (the log begins at the mission's start), or --align stops"
    )


def _from_map(to_map: Transform, how: str) -> Alignment:
    """The inverse of site to map: turn by `heading`, then shift."""
    x, y = -turning(-to_map.heading) @ (to_map.x, to_map.y)
    return Alignment(how=how, x=float(x), y=float(y), heading=-to_map.heading)


def _first(track: Track, turns: bool, mission: Mission) -> Alignment:
    """So that the first pose, as far as noise lets it be known, is the mission's start."""
    halts = standings(track, speed=mission.robot.speed, turns=turns)
    place, turn = track.xy[0], float(track.heading[0])
    if halts and halts[0].begin_ns - int(track.ns[0]) <= FIRST_NS:
        place, turn = np.array(halts[0].xy), halts[0].heading
    heading = math.remainder(mission.start.heading - turn, math.tau)
    x, y = np.array([mission.start.x, mission.start.y]) - turning(heading) @ place
    return Alignment(
        how="first pose at the mission's start", x=float(x), y=float(y), heading=heading, pairs=1
    )


def _of_fit(fit: Fit) -> Alignment:
    return Alignment(
        how=f"fitted to {fit.pairs} halts at stops",
        x=fit.x, y=fit.y, heading=fit.heading,
        residual_rms_m=fit.rms_m, residual_max_m=fit.max_m, pairs=fit.pairs,
    )  # fmt: skip


def _by_georeference(log: FieldLog, source: Poses, mission: Mission) -> Alignment:
    """From metres east and north of the log's origin."""
    assert source.origin is not None
    assert mission.georeference is not None
    place = Geodetic(lat=source.origin.lat, lon=source.origin.lon)
    if is_other_site(mission.georeference, place):
        raise InputError(
            f"{log.path}: is at {place.lat:.5f}, {place.lon:.5f}, and the mission's site at "
            f"{mission.georeference.lat:.5f}, {mission.georeference.lon:.5f}: the wrong mission?"
        )
    x, y = from_geodetic(mission.georeference, place, source.rule)
    heading = math.radians(mission.georeference.heading_deg)
    return Alignment(how=f"{BY_EARTH}, by the rule of {source.rule}", x=x, y=y, heading=heading)


def _moved(track: Track, by: Alignment, offset_ns: int) -> Track:
    xy = track.xy @ turning(by.heading).T + (by.x, by.y)
    return Track.of(track.ns + offset_ns, xy, track.heading + by.heading)


def _truth(log: FieldLog, source: Poses, mission: Mission, offset_ns: int) -> Track | None:
    """What a simulator says, brought to the site by the earth; None where either is unknown."""
    found = [track for track in log.poses if track.truth and track is not source]
    if not found or found[0].origin is None or mission.georeference is None:
        return None
    track, _ = _track(found[0])
    return _moved(track, _by_georeference(log, found[0], mission), offset_ns)
