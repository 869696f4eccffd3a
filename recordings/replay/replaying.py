"""Comparison of a log with a mission; a log that does not match the mission is refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from msgspec.structs import replace as changed

from stopgo.mission.comparing.compare import compare
from stopgo.mission.document import Mission
from stopgo.mission.errors import InputError, Undecided
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.run.run_log import LogSource, RunLog, Track
from stopgo.mission.stages.sight import Sight
from stopgo.recordings.logs.field_log import FieldLog, Poses, Remark, apart
from stopgo.recordings.replay.driven_mission import must_be_driven
from stopgo.recordings.replay.followed import followed_events
from stopgo.recordings.replay.inferred_events import events_of
from stopgo.recordings.replay.joined_parts import joined
from stopgo.recordings.replay.log_placing import PlacedLog, Placing, chosen, placed
from stopgo.recordings.replay.matching import Match, matched, reaches
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.reported_visits import reported_visits
from stopgo.recordings.replay.standstills import Standstill, find_standstills
from stopgo.recordings.replay.uploaded import differences_of

FASTER = 50.0
"""Times the mission's speed at which poses are not in metres."""
SLOWER, MOVES = 200.0, 10
"""Part of the mission's speed at which times of a table are not seconds, and pieces of path that show it."""
TABLES = ("CSV trajectory", "TUM trajectory")
"""Formats whose times have no unit of their own."""
UNITS = {"feet": 1 / 0.3048, "inches": 1 / 0.0254, "centimetres": 100.0}
"""Units by their number in a metre."""
ALIKE = 0.15
"""Difference of a path and the route, as a fraction, up to which a unit explains their lengths."""
THINNED_M = 0.2
"""Least distance of poses that give the length and speed of a path."""
NEAR_ROUTE_M = 2.0
LEAST_ON_ROUTE, LEAST_WITHOUT_HALTS = 0.5, 0.9
"""Least fraction of the path within NEAR_ROUTE_M of the route; below it, a log is of another mission."""


def replay(log: FieldLog, mission: Mission, placing: Placing, sights: Iterable[Sight] = ()) -> Replay:
    """Compare a log with its mission.

    Raises
    ------
    InputError
        When the log has no pose, cannot be placed, or is not of this mission.
    Undecided
        When `--align stops` finds no placing, or several.
    """
    try:
        return _compared(log, _placed(log, mission, placing), mission, placing, sights)
    except (InputError, Undecided) as error:
        hint = _unit_hint(chosen(log, placing), mission) if log.poses else ""
        if not hint:
            raise
        raise type(error)(f"{error}{hint}") from None


def _unit_hint(source: Poses, mission: Mission) -> str:
    """Return a remark on poses that move much faster than the robot, or too far; empty for all others."""
    step, seconds = np.hypot(*np.diff(source.xy, axis=0).T), np.diff(source.ns) / 1e9
    moving = (step > 0) & (seconds > 0)
    speed = float(np.median(step[moving] / seconds[moving])) if moving.any() else 0.0
    if speed < FASTER * mission.robot.speed:
        return _length_hint(source.xy, mission)
    return f"; its poses move at {speed:.0f} m/s: give them in metres, and their times in the column's unit"


def _length_hint(xy: FloatArray, mission: Mission) -> str:
    """Return a remark on a path as much longer than the route as a unit is shorter than a metre."""
    route = sum(_length(np.array(leg)) for leg in legs_of(mission))
    path = _length(_thinned(xy))
    for unit, per_metre in UNITS.items():
        if route and abs(path / route / per_metre - 1) <= ALIKE:
            longer = f"{path / route:.3g} times as long as the route"
            return f"; its path is {longer}, as in {unit}: give it in metres"
    return ""


def _placed(log: FieldLog, mission: Mission, placing: Placing) -> PlacedLog:
    """Place a log, unless its times are no seconds."""
    if log.format in TABLES and log.poses:
        _check_times(log, chosen(log, placing), mission)
    return placed(log, mission, placing)


def _check_times(log: FieldLog, source: Poses, mission: Mission) -> None:
    """Refuse a table whose robot moves so slowly that its times are no seconds."""
    at = apart(source.xy, THINNED_M)
    seconds = np.diff(source.ns[at]) / 1e9
    if len(at) <= MOVES or (seconds <= 0).any():
        return
    speed = float(np.median(np.hypot(*np.diff(source.xy[at], axis=0).T) / seconds))
    if speed < mission.robot.speed / SLOWER:
        raise InputError(
            f"{log.path}: its poses move at {1000 * speed:.2g} mm/s with times read as seconds; "
            "name the column of times after its unit, such as time_ms"
        )


def replay_parts(
    logs: Sequence[FieldLog], mission: Mission, placing: Placing, sights: Iterable[Sight] = ()
) -> Replay:
    """Compare the logs of one run with its mission, as one log; each is placed by itself.

    Raises
    ------
    InputError
        As `replay`, and when the logs are not of one robot, or would all begin at the start.
    Undecided
        As `replay`.
    """
    for log in logs:
        if log.events:
            raise InputError(f"{log.path}: is a log of stopgo's own; `stopgo review` joins those of one run")
    if placing.align == "first" and len(logs) > 1:
        raise InputError(
            "--one-run, --align first: only one log begins at the start; give --map or --align stops"
        )
    log, placed_log = joined([(log, _placed(log, mission, placing)) for log in logs])
    return _compared(log, placed_log, mission, placing, sights)


def _compared(
    log: FieldLog, placed_log: PlacedLog, mission: Mission, placing: Placing, sights: Iterable[Sight]
) -> Replay:
    offset = placed_log.alignment.time_offset_ns
    standstills = _standstills(placed_log, mission)
    events = _own_events(log, mission, offset) or followed_events(log, mission, placed_log, standstills)
    matches = (
        reported_visits(events, mission, standstills)
        if events
        else matched(standstills, mission, placed_log.track)
    )
    _check_log_matches(log, placed_log.track, mission, matches, placing)
    remarks = [replace(remark, ns=remark.ns + offset) for remark in log.remarks]
    run_events = events or _inferred(log, placed_log, mission, matches, remarks)
    run = _run_log(log, placed_log, mission, run_events)
    return Replay(
        log=log,
        mission=mission,
        placed=placed_log,
        matches=matches,
        run=run,
        comparison=compare(run, [mission], sights, headings=bool(events) or placed_log.turns),
        uploads=differences_of(log, mission),
        inferred=not events,
    )


def _run_log(log: FieldLog, placed_log: PlacedLog, mission: Mission, events: tuple[AnyEvent, ...]) -> RunLog:
    """Return the run in the log, with its poses in the mission's frame."""
    return RunLog(
        robot=events[0].robot if events else placed_log.source.robot,
        run_id=events[0].run_id if events else None,
        mission_id=mission.id,
        revision=events[-1].revision if events else mission.revision,
        source=_source(log, placed_log),
        poses=placed_log.driven_track,
        events=events,
        alignment=placed_log.alignment,
    )


def _standstills(placed_log: PlacedLog, mission: Mission) -> tuple[Standstill, ...]:
    """Return the standstills in the poses between the stops."""
    return find_standstills(placed_log.driven_track, speed=mission.robot.speed, turns=placed_log.turns)


def _inferred(
    log: FieldLog,
    placed_log: PlacedLog,
    mission: Mission,
    matches: Sequence[Match],
    remarks: Sequence[Remark],
) -> tuple[AnyEvent, ...]:
    robot = placed_log.source.robot or Path(log.path).stem
    return events_of(
        matches, mission, placed_log.track, remarks, run_id=f"replay-{log.digest[:12]}", robot=robot
    )


def _own_events(log: FieldLog, mission: Mission, offset_ns: int) -> tuple[AnyEvent, ...]:
    """Return the events of this mission's newest run from one of stopgo's own logs.

    Raises
    ------
    InputError
        When it contains runs, but none of this mission.
    """
    own = [event for event in log.events if event.mission_id == mission.id and event.run_id]
    if log.events and not own:
        others = ", ".join(dict.fromkeys(event.mission_id[:12] for event in log.events if event.mission_id))
        raise InputError(
            f"{log.path}: no run of mission {mission.id[:12]}; its runs are of {others or 'none'}"
        )
    if not own:
        return ()
    newest = [event for event in own if event.run_id == own[-1].run_id]
    must_be_driven(log, mission, newest)
    return tuple(changed(event, robot_ns=event.robot_ns + offset_ns) for event in newest)


def _source(log: FieldLog, placed_log: PlacedLog) -> LogSource:
    notes = (*((f"damaged: {log.lost}",) if log.lost else ()), *log.oddities, *placed_log.source.oddities)
    return LogSource(Path(log.path).name, log.format, log.digest, log.messages, lost=0, notes=notes)


def _check_log_matches(
    log: FieldLog, track: Track, mission: Mission, matches: Sequence[Match], placing: Placing
) -> None:
    """Refuse a log whose robot was never near a stop, or hardly ever near the route.

    A log without a pose, as of a run that skipped every stop, is checked by its events.
    """
    if not len(track):
        return
    stops = np.array([(stop.x, stop.y) for stop in mission.stops])
    away, reach = nearest_to(stops, track.xy), reaches(mission)
    if placing.align == "first":  # the log is placed at the start in any case
        begins = np.hypot(*(stops - (mission.start.x, mission.start.y)).T) <= reach
        away = np.where(begins, np.inf, away) if not begins.all() else away
    nearest = int(away.argmin())
    name = f"mission {mission.name} ({mission.id[:12]})"
    if away[nearest] > reach[nearest]:
        raise InputError(
            f"{log.path}: never near a stop of {name}; nearest was {mission.stops[nearest].id}, "
            f"{away[nearest]:.1f} m away; check the mission and the frame (--map, --align)"
        )
    fraction, visited = on_route(track, mission), any(match.how == "visit" for match in matches)
    if fraction < (LEAST_ON_ROUTE if visited else LEAST_WITHOUT_HALTS):
        note = "" if visited else ", without a standstill at a stop"
        raise InputError(
            f"{log.path}: only {fraction:.0%} of the driven path is within {NEAR_ROUTE_M:g} m of the route "
            f"of {name}{note}; check the mission and the frame (--map, --align)"
        )


def nearest_to(points: FloatArray, xy: FloatArray) -> FloatArray:
    """Return the least distance of poses (n, 2) from each point (m, 2): (m,)."""
    return np.array([np.hypot(*(xy - point).T).min() for point in points])


def on_route(track: Track, mission: Mission) -> float:
    """Return the fraction of the driven path near the route; without a path, the fraction of poses."""
    thinned = _thinned(track.xy)
    segments = [
        np.stack([leg[:-1], leg[1:]], axis=1) for leg in map(np.array, legs_of(mission)) if len(leg) > 1
    ]
    if not segments:
        stops = np.array([(stop.x, stop.y) for stop in mission.stops])
        return float(
            (np.hypot(*(thinned[:, None] - stops).transpose(2, 0, 1)).min(axis=1) <= NEAR_ROUTE_M).mean()
        )
    near = np.zeros(len(thinned), bool)
    for a, b in np.concatenate(segments):
        near |= _distance_to_segment(thinned, a, b) <= NEAR_ROUTE_M
    return float(near.mean())


def _thinned(xy: FloatArray) -> FloatArray:
    """Return positions at least THINNED_M apart along the path, so that standstills do not count."""
    some = xy[:: max(1, len(xy) // 100_000)]
    return some[apart(some, THINNED_M)]


def _length(xy: FloatArray) -> float:
    """Return the length of a path through points (n, 2)."""
    return float(np.hypot(*np.diff(xy, axis=0).T).sum())


def _distance_to_segment(xy: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the distances of points (n, 2) from a straight segment."""
    along, to = b - a, xy - a
    square = float(along @ along)
    t = np.clip(to @ along / square, 0.0, 1.0) if square else np.zeros(len(xy))
    return np.hypot(*(to - t[:, None] * along).T)
