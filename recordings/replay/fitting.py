"""Turns and shifts a log's frame so that its halts come to lie on the planned stops, where that is unique."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import FloatArray
from stopgo.recordings.replay.matching import matched, reaches
from stopgo.recordings.replay.standstills import Standing

LOOK_AHEAD = 4
"""Stops up to this many places apart are tried as pairs: between them some may be skipped."""
STRETCH, SLACK_M = 0.03, 0.4
"""By so much the distance of two halts may differ from that of their stops: drift, and where robots stand."""
NEAREST_M = 1.0
"""Stops nearer to each other than this tell no direction."""
TRIED = 60
"""Of all placings found, those on which most halts lie on stops are looked at closely."""
APART_M = 1.0
"""Two placings are different if a stop lies farther apart by them than this."""
RIVAL = 0.8
"""A different placing that explains more than this share of what the best does makes the fit ambiguous."""
LEAST_PAIRS = 3
ROUNDS = 10
HUBER_M = 0.15
"""From this distance on a pair pulls no harder."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A turn, then a shift, from the log's frame to the mission's."""

    heading: float
    x: float
    y: float
    pairs: int
    rms_m: float
    max_m: float

    def placed(self, xy: FloatArray) -> FloatArray:
        """Points (n, 2) in the mission's frame."""
        return xy @ turning(self.heading).T + (self.x, self.y)


def turning(heading: float) -> FloatArray:
    """The matrix (2, 2) that turns by `heading`."""
    cos, sin = np.cos(heading), np.sin(heading)
    return np.array([[cos, -sin], [sin, cos]])


def fitted(halts: Sequence[Standing], mission: Mission) -> Fit:
    """The placing by which the halts lie on the stops best, in the mission's order.

    Raises
    ------
    NegativeResult
        When too few halts lie on stops, or another placing does nearly as well.
    """
    stops = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    places = np.array([halt.xy for halt in halts]).reshape(-1, 2)
    if min(len(stops), len(places)) < LEAST_PAIRS:
        raise NegativeResult(
            f"--align stops: {len(places)} halts and {len(stops)} stops are too few to tell how they belong "
            f"together ({LEAST_PAIRS} are needed); give --map X,Y,HEADING or --align first"
        )
    tried = [_refined(guess, halts, mission) for guess in _promising(places, stops, mission)]
    found = sorted((item for item in tried if item is not None), key=lambda item: -item[0])
    if not found or found[0][1].pairs < LEAST_PAIRS:
        raise NegativeResult(
            f"--align stops: no placing brings {LEAST_PAIRS} of the {len(places)} halts onto stops in the "
            "mission's order; is it this mission's log? else give --map X,Y,HEADING"
        )
    score, best = found[0]
    for other_score, other in found[1:]:
        if other_score > RIVAL * score and _apart(best, other, places) > APART_M:
            raise NegativeResult(
                f"--align stops: {best.pairs} halts fit the stops in one way and {other.pairs} in quite "
                "another, and nothing tells which is right; give --map X,Y,HEADING or --align first"
            )
    return best


def _promising(places: FloatArray, stops: FloatArray, mission: Mission) -> list[Fit]:
    """Placings by pairs of halts on pairs of stops, those first that bring most halts near stops."""
    guesses = list(_guesses(places, stops))
    reach = reaches(mission)
    near = [_near(guess.placed(places), stops, reach) for guess in guesses]
    order = np.argsort(-np.array(near), kind="stable")
    chosen: list[Fit] = []
    for index in order:
        if len(chosen) == TRIED:
            break
        if all(_apart(guesses[index], known, places) > APART_M / 2 for known in chosen):
            chosen.append(guesses[index])
    return chosen


def _near(placed: FloatArray, stops: FloatArray, reach: FloatArray) -> float:
    """How many stops have a halt near, each counting for more the nearer it is."""
    share = np.hypot(*(placed[:, None] - stops[None]).transpose(2, 0, 1)) / reach
    return float(np.clip(1.0 - share.min(axis=0) ** 2, 0.0, 1.0).sum())


def _guesses(places: FloatArray, stops: FloatArray) -> Iterator[Fit]:
    ahead = max(LOOK_AHEAD, len(places) // 8)
    for i in range(len(stops)):
        for j in range(i + 1, min(i + 1 + LOOK_AHEAD, len(stops))):
            planned = stops[j] - stops[i]
            length = float(np.hypot(*planned))
            if length < NEAREST_M:
                continue
            for k in range(len(places)):
                driven = places[k + 1 : k + 1 + ahead] - places[k]
                fits = np.abs(np.hypot(*driven.T) - length) <= SLACK_M + STRETCH * length
                for step in driven[fits]:
                    turn = float(np.arctan2(planned[1], planned[0]) - np.arctan2(step[1], step[0]))
                    middle = (stops[i] + stops[j]) / 2 - turning(turn) @ (places[k] + step / 2)
                    yield Fit(turn, float(middle[0]), float(middle[1]), 2, 0.0, 0.0)


def _refined(guess: Fit, halts: Sequence[Standing], mission: Mission) -> tuple[float, Fit] | None:
    """The placing after halts were matched and fitted, again and again; with what it explains."""
    stops = np.array([(stop.x, stop.y) for stop in mission.stops])
    places = np.array([halt.xy for halt in halts])
    fit = guess
    known: tuple[tuple[int, int], ...] = ()
    for _ in range(ROUNDS):
        moved = [_moved(halt, fit) for halt in halts]
        matches = matched(moved, mission)
        pairs = tuple((k, match.stop) for k, match in enumerate(matches) if match.stop is not None)
        if len(pairs) < 2:
            return None
        fit = _least_squares(places[[k for k, _ in pairs]], stops[[s for _, s in pairs]], fit)
        if pairs == known:
            break
        known = pairs
    visited = {match.stop: match.away_m for match in matches if match.stop is not None}
    reach = reaches(mission)
    return sum(max(0.0, 1 - (away / reach[stop]) ** 2) for stop, away in visited.items()), fit


def _moved(halt: Standing, fit: Fit) -> Standing:
    x, y = fit.placed(np.array([halt.xy]))[0]
    return Standing(halt.begin_ns, halt.end_ns, float(x), float(y), halt.heading + fit.heading, halt.moved_m)


def _least_squares(places: FloatArray, stops: FloatArray, fit: Fit) -> Fit:
    """Turn and shift of least squared distances; those beyond HUBER_M weigh less (Umeyama 1991)."""
    for _ in range(ROUNDS):
        away = np.hypot(*(fit.placed(places) - stops).T)
        weight = np.where(away > HUBER_M, HUBER_M / np.maximum(away, 1e-12), 1.0)
        middle, target = (np.average(points, axis=0, weights=weight) for points in (places, stops))
        a, b = places - middle, stops - target
        turn = float(np.arctan2(
            (weight * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])).sum(), (weight * (a * b).sum(axis=1)).sum()
        ))  # fmt: skip
        x, y = target - turning(turn) @ middle
        fit = Fit(turn, float(x), float(y), len(places), 0.0, 0.0)
    away = np.hypot(*(fit.placed(places) - stops).T)
    rms, largest = float(np.sqrt((away**2).mean())), float(away.max())
    return Fit(
        float(np.remainder(fit.heading + np.pi, 2 * np.pi) - np.pi), fit.x, fit.y, len(places), rms, largest
    )


def _apart(one: Fit, other: Fit, places: FloatArray) -> float:
    """How far a halt lies apart by two placings, at most."""
    return float(np.hypot(*(one.placed(places) - other.placed(places)).T).max())
