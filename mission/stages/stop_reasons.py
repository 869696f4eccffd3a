"""Reason for each stop of a plan: what it sees, what only it sees, and which candidates were alternatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stopgo.mission.console.table import counted
from stopgo.mission.geometry import BoolArray, FloatArray, IntArray
from stopgo.mission.stages import Route, Visibility, weights_of
from stopgo.mission.stages.coverage_totals import OUTSIDE, CoverageTotals, totals_of_plan
from stopgo.mission.stages.figures import GroupCoverage, percent

NEARLY = 0.8
"""A runner-up must have seen at least this fraction of what the chosen candidate newly saw …"""
SAME = 0.5
"""… and at least this fraction of it in the same units: candidates of other rooms are no alternatives."""
MOST_RUNNERS = 3
LEAST_PRINTED = 0.05
"""Smaller amounts would be printed as 0.0 and are left out."""
MOST_ROOMS = 4
"""Number of rooms and candidates listed for one stop."""


@dataclass(frozen=True)
class RunnerUp:
    """A candidate that was not chosen, at the step of choosing the stop."""

    candidate: int
    """Row of `Visibility`."""
    x: float
    y: float
    new: float
    """Amount that it would have seen and that still lacked views, metres or units."""


@dataclass(frozen=True)
class StopReason:
    """Reason for one stop; amounts are metres of visible boundary, or units by the paper's rule."""

    stop: str
    step: int
    """Number of its step in the order of choice, from 1."""
    candidate: int
    """Row of `Visibility`."""
    units: int
    """Units that it sees, as in the mission."""
    sees: float
    new: float
    """Part of `sees` that lacked views when it was chosen: seen by no earlier stop if one is enough."""
    alone_units: int
    alone: float
    """Part that no other stop of the plan could replace: the loss without this stop."""
    visible: float
    """All visible from any candidate."""
    coverage: float
    """Coverage of the whole, after it was chosen."""
    rooms: tuple[GroupCoverage, ...]
    """The rooms that lose without it, as seen then; the greatest loss first."""
    lost: tuple[float, ...]
    """Loss of each of these rooms."""
    runners: tuple[RunnerUp, ...]
    """The greatest gain first."""
    unit: str = "m"

    @property
    def lost_fraction(self) -> float:
        """Loss without it, as a fraction of all visible."""
        return self.alone / self.visible if self.visible else 0.0

    @property
    def short(self) -> tuple[GroupCoverage, ...]:
        """Rooms with less coverage than required without it."""
        return tuple(room for room in self.rooms if not room.met)

    def sentences(self) -> tuple[str, ...]:
        """Return the reason in sentences."""
        return (self._seen(), self._offered(), self._lost())

    def _seen(self) -> str:
        new = f"choice {self.step}, when {self.new:.1f} {self.unit} of that were not covered yet"
        reached = f"coverage came to {percent(self.coverage)}"
        return f"{self.stop} sees {self.units} units, {self.sees:.1f} {self.unit}; {new} and {reached}."

    def _offered(self) -> str:
        if not self.runners:
            return f"No other candidate there would cover {NEARLY:.0%} as much that was new."
        listed = ", ".join(
            f"candidate {item.candidate} at ({item.x:.2f}, {item.y:.2f}) {item.new:.1f} {self.unit}"
            for item in self.runners
        )
        return f"Runners-up at that step: {listed}."

    def _lost(self) -> str:
        if not self.alone_units:
            return "Without it nothing would be lost: other stops see all that it sees."
        losses = [
            f"{room.name} {lost:.1f} {self.unit}" + ("" if room.met else " (then below the requirement)")
            for room, lost in zip(self.rooms, self.lost, strict=True)
            if lost >= LEAST_PRINTED
        ]
        where = ", ".join(losses[:MOST_ROOMS]) or "less than that in any room"
        more = f" and {counted(len(losses) - MOST_ROOMS, 'more room')}" if len(losses) > MOST_ROOMS else ""
        return (
            f"It alone sees {self.alone_units} units, {self.alone:.1f} {self.unit} or"
            f" {percent(self.lost_fraction)} of what is visible; lost without it: {where}{more}."
        )


def stop_reasons(route: Route, stops: Sequence[str]) -> tuple[StopReason, ...]:
    """Return the reasons of a plan's stops, with the names `stops`, in the order of driving."""
    selection = route.selection
    if not len(selection.chosen):
        return ()
    visibility = selection.visibility
    totals = totals_of_plan(visibility)
    sights = [visibility.seen_by(int(row)) for row in selection.chosen]
    often = np.bincount(np.concatenate(sights), minlength=len(totals.weight))
    offers = _Offers(visibility, totals)
    steps = [offers.choose(int(row)) for row in selection.chosen]
    rooms = _Rooms(totals, totals.enough(often))
    visible = totals.amount(totals.visible)
    found = []
    for name, choice in zip(stops, route.order.tolist(), strict=True):
        sight = sights[choice]
        counted = sight[totals.visible[sight]]
        alone = counted[often[counted] == visibility.asked[counted]]
        new, runners = steps[choice]
        losing, lost = rooms.without(alone)
        found.append(
            StopReason(
                stop=name,
                step=choice + 1,
                candidate=int(selection.chosen[choice]),
                units=len(sight),
                sees=_amount(totals, counted),
                new=new,
                alone_units=len(alone),
                alone=_amount(totals, alone),
                visible=visible,
                coverage=float(selection.coverage_steps[choice]),
                rooms=losing,
                lost=lost,
                runners=runners,
                unit="units" if totals.rule == "paper" else "m",
            )
        )
    return tuple(found)


def driven_coverage(route: Route) -> FloatArray:
    """Return the fraction of all visible seen after each stop, in the order of driving (k,)."""
    visibility = route.visibility
    weight = weights_of(visibility.targets, visibility.settings)
    counts = np.where(visibility.visible, weight, 0)
    lacking, gained = visibility.asked.copy(), []
    for row in route.selection.chosen[route.order].tolist():
        sight = visibility.seen_by(row)
        lacking[sight] -= 1
        gained.append(int(counts[sight[lacking[sight] == 0]].sum()))
    return np.asarray(np.cumsum(gained) / max(int(counts.sum()), 1), dtype=np.float64)


def _amount(totals: CoverageTotals, units: IntArray) -> float:
    return float(int(totals.weight[units].sum()) * totals.scale)


class _Offers:
    """Gain of every candidate, updated as candidates are chosen."""

    def __init__(self, visibility: Visibility, totals: CoverageTotals) -> None:
        self._visibility, self._totals = visibility, totals
        summed = np.concatenate([[0], np.cumsum(np.where(totals.visible, totals.weight, 0))])
        self.gain: IntArray = np.zeros(visibility.rows, dtype=np.int64)
        parts = []
        for row, _, first, last in visibility.runs_apart_by_rows():
            np.add.at(self.gain, row, summed[last + 1] - summed[first])
            order = np.argsort(first, kind="stable")
            parts.append((row[order], first[order], last[order]))
        self._parts = parts
        """Row, first and last unit of runs (k,), by their first units; of some rows after the other."""
        self._lacking: IntArray = np.where(totals.visible, visibility.asked, 0)
        """Number of further views that each unit needs until it counts."""
        self._chosen: BoolArray = np.zeros(visibility.rows, dtype=np.bool_)

    def choose(self, row: int) -> tuple[float, tuple[RunnerUp, ...]]:
        """Choose a candidate; return its gain, and the runners-up."""
        new = int(self.gain[row])
        sight = self._visibility.seen_by(row)
        fresh = sight[self._lacking[sight] > 0]
        self._chosen[row] = True
        if not len(fresh):
            return 0.0, ()
        shared = self._shared(fresh)
        runners = self._runners(row, shared)
        self._lacking[fresh] -= 1
        done = fresh[self._lacking[fresh] == 0]
        self.gain -= shared if len(done) == len(fresh) else self._shared(done)
        return new * self._totals.scale, runners

    def _runners(self, row: int, shared: IntArray) -> tuple[RunnerUp, ...]:
        candidates, gain = self._visibility.candidates, self.gain
        alike = (gain >= NEARLY * gain[row]) & (shared >= SAME * gain[row])
        rows = np.flatnonzero(alike & ~self._chosen)
        best = rows[np.argsort(-gain[rows], kind="stable")][:MOST_RUNNERS]
        positions = candidates.xy[candidates.kept[best]].tolist()
        amounts = (gain[best] * self._totals.scale).tolist()
        columns = zip(best.tolist(), positions, amounts, strict=True)
        return tuple(RunnerUp(row, x, y, new) for row, (x, y), new in columns)

    def _shared(self, fresh: IntArray) -> IntArray:
        """Return the amount of some units (ascending) that each candidate sees."""
        targets, kind = self._visibility.targets, self._visibility.first.dtype
        segments = np.unique(targets.unit_segment[fresh])
        begins, ends = (targets.first_unit[segments + k].astype(kind) for k in range(2))
        summed = np.concatenate([[0], np.cumsum(self._totals.weight[fresh])])
        found: IntArray = np.zeros(len(self.gain), dtype=np.int64)
        for row, first, last in self._parts:
            runs = _ranges(np.searchsorted(first, begins), np.searchsorted(first, ends))
            begin, end = summed[np.searchsorted(fresh, np.stack([first[runs], last[runs] + 1]))]
            np.add.at(found, row[runs], end - begin)
        return found


def _ranges(low: IntArray, high: IntArray) -> IntArray:
    """Return the whole numbers from each `low` up to below its `high`, one range after another."""
    counts = high - low
    starts = np.repeat(low - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
    return np.asarray(starts + np.arange(int(counts.sum())), dtype=np.int64)


class _Rooms:
    """Totals of each room, visible and seen, and the loss without some units."""

    def __init__(self, totals: CoverageTotals, seen: BoolArray) -> None:
        self._totals = totals
        self._room = totals.room
        size = len(totals.rooms) + 1  # the last one is what faces none
        weight: FloatArray = totals.weight.astype(np.float64)
        masks = (np.ones_like(seen), totals.visible, totals.visible & seen)
        self._sums = [
            np.bincount(totals.room % size, np.where(m, weight, 0.0), minlength=size) for m in masks
        ]

    def without(self, units: IntArray) -> tuple[tuple[GroupCoverage, ...], tuple[float, ...]]:
        """Return the rooms that lose, as seen without these units, and each room's loss."""
        size, scale = len(self._sums[0]), self._totals.scale
        lost = np.bincount(self._room[units] % size, self._totals.weight[units], minlength=size)
        losing = sorted(np.flatnonzero(lost).tolist(), key=lambda k: (-lost[k], k))
        coverages = tuple(self._coverage_of(k, float(lost[k])) for k in losing)
        return coverages, tuple(float(lost[k]) * scale for k in losing)

    def _coverage_of(self, k: int, lost: float) -> GroupCoverage:
        groups, scale = self._totals.rooms, self._totals.scale
        total, visible, seen = (float(column[k]) * scale for column in self._sums)
        name = groups[k].name if k < len(groups) else OUTSIDE
        required = groups[k].required if k < len(groups) else None
        return GroupCoverage(name, total, visible, max(seen - lost * scale, 0.0), required=required)
