"""Selection -> selection whose scans are as accurate as required, by more stops that stiffen the network.

Each step adds the candidate that lowers the greatest predicted error most. Tried are those that register
with the scan of this error, and with at least one more scan. The bound stays: more stops only add demands.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from stopgo.mission.geometry import FloatArray, frozen
from stopgo.mission.stages import Selection
from stopgo.mission.stages.network import CONFIDENCE, noise_factor
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.overlap import overlaps_of, registers
from stopgo.planner.overlap.control import seen_control
from stopgo.planner.overlap.network_error import information_of, network_errors, worst_errors
from stopgo.planner.selection import cover_problem, coverage_steps

MOST_TRIED = 40
"""Candidates tried for each other stop, those that register with most scans."""
LEAST_GAIN = 0.01
"""Fraction by which a other stop must lower the greatest error."""


def accurate(selection: Selection) -> Selection:
    """The selection with other stops until every scan is accurate enough, or none helps."""
    asked = selection.settings.accuracy
    if asked is None or not selection.settings.registers:
        return selection
    network, rows = _RowNetwork(selection), selection.chosen.tolist()
    worst = network.worst(rows)
    while worst[0] * CONFIDENCE > asked / 1000:
        tried = [(network.worst([*rows, row])[0], row) for row in network.near(rows, worst[1])]
        least, row = min(tried, default=(np.inf, -1))
        if least > worst[0] * (1 - LEAST_GAIN):
            break
        rows.append(row)
        worst = network.worst(rows)
    if len(rows) == len(selection.chosen):
        return selection
    whole, _, _ = cover_problem(selection.visibility)
    chosen, method = frozen(rows, np.int64), selection.method.removesuffix(", proved fewest")
    steps = frozen(coverage_steps(whole, chosen))
    return replace(selection, chosen=chosen, coverage_steps=steps, method=f"{method}, more for accuracy")


class _RowNetwork:
    """Predicted errors of any candidates as scans of one network."""

    def __init__(self, selection: Selection) -> None:
        candidates = selection.candidates
        self._space, self._overlaps = candidates.space, overlaps_of(candidates)
        self._settings = selection.settings
        self._noise = noise_factor(selection.settings.range_noise)
        self._xy = candidates.xy[candidates.kept] - local_origin(candidates.floor)
        self._information: dict[tuple[int, int], FloatArray] = {}

    def worst(self, rows: list[int]) -> tuple[float, int]:
        """The greatest finite standard deviation of a scan, metres, and its row."""
        number = {row: k for k, row in enumerate(rows)}
        pairs = [(a, b) for a in rows for b in self._registering(a) if b in number and a < b]
        ends = [(number[a], number[b]) for a, b in pairs]
        xy, information = self._xy[rows], [self._of(*pair) for pair in pairs]
        errors = worst_errors(network_errors(xy, ends, information, seen_control(self._space, xy))[0])
        finite = np.where(np.isfinite(errors), errors, 0.0)
        return float(finite.max()), rows[int(np.argmax(finite))]

    def near(self, rows: list[int], worst: int) -> list[int]:
        """Candidates that register with the worst scan and with another one."""
        chosen = set(rows)
        linked = [
            (-len(chosen.intersection(self._registering(row))), row)
            for row in self._registering(worst)
            if row not in chosen
        ]
        return [row for links, row in sorted(linked)[:MOST_TRIED] if links <= -2]

    def _registering(self, row: int) -> list[int]:
        pairs = self._overlaps.of(row)
        found: list[int] = pairs.other[registers(pairs, self._settings)].tolist()
        return found

    def _of(self, a: int, b: int) -> FloatArray:
        if (a, b) not in self._information:
            moments = self._overlaps.normal_matrix(a, b)
            self._information[a, b] = information_of(moments, self._xy[b], self._noise)
        return self._information[a, b]
