"""Which halt was at which planned stop: in the order of the mission, with stops skipped, repeated and added.

Of all ways to read the halts as a drive along the mission the one of least cost is taken (dynamic
programming). A halt costs its squared distance from its stop, in shares of the reach; one that belongs to no
stop, one at a stop that was visited before, and each stop that is left out cost what is said below.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import FloatArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.replay.standstills import Standing

HaltKind = Literal["visit", "again", "back", "extra"]
EXTRA, SKIP, PASSED, AGAIN, BACK = 1.0, 0.4, 0.1, 0.05, 0.6
"""Of a halt at no stop, of each stop left out, of each left out that the robot passed, of one more halt at
the same stop, of going back to one."""
REACH_M, LEAST_REACH_M = 1.0, 0.3
"""A halt is at a stop only if it is nearer; where stops stand closely, half their distance counts."""

ENOUGH = 0.9
"""Of a scan's duration: who stood that long may have scanned."""
SLACK_S = 1.0
"""What is missing at a halt's ends because a robot brakes and starts."""
LEAST_VISITS, NEIGHBOURS = 4, 4
"""Drift is told from so many visits at least, and at each halt from so many of them."""
AGAIN_REACH_M = 0.25
"""A halt at a stop that was visited before must be nearer than this."""
PASSES = 8
MOST_POSES = 50_000
"""Of longer tracks every so many-th pose is looked at to see which stops were passed."""


@dataclass(frozen=True)
class Match:
    """What one halt was."""

    standing: Standing
    how: HaltKind
    stop: int | None
    """Index into the mission's stops; None of an extra halt."""
    away_m: float
    """Distance from that stop, or from the nearest one."""
    near: int
    """Index of the nearest stop."""


def matched(halts: Sequence[Standing], mission: Mission, track: Track | None = None) -> tuple[Match, ...]:
    """What each halt was, in order of time.

    Where visits lie off their stops all to one side, as when odometry has drifted, halts are matched once
    more without that; how far they were off stays as it was measured. Stops near which the `track` came
    are passed by more lightly than those where the robot never was.
    """
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    if not len(halts) or not len(stops):
        return ()
    places, reach = np.array([halt.xy for halt in halts]), reaches(mission)
    skips = _skips(halts, stops, reach, track)
    drift = np.zeros(places.shape)
    readings: list[tuple[HaltKind, int | None]] = []
    for _ in range(PASSES):
        before = readings
        more = _costs_again(before, places, places - drift, stops)
        readings = _least(_costs(places - drift, stops, reach), more, skips)
        if readings == before:
            break
        drift = _drift(readings, places, stops)
    away = np.hypot(*(places[:, None] - stops[None]).transpose(2, 0, 1))
    return tuple(
        Match(halt, how, stop, float(row[row.argmin() if stop is None else stop]), int(row.argmin()))
        for halt, (how, stop), row in zip(halts, readings, away, strict=True)
    )


def _skips(
    halts: Sequence[Standing], stops: FloatArray, reach: FloatArray, track: Track | None
) -> FloatArray:
    """What it costs to have passed by each stop until each halt (halts, stops)."""
    if track is None:
        return np.full((len(halts), len(stops)), SKIP)
    thin = slice(None, None, max(1, len(track) // MOST_POSES))
    xy, ns = track.xy[thin], track.ns[thin]
    first = np.full(len(stops), np.iinfo(np.int64).max)
    for k, place in enumerate(stops):
        near = np.flatnonzero(np.hypot(*(xy - place).T) <= reach[k])
        first[k] = ns[near[0]] if len(near) else first[k]
    begins = np.array([halt.begin_ns for halt in halts])
    return np.where(first[None, :] < begins[:, None], PASSED, SKIP)


def long_enough(halt: Standing, stop: Stop) -> bool:
    """Whether a robot that stood so long may have scanned."""
    return halt.seconds >= ENOUGH * (stop.settle_s + stop.scan.duration_s) - SLACK_S


def _costs(places: FloatArray, stops: FloatArray, reach: FloatArray) -> FloatArray:
    """Squared distance of each halt from each stop in shares of the reach; infinite beyond it."""
    share = np.hypot(*(places[:, None] - stops[None]).transpose(2, 0, 1)) / reach
    return np.where(share <= 1.0, share**2, np.inf)


def _costs_again(
    readings: Sequence[tuple[HaltKind, int | None]],
    places: FloatArray,
    driftless: FloatArray,
    stops: FloatArray,
) -> FloatArray:
    """What it costs that a halt is one more at a stop: near the stop, or near where the robot stood there."""
    costs = _costs(driftless, stops, np.full(len(stops), AGAIN_REACH_M))
    for k, (how, stop) in enumerate(readings):
        if how == "visit" and stop is not None:
            beside = _costs(places, places[k : k + 1], np.array([AGAIN_REACH_M]))[:, 0]
            costs[:, stop] = np.minimum(costs[:, stop], beside)
    return costs


def _drift(
    readings: Sequence[tuple[HaltKind, int | None]], places: FloatArray, stops: FloatArray
) -> FloatArray:
    """HaltKind far the visits around each halt lie off their stops, itself left out (n, 2)."""
    visits = np.array([k for k, (how, _) in enumerate(readings) if how == "visit"], np.int64)
    drift = np.zeros(places.shape)
    if len(visits) < LEAST_VISITS:
        return drift
    off = np.array([places[k] - stops[readings[k][1] or 0] for k in visits])
    for k in range(len(places)):
        others = np.flatnonzero(visits != k)
        near = others[np.argsort(np.abs(visits[others] - k), kind="stable")[:NEIGHBOURS]]
        drift[k] = np.median(off[near], axis=0)
    return drift


def reaches(mission: Mission) -> FloatArray:
    """HaltKind far from each stop a halt may be to be at it (n,), metres."""
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    apart = np.hypot(*(stops[:, None] - stops[None]).transpose(2, 0, 1))
    apart[apart < LEAST_REACH_M] = np.inf  # stops at one place are told apart by their order alone
    return np.clip(apart.min(axis=1) / 2, LEAST_REACH_M, REACH_M)


def _least(visits: FloatArray, more: FloatArray, skips: FloatArray) -> list[tuple[HaltKind, int | None]]:
    """The reading of least cost, by what it costs that a halt is a first visit of a stop, is one more, and
    that the stop is passed by until then, each (halts, stops).

    `best[k]` is the least cost of the halts so far, `k` stops of the mission being behind, the last of
    them visited (0: none yet).
    """
    count = visits.shape[1]
    best = np.full(count + 1, np.inf)
    best[0] = 0.0
    came: list[tuple[np.ndarray, ...]] = []
    for row, nearer, skip in zip(visits, more, skips, strict=True):
        passed = np.concatenate([[0.0], np.cumsum(skip)])[:-1]
        ahead, source = _running_least(best[:-1] - passed)
        visit = ahead + passed + row
        again = np.concatenate([[np.inf], best[1:] + AGAIN + nearer])
        earlier, back_to = _running_least(np.concatenate([[np.inf, np.inf], nearer[:-1]]))
        back = best + BACK + earlier
        options = np.stack([best + EXTRA, np.concatenate([[np.inf], visit]), again, back])
        choice = options.argmin(axis=0)
        came.append((choice, np.concatenate([[0], source]), back_to - 2))
        best = options.min(axis=0)
    return _traced(came, int((best - 1e-9 * np.arange(count + 1)).argmin()))


def _running_least(values: FloatArray) -> tuple[FloatArray, np.ndarray]:
    """The least value so far, and where it stands, the last of equals."""
    least = np.minimum.accumulate(values)
    at = np.where(values <= least, np.arange(len(values)), 0)
    return least, np.maximum.accumulate(at)


def _traced(came: list[tuple[np.ndarray, ...]], behind: int) -> list[tuple[HaltKind, int | None]]:
    """The choices from the last halt back to the first, then in order."""
    readings: list[tuple[HaltKind, int | None]] = []
    for choice, source, back_to in reversed(came):
        how = HOWS[int(choice[behind])]
        stop = {"extra": None, "back": int(back_to[behind])}.get(how, behind - 1)
        readings.append((how, stop))
        behind = int(source[behind]) if how == "visit" else behind
    return readings[::-1]


HOWS: tuple[HaltKind, ...] = ("extra", "visit", "again", "back")
