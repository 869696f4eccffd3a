"""What a replay amounts to beyond its stops: the way driven, and where time was lost."""

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
"""The way is measured between means over as long as this: noise would lengthen it."""


@dataclass(frozen=True)
class Way:
    """The way driven, in metres; distances beside the route are positive to its left."""

    driven_m: float | None
    """None where the log has no poses between the stops; so are all below but the next."""
    planned_m: float
    """Of the legs up to the last stop that was visited, and of the return if all were."""
    mean_m: float | None
    rms_m: float | None
    median_m: float | None
    """Of the distances without their signs, as those below."""
    p95_m: float | None
    greatest_m: float | None
    greatest_s: float | None
    """When it was that far, in seconds since the run began."""

    @property
    def extra_m(self) -> float | None:
        return None if self.driven_m is None else self.driven_m - self.planned_m


@dataclass(frozen=True)
class Lost:
    """Time that a run took longer than planned, or won."""

    where: str
    seconds: float


def way_of(replay: Replay) -> Way:
    """Measured where the robot was on a leg, halts included in the figures beside the route."""
    beside = replay.comparison.beside
    metres = replay.beside
    away = np.abs(metres)
    at = beside.greatest
    when = None if at is None else float(replay.run.seconds([beside.ns[at]])[0])
    told = bool(len(metres))
    return Way(
        driven_m=way_track(replay.run.poses, replay.matches).length_m if len(replay.run.poses) else None,
        planned_m=_planned_m(replay.mission, replay.matches),
        mean_m=float(metres.mean()) if told else None,
        rms_m=float(np.sqrt((metres**2).mean())) if told else None,
        median_m=float(np.median(away)) if told else None,
        p95_m=float(np.percentile(away, 95)) if told else None,
        greatest_m=float(away.max()) if told else None,
        greatest_s=when,
    )


def way_track(track: Track, matches: tuple[Match, ...]) -> Track:
    """The way without its noise: means of half a second, and of each halt the place where the robot stood."""
    if not len(track):
        return track
    halts = [match.standing for match in matches]
    moving = np.ones(len(track), bool)
    for halt in halts:
        moving &= (track.ns < halt.begin_ns) | (track.ns > halt.end_ns)
    rows = [(ns, halt.x, halt.y, halt.heading) for halt in halts for ns in (halt.begin_ns, halt.end_ns)]
    rows += [_row(track, k) for k in (0, -1) if moving[k]]  # a mean lies behind where the way begins
    stood = np.array([row[1:] for row in rows]).reshape(-1, 3)
    ns, means = _means(track.ns[moving], track.xy[moving], np.unwrap(track.heading)[moving])
    all_ns = np.concatenate([ns, np.array([row[0] for row in rows], np.int64)])
    return Track.of(
        all_ns, np.concatenate([means[:, :2], stood[:, :2]]), np.concatenate([means[:, 2], stood[:, 2]])
    )


def _row(track: Track, index: int) -> tuple[int, float, float, float]:
    x, y = track.xy[index].tolist()
    return int(track.ns[index]), x, y, float(track.heading[index])


def _means(ns: IntArray, xy: FloatArray, heading: FloatArray) -> tuple[IntArray, FloatArray]:
    """Times and x, y, heading (n, 3) averaged over pieces of SMOOTHED_S."""
    if not len(ns):
        return ns, np.empty((0, 3))
    index = ((ns - ns[0]) / (SMOOTHED_S * 1e9)).astype(np.int64)
    _, first, many = np.unique(index, return_index=True, return_counts=True)
    table = np.column_stack([(ns - ns[0]).astype(float), xy, heading])
    means = np.add.reduceat(table, first, axis=0) / many[:, None]
    return ns[0] + np.rint(means[:, 0]).astype(np.int64), means[:, 1:]


def _planned_m(mission: Mission, matches: tuple[Match, ...]) -> float:
    """Of the legs that were to be driven by then."""
    visited = [match.stop for match in matches if match.stop is not None]
    if not visited:
        return 0.0
    whole = max(visited) + 1 == len(mission.stops)
    legs = legs_of(mission)[: None if whole else max(visited) + 1]
    return sum(float(np.hypot(*np.diff(np.array(leg), axis=0).T).sum()) for leg in legs if len(leg) > 1)


def lost_times(replay: Replay) -> tuple[Lost, ...]:
    """Where the run was slower or faster than planned by a second or more, the slowest first."""
    found = [item for item in _lost(replay) if abs(item.seconds) >= 1.0]
    return tuple(sorted(found, key=lambda item: -item.seconds))


def _lost(replay: Replay) -> Iterator[Lost]:
    """Legs between stops visited one after another, halts at stops, halts elsewhere, visits once more."""
    mission = replay.mission
    planned = {item.stop: item.planned_s for item in replay.comparison.stops}
    before: Match | None = None
    elsewhere = 0.0
    for match in replay.matches:
        halt = match.standing
        if match.stop is None:
            yield Lost(f"halt {halt.seconds:.0f} s at ({halt.x:.2f}, {halt.y:.2f}), at no stop", halt.seconds)
            elsewhere += halt.seconds
            continue
        stop = mission.stops[match.stop]
        stay = stop.settle_s + stop.scan.duration_s
        if match.how != "visit":
            yield Lost(f"once more at {stop.id}", halt.seconds)
        else:
            yield Lost(f"standing at {stop.id}", halt.seconds - stay)
            yield from _leg(before, match, mission, planned, elsewhere)
        before, elsewhere = match, 0.0


def _leg(
    before: Match | None, match: Match, mission: Mission, planned: dict[str, float | None], elsewhere: float
) -> Iterator[Lost]:
    """Driving from the stop before, without what was stood on the way."""
    if before is None or before.stop is None or match.stop is None or match.stop != before.stop + 1:
        return
    stop, last = mission.stops[match.stop], mission.stops[before.stop]
    arrive, arrived = planned[stop.id], planned[last.id]
    if arrive is None or arrived is None:
        return
    should = arrive - arrived - last.settle_s - last.scan.duration_s
    took = (match.standing.begin_ns - before.standing.end_ns) / 1e9 - elsewhere
    yield Lost(f"driving from {last.id} to {stop.id}", took - should)
