"""Selection that hangs together: as few rows as meet every demand and form one network by overlap.

Between two pieces of a selection that do not hang together lie rows of which every selection that does must
have one. That is one more demand on the covering problem, so the problem grows until what solves it hangs
together, and its bound is one for selections that do. (Cuts by node separators: Álvarez-Miranda, Ljubić and
Mutzel, "The maximum weight connected subgraph problem", 2013.) What still lies apart is joined by further
rows, and rows that have become idle leave.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csr_array

from stopgo.mission.geometry import IntArray
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.selection.separators import (
    Conditions,
    conditions_between,
    grounds_of,
    meets,
    pieces_of,
    separators,
)
from stopgo.planner.selection.steps_between import steps_between

Search = Callable[[Cover, IntArray, Conditions], tuple[IntArray, int]]
"""`(problem, start, conditions) -> (rows, bound)`: rows that solve the problem, from ones that do."""
QUICK_ROUNDS = 20
"""Times that a greedy selection is looked at for what parts it."""


@dataclass(eq=False)
class JoinedCover:
    """What a selection must see, and how it must hang together; grows by what parts selections."""

    cover: Cover
    links: csr_array
    """1 where two rows register with one another (rows, rows)."""
    offered: IntArray
    grounds: list[IntArray] = field(init=False)
    """Rows offered, parted where no link joins them; only as many of these as are needed."""
    cuts: dict[bytes, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.grounds = grounds_of(self.cover, pieces_of(self.links, self.offered))

    @property
    def problem(self) -> Cover:
        """The covering problem with a demand for each set of rows that must not be left out."""
        rows = np.sort(np.concatenate([np.empty(0, np.int64), *self.grounds]))
        return self.cover.offering(rows).with_one_of_each(list(self.cuts.values()))

    def take_cuts(self, rows: IntArray) -> bool:
        """Add what parts these rows to the problem; whether that is anything new."""
        before = len(self.cuts)
        for cut in separators(self.cover, self.links, self.grounds, rows):
            self.cuts.setdefault(cut.tobytes(), cut)
        return len(self.cuts) > before

    def parts(self, rows: IntArray) -> int:
        """Pieces that rows lie in, beyond those that nothing offered can join."""
        return sum(max(0, len(pieces_of(self.links, np.intersect1d(rows, g))) - 1) for g in self.grounds)


def connected(task: JoinedCover, search: Search, *, rounds: int) -> tuple[IntArray, int]:
    """Rows that meet every demand and hang together as far as links reach, and a bound on their number."""
    best = _by_greedy(task)
    bound, conditions = 0, Conditions(task.cover.rows)
    for _ in range(rounds):
        rows, at_least = search(task.problem, best, conditions)
        bound = max(bound, at_least)
        found = hanging_together(task, rows)
        best = found if len(found) < len(best) else best
        if len(best) <= bound or not task.parts(rows):
            break
        if not task.take_cuts(rows):
            more = conditions_between(task.cover, task.links, task.grounds, rows)
            if not conditions.take(more):
                break
    return best, bound


def _by_greedy(task: JoinedCover) -> IntArray:
    """A first selection that hangs together, and the cuts found on the way."""
    rows = greedy(task.problem)
    for _ in range(QUICK_ROUNDS):
        if not task.take_cuts(rows):
            break
        rows = greedy(task.problem)
    return hanging_together(task, rows)


def hanging_together(task: JoinedCover, rows: IntArray) -> IntArray:
    """The rows, with others that join their pieces and without those that have become idle."""
    for ground in task.grounds:
        while len(pieces := pieces_of(task.links, np.intersect1d(rows, ground))) > 1:
            gain = task.cover.sees @ np.where(
                task.cover.covered_by(rows) < task.cover.asks, task.cover.weight, 0
            )
            rows = np.union1d(rows, steps_between(task.links, ground, pieces, gain))
    return _without_idle(task, np.unique(rows))


def _without_idle(task: JoinedCover, rows: IntArray) -> IntArray:
    """The rows without those that are neither needed to see enough nor to hang together."""
    covered = task.cover.covered_by(rows)
    columns = [task.cover.columns_of(int(row)) for row in rows]
    alone = [int(task.cover.weight[seen][covered[seen] <= task.cover.asks[seen]].sum()) for seen in columns]
    for row in rows[np.argsort(alone, kind="stable")]:
        rest = rows[rows != row]
        if meets(task.cover, rest) and not task.parts(rest):
            rows = rest
    return rows
