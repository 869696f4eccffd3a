"""Matching of standstills to planned stops, in the mission's order, with skipped, repeated and extra ones.

Of all readings of the standstills as a drive along the mission, the one of least cost is chosen (dynamic
programming). A standstill costs its squared distance from its stop, as a fraction of the reach. Extra
standstills, repeated visits and skipped stops have the costs below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.replay.standstills import Standstill

VisitKind = Literal["visit", "again", "back", "extra"]
EXTRA, SKIP, PASSED, AGAIN, BACK = 1.0, 0.4, 0.1, 0.05, 0.6
"""Costs of: an extra standstill, a skipped stop, a skipped stop on the path, a repetition, a return."""
REACH_M, LEAST_REACH_M = 1.0, 0.3
"""Largest distance of a standstill from its stop, and its least value where stops are close together."""

ENOUGH = 0.9
"""Fraction of a scan's duration from which on a robot may have scanned."""
SLACK_S = 1.0
"""Time missing at a standstill's ends, because the robot brakes and starts."""
LEAST_VISITS, NEIGHBOURS = 4, 4
"""Number of visits needed to estimate drift, and of neighbours used at each standstill."""
AGAIN_REACH_M = 0.25
"""Largest distance of a repeated standstill from a visited stop."""
PASSES = 8
MOST_POSES = 50_000
"""Limit of poses examined for passed stops; of longer tracks, only every n-th pose is examined."""


@dataclass(frozen=True)
class Match:
    """Meaning of one standstill."""

    standstill: Standstill
    how: VisitKind
    stop: int | None
    """Index into the mission's stops; None for an extra standstill."""
    away_m: float
    """Distance from that stop, or from the nearest one."""
    near: int
    """Index of the nearest stop."""


def matched(
    standstills: Sequence[Standstill], mission: Mission, track: Track | None = None
) -> tuple[Match, ...]:
    """Return the meaning of each standstill, in order of time.

    If visits lie off their stops all to one side, as when odometry has drifted, matching is repeated
    without that drift; the reported distances still contain it. A skipped stop on the path of the `track`
    costs less.
    """
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    if not len(standstills) or not len(stops):
        return ()
    positions, reach = np.array([standstill.xy for standstill in standstills]), reaches(mission)
    skips = _skips(standstills, stops, reach, track)
    drift = np.zeros(positions.shape)
    readings: list[tuple[VisitKind, int | None]] = []
    for _ in range(PASSES):
        before = readings
        more = _costs_again(before, positions, positions - drift, stops)
        readings = _least(_costs(positions - drift, stops, reach), more, skips)
        if readings == before:
            break
        drift = _drift(readings, positions, stops)
    away = np.hypot(*(positions[:, None] - stops[None]).transpose(2, 0, 1))
    readings = _with_late_visits(readings, away, standstills, mission)
    return tuple(
        Match(standstill, how, stop, float(row[row.argmin() if stop is None else stop]), int(row.argmin()))
        for standstill, (how, stop), row in zip(standstills, readings, away, strict=True)
    )


def _with_late_visits(
    readings: list[tuple[VisitKind, int | None]],
    away: FloatArray,
    standstills: Sequence[Standstill],
    mission: Mission,
) -> list[tuple[VisitKind, int | None]]:
    """Return the readings in which extra standstills on stops that were not visited are their visits.

    A run may take its stops in any order; `away` are the distances (standstills, stops).
    """
    found = list(readings)
    visited = {stop for _, stop in found}
    for k, (how, _) in enumerate(found):
        near = int(away[k].argmin())
        stop = mission.stops[near]
        there = away[k, near] <= max(AGAIN_REACH_M, stop.tolerance_m) and long_enough(standstills[k], stop)
        if how == "extra" and there and near not in visited:
            found[k] = ("visit", near)
            visited.add(near)
    return found


def _skips(
    standstills: Sequence[Standstill], stops: FloatArray, reach: FloatArray, track: Track | None
) -> FloatArray:
    """Return the cost of having skipped each stop before each standstill (standstills, stops)."""
    if track is None:
        return np.full((len(standstills), len(stops)), SKIP)
    thin = slice(None, None, max(1, len(track) // MOST_POSES))
    xy, ns = track.xy[thin], track.ns[thin]
    first = np.full(len(stops), np.iinfo(np.int64).max)
    for k, position in enumerate(stops):
        near = np.flatnonzero(np.hypot(*(xy - position).T) <= reach[k])
        first[k] = ns[near[0]] if len(near) else first[k]
    begins = np.array([standstill.begin_ns for standstill in standstills])
    return np.where(first[None, :] < begins[:, None], PASSED, SKIP)


def long_enough(standstill: Standstill, stop: Stop) -> bool:
    """True if a standstill was long enough for a scan."""
    return standstill.seconds >= least_stay_s(stop)


def least_stay_s(stop: Stop) -> float:
    """Return the shortest standstill in which a scan may have been made there."""
    return ENOUGH * (stop.settle_s + stop.scan.duration_s) - SLACK_S


def _costs(positions: FloatArray, stops: FloatArray, reach: FloatArray) -> FloatArray:
    """Squared distance of each standstill from each stop, in fractions of the reach; infinite beyond it."""
    fraction = np.hypot(*(positions[:, None] - stops[None]).transpose(2, 0, 1)) / reach
    return np.where(fraction <= 1.0, fraction**2, np.inf)


def _costs_again(
    readings: Sequence[tuple[VisitKind, int | None]],
    positions: FloatArray,
    driftless: FloatArray,
    stops: FloatArray,
) -> FloatArray:
    """Return the cost of a repeated standstill: near the stop, or near an earlier standstill there."""
    costs = _costs(driftless, stops, np.full(len(stops), AGAIN_REACH_M))
    for k, (how, stop) in enumerate(readings):
        if how == "visit" and stop is not None:
            repeat = _costs(positions, positions[k : k + 1], np.array([AGAIN_REACH_M]))[:, 0]
            costs[:, stop] = np.minimum(costs[:, stop], repeat)
    return costs


def _drift(
    readings: Sequence[tuple[VisitKind, int | None]], positions: FloatArray, stops: FloatArray
) -> FloatArray:
    """Return the offset of the visits around each standstill from their stops, without its own (n, 2)."""
    visits = np.array([k for k, (how, _) in enumerate(readings) if how == "visit"], np.int64)
    drift = np.zeros(positions.shape)
    if len(visits) < LEAST_VISITS:
        return drift
    offsets = np.array([positions[k] - stops[readings[k][1] or 0] for k in visits])
    for k in range(len(positions)):
        others = np.flatnonzero(visits != k)
        near = others[np.argsort(np.abs(visits[others] - k), kind="stable")[:NEIGHBOURS]]
        drift[k] = np.median(offsets[near], axis=0)
    return drift


def reaches(mission: Mission) -> FloatArray:
    """Return the largest distance of a standstill from each stop (n,), metres."""
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    apart = np.hypot(*(stops[:, None] - stops[None]).transpose(2, 0, 1))
    apart[apart < LEAST_REACH_M] = np.inf  # stops at one position differ only by their order
    return np.clip(apart.min(axis=1) / 2, LEAST_REACH_M, REACH_M)


def _least(visits: FloatArray, more: FloatArray, skips: FloatArray) -> list[tuple[VisitKind, int | None]]:
    """Return the reading of least cost.

    The arguments are costs, each (standstills, stops): that a standstill is the first visit of a stop, that
    it is a repetition, and that the stop is skipped before it. `best[k]` is the least cost of the standstills
    so far if `k` stops of the mission are done and the last of them was visited (0: none yet).
    """
    count = visits.shape[1]
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    history: list[tuple[np.ndarray, ...]] = []
    for row, nearer, skip in zip(visits, more, skips, strict=True):
        passed = np.concatenate([[0.0], np.cumsum(skip)])[:-1]
        ahead, source = _running_least(best[:-1] - passed)
        visit = ahead + passed + row
        again = np.concatenate([[np.inf], best[1:] + AGAIN + nearer])
        earlier, back_to = _running_least(np.concatenate([[np.inf, np.inf], nearer[:-1]]))
        back = best + BACK + earlier
        options = np.stack([best + EXTRA, np.concatenate([[np.inf], visit]), again, back])
        choice = options.argmin(axis=0)
        history.append((choice, np.concatenate([[0], source]), back_to - 2))
        best = options.min(axis=0)
    return _trace_back(history, int((best - 1e-9 * np.arange(count + 1)).argmin()))


def _running_least(values: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """Return the least value so far, and its index, the last of equal values."""
    least = np.minimum.accumulate(values)
    at = np.where(values <= least, np.arange(len(values)), 0)
    return least, np.maximum.accumulate(at)


def _trace_back(history: list[tuple[np.ndarray, ...]], done: int) -> list[tuple[VisitKind, int | None]]:
    """Return the choices in order; they are traced from the last standstill back to the first."""
    readings: list[tuple[VisitKind, int | None]] = []
    for choice, source, back_to in reversed(history):
        how = KINDS[int(choice[done])]
        stop = {"extra": None, "back": int(back_to[done])}.get(how, done - 1)
        readings.append((how, stop))
        done = int(source[done]) if how == "visit" else done
    return readings[::-1]


KINDS: tuple[VisitKind, ...] = ("extra", "visit", "again", "back")
