"""Fit of a log's frame to the mission: its standstills shall lie on stops, by a unique placing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from stopgo.mission.console.table import counted
from stopgo.mission.document import Mission
from stopgo.mission.errors import Undecided
from stopgo.mission.frames.rigid_fit import least_squares
from stopgo.mission.frames.transform import Transform
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.replay.matching import matched, reaches
from stopgo.recordings.replay.standstills import Standstill

LOOK_AHEAD = 4
"""Stops up to this many apart are tried as pairs: stops between them may be skipped."""
STRETCH, SLACK_M = 0.03, 0.4
"""Tolerance for the distance of two standstills against their stops: drift, and stopping accuracy."""
NEAREST_M = 1.0
"""Stops nearer to each other than this define no direction."""
TRIED = 60
"""Limit of placings that are refined: those with most standstills on stops."""
APART_M = 1.0
"""Two placings differ if a standstill lies farther apart by them than this."""
RIVAL = 0.8
"""Fraction of the best score above which a different placing makes the fit ambiguous."""
LEAST_PAIRS = 3
ROUNDS = 10
HUBER_M = 0.15
"""Distance from which on a pair has no more weight."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Transform from the log's frame to the mission's, and the residuals of its pairs."""

    transform: Transform
    pairs: int = 2
    rms_m: float = 0.0
    max_m: float = 0.0

    def placed(self, xy: FloatArray) -> FloatArray:
        """Return points (n, 2) in the mission's frame."""
        return self.transform.points(xy)


def fitted(standstills: Sequence[Standstill], mission: Mission) -> Fit:
    """Return the placing by which the standstills lie best on the stops, in the mission's order.

    Raises
    ------
    Undecided
        When too few standstills lie on stops, or another placing fits nearly as well.
    """
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    positions = np.array([standstill.xy for standstill in standstills]).reshape(-1, 2)
    if min(len(stops), len(positions)) < LEAST_PAIRS:
        raise Undecided(
            f"--align stops: {counted(len(positions), 'standstill')} and {counted(len(stops), 'stop')} "
            "are too few to match "
            f"({LEAST_PAIRS} of each are needed); give --map X,Y,HEADING or --align first"
        )
    tried = [_refined(guess, standstills, mission) for guess in _promising(positions, stops, mission)]
    found = sorted((item for item in tried if item is not None), key=lambda item: -item[0])
    if not found or found[0][1].pairs < LEAST_PAIRS:
        raise Undecided(
            f"--align stops: no transform brings {LEAST_PAIRS} of the {len(positions)} standstills onto "
            "stops in the mission's order; check that the log is of this mission, or give --map X,Y,HEADING"
        )
    score, best = found[0]
    for other_score, other in found[1:]:
        if other_score > RIVAL * score and _apart(best, other, positions) > APART_M:
            raise Undecided(
                f"--align stops: ambiguous: {best.pairs} standstills fit the stops by one placing, "
                f"{other.pairs} by another; give --map X,Y,HEADING or --align first"
            )
    return best


def _promising(positions: FloatArray, stops: FloatArray, mission: Mission) -> list[Fit]:
    """Return placings by pairs of standstills on pairs of stops, the best first."""
    guesses = list(_guesses(positions, stops))
    reach = reaches(mission)
    near = [_near(guess.placed(positions), stops, reach) for guess in guesses]
    order = np.argsort(-np.array(near), kind="stable")
    chosen: list[Fit] = []
    for index in order:
        if len(chosen) == TRIED:
            break
        if all(_apart(guesses[index], known, positions) > APART_M / 2 for known in chosen):
            chosen.append(guesses[index])
    return chosen


def _near(placed: FloatArray, stops: FloatArray, reach: FloatArray) -> float:
    """Return a score: the number of stops with a standstill near, weighted by nearness."""
    fraction = np.hypot(*(placed[:, None] - stops[None]).transpose(2, 0, 1)) / reach
    return float(np.clip(1.0 - fraction.min(axis=0) ** 2, 0.0, 1.0).sum())


def _guesses(positions: FloatArray, stops: FloatArray) -> Iterator[Fit]:
    ahead = max(LOOK_AHEAD, len(positions) // 8)
    for i in range(len(stops)):
        for j in range(i + 1, min(i + 1 + LOOK_AHEAD, len(stops))):
            planned = stops[j] - stops[i]
            length = float(np.hypot(*planned))
            if length < NEAREST_M:
                continue
            for k in range(len(positions)):
                others = [positions[max(0, k - ahead) : k], positions[k + 1 : k + 1 + ahead]]
                driven = np.concatenate(others) - positions[k]
                fits = np.abs(np.hypot(*driven.T) - length) <= SLACK_M + STRETCH * length
                for step in driven[fits]:
                    turn = float(np.arctan2(planned[1], planned[0]) - np.arctan2(step[1], step[0]))
                    driven_middle = tuple((positions[k] + step / 2).tolist())
                    middle = tuple(((stops[i] + stops[j]) / 2).tolist())
                    yield Fit(Transform.bringing(driven_middle, middle, turn))


def _refined(guess: Fit, standstills: Sequence[Standstill], mission: Mission) -> tuple[float, Fit] | None:
    """Return the placing after repeated matching and fitting, with its score."""
    stops = np.array([(stop.x, stop.y) for stop in mission.stops])
    positions = np.array([standstill.xy for standstill in standstills])
    fit = guess
    known: tuple[tuple[int, int], ...] = ()
    for _ in range(ROUNDS):
        moved = [_moved(standstill, fit) for standstill in standstills]
        matches = matched(moved, mission)
        pairs = tuple((k, match.stop) for k, match in enumerate(matches) if match.stop is not None)
        if len(pairs) < 2:
            return None
        fit = _least_squares(positions[[k for k, _ in pairs]], stops[[s for _, s in pairs]], fit)
        if pairs == known:
            break
        known = pairs
    visited = {match.stop: match.away_m for match in matches if match.stop is not None}
    reach = reaches(mission)
    return sum(max(0.0, 1 - (away / reach[stop]) ** 2) for stop, away in visited.items()), fit


def _moved(standstill: Standstill, fit: Fit) -> Standstill:
    x, y = fit.transform.point(standstill.xy)
    return replace(standstill, x=x, y=y, heading=standstill.heading + fit.transform.heading)


def _least_squares(positions: FloatArray, stops: FloatArray, fit: Fit) -> Fit:
    """Return the rotation and shift of least squared distances; outliers weigh less."""
    transform = fit.transform
    for _ in range(ROUNDS):
        away = np.hypot(*(transform.points(positions) - stops).T)
        weight = np.where(away > HUBER_M, HUBER_M / np.maximum(away, 1e-12), 1.0)
        transform = least_squares(positions, stops, weight)
    away = np.hypot(*(transform.points(positions) - stops).T)
    return Fit(transform, len(positions), float(np.sqrt((away**2).mean())), float(away.max()))


def _apart(one: Fit, other: Fit, positions: FloatArray) -> float:
    """Return the greatest distance of a standstill between two placings."""
    return float(np.hypot(*(one.placed(positions) - other.placed(positions)).T).max())
