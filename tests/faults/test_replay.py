"""Seeded runs with slip, noise, skipped, repeated and extra stops, lost messages and wrong clocks."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.errors import NegativeResult
from stopgo.recordings.replay.fitting import fitted
from stopgo.recordings.replay.matching import Match, long_enough, matched
from stopgo.recordings.replay.standstills import find_standstills
from tests.faults.sizes import size
from tests.recordings.replay.driving import BEGIN_NS, Drive, Odd, Senses, driven, logged, wandering

RUNS = size(short=2, full=240)


@dataclass(frozen=True)
class Run:
    """A simulated run, its truth, and how it was logged."""

    seed: int
    mission: Mission
    drive: Drive
    senses: Senses


def run_of(seed: int) -> Run:
    """With everything that may go wrong, each in a third of the runs or so."""
    rng = np.random.default_rng(seed)
    mission = wandering(seed, stops=int(rng.integers(5, 14)))
    count = len(mission.stops)

    def some() -> frozenset[int]:
        return frozenset(np.flatnonzero(rng.random(count) < 0.12).tolist())

    odd = Odd(some(), some(), some(), beside_m=0.03)
    senses = Senses(
        noise_m=float(rng.choice([0.0, 0.02, 0.05])),
        noise_rad=math.radians(float(rng.choice([0.0, 2.0]))),
        slip=float(rng.choice([0.0, 0.002, 0.005])),
        dropped=float(rng.choice([0.0, 0.1, 0.4])),
        clock_offset_s=float(rng.uniform(-100, 100)),
        clock_drift=float(rng.choice([0.0, 1e-4])),
    )
    return Run(seed, mission, driven(mission, odd, seed), senses)


def truth_of(run: Run, match: Match) -> int | None:
    """At which stop the robot really was during a standstill; -1 where it was not stationary at all."""
    middle = ((match.standstill.begin_ns + match.standstill.end_ns) / 2 - BEGIN_NS) / 1e9
    seconds = (middle - run.senses.clock_offset_s) / (1 + run.senses.clock_drift)
    for halt in run.drive.halts:
        if halt.begin_s - 0.5 <= seconds <= halt.end_s + 0.5:
            return halt.stop
    return -1


def counts_of(run: Run, matches: tuple[Match, ...]) -> Counter[str]:
    """Numbers of standstills reported rightly, wrongly called a stop, or wrongly not called one."""
    found: Counter[str] = Counter()
    for match in matches:
        true = truth_of(run, match)
        called = match.stop is not None and long_enough(match.standstill, run.mission.stops[match.stop])
        found["right" if true == match.stop else "false" if called else "unsure"] += 1
    found["unsure"] += max(0, len(run.drive.halts) - len(matches))
    return found


def test_standstills_are_matched_right_and_never_falsely() -> None:
    total: Counter[str] = Counter()
    for seed in range(RUNS):
        run = run_of(seed)
        track = logged(run.drive, run.senses, seed)
        total += counts_of(run, matched(find_standstills(track, speed=1.0), run.mission, track))
    assert total["false"] == 0
    assert total["right"] >= 0.99 * sum(total.values()), total


def test_offsets_without_noise_are_true_to_a_centimetre() -> None:
    for seed in range(RUNS):
        run = run_of(seed)
        halts = find_standstills(logged(run.drive), speed=1.0)
        for found, halt in zip(halts, run.drive.halts, strict=True):
            assert math.dist(found.xy, (halt.x, halt.y)) < 0.01


def test_a_fit_to_the_stops_is_right_or_refused() -> None:
    """Laid by its standstills alone, from any frame: no standstill is then called another stop's."""
    total: Counter[str] = Counter()
    for seed in range(RUNS):
        run = run_of(seed)
        rng = np.random.default_rng(seed + 1)
        senses = Senses(
            noise_m=0.05, noise_rad=0.03, slip=run.senses.slip, turned=float(rng.uniform(-3, 3)),
            shifted=(float(rng.uniform(-50, 50)), float(rng.uniform(-50, 50))),
        )  # fmt: skip
        halts = find_standstills(logged(run.drive, senses, seed), speed=1.0)
        try:
            fit = fitted(halts, run.mission)
        except NegativeResult:
            total["refused"] += 1
            continue
        truth = np.array([(halt.x, halt.y) for halt in run.drive.halts if halt.stop is not None])
        told = np.array([halt.xy for halt in halts])
        placed = fit.placed(told)
        away = np.hypot(*(truth[:, None] - placed[None]).transpose(2, 0, 1)).min(axis=1)
        total["right" if np.median(away) < 0.3 else "wrong"] += 1
    assert total["wrong"] == 0
    assert total["right"] >= 0.9 * RUNS, total
