"""Driven path and lost time of a replay."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.route_position import legs_of
from stopgo.mission.run.run_log import Track
from stopgo.recordings.replay.matching import Match
from stopgo.recordings.replay.replayed import Replay

SMOOTHED_S = 0.5
"""Interval over which positions are averaged before the path is measured: noise would lengthen it."""


@dataclass(frozen=True)
class DrivenPath:
    """Driven path in metres; cross-track errors are positive to the left of the route."""

    driven_m: float | None
    """Length driven; None if the log has no poses between the stops, as are all fields below but the next."""
    planned_m: float
    """Length of the legs up to the last visited stop, and of the return if all were visited."""
    mean_m: float | None
    rms_m: float | None
    median_m: float | None
    """Median of the errors without their signs, as are those below."""
    p95_m: float | None
    greatest_m: float | None
    greatest_s: float | None
    """Time of the greatest error, in seconds since the run began."""

    @property
    def extra_m(self) -> float | None:
        return None if self.driven_m is None else self.driven_m - self.planned_m


@dataclass(frozen=True)
class LostTime:
    """Time that a run lost against the plan; negative if it won time."""

    where: str
    seconds: float


def driven_path(replay: Replay) -> DrivenPath:
    """Measure the driven path; standstills count for the cross-track error."""
    cross_track = replay.comparison.cross_track
    metres = replay.cross_track
    away = np.abs(metres)
    at = cross_track.greatest
    when = None if at is None else float(replay.run.seconds([cross_track.ns[at]])[0])
    measured = bool(len(metres))
    return DrivenPath(
        driven_m=smoothed_track(replay.run.poses, replay.matches).length_m if len(replay.run.poses) else None,
        planned_m=_planned_m(replay.mission, replay.matches),
        mean_m=float(metres.mean()) if measured else None,
        rms_m=float(np.sqrt((metres**2).mean())) if measured else None,
        median_m=float(np.median(away)) if measured else None,
        p95_m=float(np.percentile(away, 95)) if measured else None,
        greatest_m=float(away.max()) if measured else None,
        greatest_s=when,
    )


def smoothed_track(track: Track, matches: tuple[Match, ...]) -> Track:
    """Return the path without its noise: half-second means, and the position of each standstill."""
    if not len(track):
        return track
    standstills = [match.standstill for match in matches]
    moving = np.ones(len(track), bool)
    for standstill in standstills:
        moving &= (track.ns < standstill.begin_ns) | (track.ns > standstill.end_ns)
    rows = [
        (ns, standstill.x, standstill.y, standstill.heading)
        for standstill in standstills
        for ns in (standstill.begin_ns, standstill.end_ns)
    ]
    rows += [_row(track, k) for k in (0, -1) if moving[k]]  # a mean lies after the begin of the path
    standing_poses = np.array([row[1:] for row in rows]).reshape(-1, 3)
    ns, means = _means(
        track.ns[moving], track.xy[moving], np.unwrap(track.heading)[moving], track.restarts_ns
    )
    all_ns = np.concatenate([ns, np.array([row[0] for row in rows], np.int64)])
    return Track.of(
        all_ns,
        np.concatenate([means[:, :2], standing_poses[:, :2]]),
        np.concatenate([means[:, 2], standing_poses[:, 2]]),
        restarts_ns=track.restarts_ns,
    )


def _row(track: Track, index: int) -> tuple[int, float, float, float]:
    x, y = track.xy[index].tolist()
    return int(track.ns[index]), x, y, float(track.heading[index])


def _means(
    ns: IntArray, xy: FloatArray, heading: FloatArray, restarts_ns: tuple[int, ...]
) -> tuple[IntArray, FloatArray]:
    """Return times and x, y, heading (n, 3) averaged over intervals of SMOOTHED_S, none across a restart."""
    if not len(ns):
        return ns, np.empty((0, 3))
    index = ((ns - ns[0]) / (SMOOTHED_S * 1e9)).astype(np.int64)
    index += np.searchsorted(np.sort(np.array(restarts_ns, np.int64)), ns, side="right")
    _, first, many = np.unique(index, return_index=True, return_counts=True)
    table = np.column_stack([(ns - ns[0]).astype(float), xy, heading])
    means = np.add.reduceat(table, first, axis=0) / many[:, None]
    return ns[0] + np.rint(means[:, 0]).astype(np.int64), means[:, 1:]


def _planned_m(mission: Mission, matches: tuple[Match, ...]) -> float:
    """Return the length of the legs planned so far."""
    visited = [match.stop for match in matches if match.stop is not None]
    if not visited:
        return 0.0
    whole = max(visited) + 1 == len(mission.stops)
    legs = legs_of(mission)[: None if whole else max(visited) + 1]
    return sum(float(np.hypot(*np.diff(np.array(leg), axis=0).T).sum()) for leg in legs if len(leg) > 1)


def lost_times(replay: Replay) -> tuple[LostTime, ...]:
    """Return where the run was slower or faster than planned by a second or more, the slowest first."""
    found = [item for item in _lost(replay) if abs(item.seconds) >= 1.0]
    return tuple(sorted(found, key=lambda item: -item.seconds))


def _lost(replay: Replay) -> Iterator[LostTime]:
    """Yield legs between consecutive stops, dwell times, standstills elsewhere, and repeated visits."""
    mission = replay.mission
    planned = {item.stop: item.planned_s for item in replay.comparison.stops}
    before: Match | None = None
    elsewhere = 0.0
    for match in replay.matches:
        standstill = match.standstill
        if match.stop is None:
            yield LostTime(
                f"standstill {standstill.seconds:.0f} s at ({standstill.x:.2f}, {standstill.y:.2f}),"
                " not at a stop",
                standstill.seconds,
            )
            elsewhere += standstill.seconds
            continue
        stop = mission.stops[match.stop]
        stay = stop.settle_s + stop.scan.duration_s
        if match.how != "visit":
            yield LostTime(f"repeated visit of {stop.id}", standstill.seconds)
        else:
            yield LostTime(f"dwell time at {stop.id}", standstill.seconds - stay)
            yield from _leg(before, match, mission, planned, elsewhere)
        before, elsewhere = match, 0.0


def _leg(
    before: Match | None, match: Match, mission: Mission, planned: dict[str, float | None], elsewhere: float
) -> Iterator[LostTime]:
    """Yield the driving time from the stop before, without standstills between."""
    if before is None or before.stop is None or match.stop is None or match.stop != before.stop + 1:
        return
    stop, last = mission.stops[match.stop], mission.stops[before.stop]
    arrive, arrived = planned[stop.id], planned[last.id]
    if arrive is None or arrived is None:
        return
    should = arrive - arrived - last.settle_s - last.scan.duration_s
    took = (match.standstill.begin_ns - before.standstill.end_ns) / 1e9 - elsewhere
    yield LostTime(f"driving from {last.id} to {stop.id}", took - should)
