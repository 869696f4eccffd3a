"""A log and a mission -> the log laid beside the mission; refused where they do not belong together."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from stopgo.mission.comparing.compare import compare
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.run.run_log import LogSource, RunLog, Track
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.logs.field_log import FieldLog, Remark
from stopgo.recordings.replay.followed import followed_events
from stopgo.recordings.replay.inferred_events import events_of
from stopgo.recordings.replay.log_placing import PlacedLog, Placing, placed
from stopgo.recordings.replay.matching import Match, matched, reaches
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.standstills import Standing, standings
from stopgo.recordings.replay.reported_visits import told_visits
from stopgo.recordings.replay.uploaded import differences_of

NEAR_ROUTE_M = 2.0
LEAST_ON_ROUTE, LEAST_WITHOUT_HALTS = 0.5, 0.9
"""A log of which less than this share runs within NEAR_ROUTE_M of the route is of another mission."""


def replay(log: FieldLog, mission: Mission, how: Placing, sights: Iterable[Sight] = ()) -> Replay:
    """Lay a log beside its mission.

    Raises
    ------
    InputError
        When the log has no pose, cannot be placed, or is not of this mission.
    AnswerIsNo
        When `--align stops` finds no placing, or several.
    """
    laid = placed(log, mission, how)
    offset = laid.alignment.time_offset_ns
    events = _own_events(log, mission, offset) or followed_events(log, mission, laid)
    halts = _halts(laid, mission)
    matches = told_visits(events, mission, halts) if events else matched(halts, mission, laid.track)
    _must_belong(log, laid.track, mission, matches, how)
    remarks = [replace(remark, ns=remark.ns + offset) for remark in log.remarks]
    told = events or _inferred(log, laid, mission, matches, remarks)
    run = RunLog(
        robot=told[0].robot if told else laid.source.robot,
        run_id=told[0].run_id if told else None,
        mission_id=mission.id,
        revision=told[-1].revision if told else mission.revision,
        source=_source(log, laid),
        poses=laid.way,
        events=told,
        alignment=laid.alignment,
    )
    return Replay(
        log=log,
        mission=mission,
        placed=laid,
        matches=matches,
        run=run,
        comparison=compare(run, [mission], sights),
        uploads=differences_of(log, mission),
        inferred=not events,
    )


def _halts(laid: PlacedLog, mission: Mission) -> tuple[Standing, ...]:
    """Where the robot stood, as its poses between the stops show."""
    return standings(laid.way, speed=mission.robot.speed, turns=laid.turns)


def _inferred(
    log: FieldLog, laid: PlacedLog, mission: Mission, matches: Sequence[Match], remarks: Sequence[Remark]
) -> tuple[AnyEvent, ...]:
    robot = laid.source.robot or Path(log.path).stem
    return events_of(matches, mission, laid.track, remarks, run_id=f"replay-{log.digest[:12]}", robot=robot)


def _own_events(log: FieldLog, mission: Mission, offset_ns: int) -> tuple[AnyEvent, ...]:
    """What a log of stopgo's tells of the newest run of this mission.

    Raises
    ------
    InputError
        When it tells of runs, and of none of this mission.
    """
    mine = [event for event in log.events if event.mission_id == mission.id and event.run_id]
    if log.events and not mine:
        others = ", ".join(dict.fromkeys(event.mission_id[:12] for event in log.events if event.mission_id))
        raise InputError(
            f"{log.path}: has no run of mission {mission.id[:12]}; it has runs of {others or 'none'}"
        )
    if not mine:
        return ()
    from msgspec.structs import replace as changed

    return tuple(
        changed(event, robot_ns=event.robot_ns + offset_ns)
        for event in mine
        if event.run_id == mine[-1].run_id
    )


def _source(log: FieldLog, laid: PlacedLog) -> LogSource:
    notes = (*((f"damaged: {log.lost}",) if log.lost else ()), *log.oddities, *laid.source.oddities)
    return LogSource(Path(log.path).name, log.format, log.digest, log.messages, lost=0, notes=notes)


def _must_belong(
    log: FieldLog, track: Track, mission: Mission, matches: Sequence[Match], how: Placing
) -> None:
    """Refuse a log whose robot was never near a stop, or hardly ever near the route.

    One without a pose, as of a run whose every stop was skipped, is told by its events.
    """
    if not len(track):
        return
    stops = np.array([(stop.x, stop.y) for stop in mission.stops])
    away, reach = nearest_to(stops, track.xy), reaches(mission)
    if how.align == "first":  # that puts the robot at the start, wherever it was
        begins = np.hypot(*(stops - (mission.start.x, mission.start.y)).T) <= reach
        away = np.where(begins, np.inf, away) if not begins.all() else away
    nearest = int(away.argmin())
    name = f"mission {mission.name} ({mission.id[:12]})"
    if away[nearest] > reach[nearest]:
        raise InputError(
            f"{log.path}: was never near a stop of {name}; nearest was {mission.stops[nearest].id}, "
            f"{away[nearest]:.1f} m off; the wrong mission, or a frame placed wrong (--map, --align)?"
        )
    share, stood = on_route(track, mission), any(match.how == "visit" for match in matches)
    if share < (LEAST_ON_ROUTE if stood else LEAST_WITHOUT_HALTS):
        halts = "" if stood else ", and it halted at no stop"
        raise InputError(
            f"{log.path}: only {share:.0%} of the way driven lies within {NEAR_ROUTE_M:g} m of the route of "
            f"{name}{halts}; the wrong mission, or a frame placed wrong (--map, --align)?"
        )


def nearest_to(points: FloatArray, xy: FloatArray) -> FloatArray:
    """How near poses (n, 2) ever came to each point (m, 2): (m,)."""
    return np.array([np.hypot(*(xy - point).T).min() for point in points])


def on_route(track: Track, mission: Mission) -> float:
    """Share of the way driven that lies near the route; of poses where nothing was driven."""
    kept = _thinned(track.xy)
    pieces = [
        np.stack([leg[:-1], leg[1:]], axis=1) for leg in map(np.array, legs_of(mission)) if len(leg) > 1
    ]
    if not pieces:
        stops = np.array([(stop.x, stop.y) for stop in mission.stops])
        return float(
            (np.hypot(*(kept[:, None] - stops).transpose(2, 0, 1)).min(axis=1) <= NEAR_ROUTE_M).mean()
        )
    near = np.zeros(len(kept), bool)
    for a, b in np.concatenate(pieces):
        near |= _away(kept, a, b) <= NEAR_ROUTE_M
    return float(near.mean())


def _thinned(xy: FloatArray) -> FloatArray:
    """Places at least 0.2 m apart along the way, so that standing does not count."""
    kept = [xy[0]]
    for place in xy[:: max(1, len(xy) // 100_000)]:
        if math.dist(place, kept[-1]) >= 0.2:
            kept.append(place)
    return np.array(kept)


def _away(xy: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Distances of points (n, 2) from a straight piece."""
    along, to = b - a, xy - a
    square = float(along @ along)
    t = np.clip(to @ along / square, 0.0, 1.0) if square else np.zeros(len(xy))
    return np.hypot(*(to - t[:, None] * along).T)
