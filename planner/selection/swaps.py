"""Best swap of a selection: what each chosen row's exchange costs is kept until a swap changes it.

A row can be exchanged for any other. Most of them see nothing of what leaves, so that only what they add
to the whole counts: of these, the one that adds most is the best. The others are evaluated one by one.
What is asked of the whole, or of a kind of element on the whole floor, changes with each swap: such wide
demands are counted for all swaps together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stopgo.mission.geometry import BoolArray, IntArray
from stopgo.planner.selection.board import Board
from stopgo.planner.selection.cover import Cover

FIRST_OF_FAR = 16
"""Rows that see nothing of what leaves and are offered for each exchange; doubled where too few."""

WIDE = 0.25
"""Share of all rows from which on a demand is wide: it changes with nearly every swap."""
MOST_AT_ONCE = 1_000_000
"""Swaps evaluated together, so that large floors take no more memory."""


@dataclass(frozen=True, eq=False)
class _Leaving:
    """Effects of one chosen row leaving, while the demands that this opens stay as they are."""

    stamp: int
    """Clock of the board when this was computed."""
    support: IntArray
    """Demands that lose or regain by it, wide ones left out (k,)."""
    lost: IntArray
    """Their loss (k,)."""
    lost_of_wide: IntArray
    """Loss of each wide demand (wide,)."""
    opened: int
    """Number of demands of `support` that are unmet without the row."""
    base: int
    """Weighted shortfall of these, less what of it is there already."""
    near: IntArray
    """Rows that add to them, or to what only the row covers (n,)."""
    local: IntArray
    """As `base`, once each near row is added (n,)."""
    regained: IntArray
    """Change of each near row's gain for each wide demand (wide, n)."""


@dataclass(frozen=True, eq=False)
class _Exchanges:
    """Swaps with their weighted shortfall, their covered weight, and both rows."""

    missing: IntArray
    covered: IntArray
    out: IntArray
    into: IntArray

    def best(self) -> tuple[int, int, int, int]:
        """Least shortfall, negative coverage, and rows; of equal ones most coverage, then the lowest rows."""
        alike = np.flatnonzero(self.missing == self.missing.min(initial=NEVER))
        alike = alike[self.covered[alike] == self.covered[alike].max(initial=-NEVER)]
        if not len(alike):
            return NEVER, 0, 0, 0
        first = alike[np.lexsort((self.into[alike], self.out[alike]))[0]]
        return (
            int(self.missing[first]),
            -int(self.covered[first]),
            int(self.out[first]),
            int(self.into[first]),
        )


NEVER = np.iinfo(np.int64).max
"""Shortfall of a swap that is not allowed."""


class SwapBoard(Board):
    """A board that finds the best swap of a selection; it does little again that no swap has changed."""

    def __init__(self, cover: Cover, rows: list[int]) -> None:
        super().__init__(cover, rows)
        self._clock = 0
        self._row_changed = np.zeros(cover.rows, dtype=np.int64)
        self._demand_changed = np.zeros(len(cover.needed), dtype=np.int64)
        self._leaving: dict[int, _Leaving] = {}
        met_by = np.diff((cover.worth @ cover.sees.T).tocsr().indptr)
        met_by[0] = cover.rows
        self._is_wide = met_by >= WIDE * cover.rows
        self._wide = np.flatnonzero(self._is_wide)

    def take(self, row: int) -> None:
        super().take(row)
        self._note_change(row, -1, 1)

    def drop(self, row: int) -> None:
        super().drop(row)
        self._note_change(row, 0, 2)

    def raise_penalties(self) -> None:
        super().raise_penalties()
        self._clock += 1
        self._demand_changed[self.missing > 0] = self._clock

    def _note_change(self, row: int, fewest: int, most: int) -> None:
        """Note the rows and demands whose gains depend on columns that now need so many more views."""
        columns = self._cover.columns_of(row)
        short = self._left[columns]
        columns = columns[(short >= fewest) & (short <= most)]
        self._clock += 1
        self._row_changed[self._worths.seers(columns)] = self._clock
        self._demand_changed[self._worths.demands(columns)] = self._clock

    def best_swap(self, rows: list[int], blocked: list[int]) -> tuple[int, int]:
        """The swap with the least shortfall; of equal ones, the one with the most coverage.

        One of `rows` leaves, and none of `blocked` is added.
        """
        outs = np.array(sorted(rows), dtype=np.int64)
        leaving = self._all_leaving(outs)
        lost = np.array([one.lost_of_wide for one in leaving]).T
        common, idle = self._shortfall_of_narrow()
        free = np.ones(self._cover.rows, dtype=bool)
        free[blocked] = False
        owner = np.repeat(np.arange(len(outs)), [len(one.near) for one in leaving])
        near = np.concatenate([one.near for one in leaving])
        regained = np.concatenate([one.regained for one in leaving], axis=1)
        local = np.concatenate([one.local for one in leaving]) + common[near]
        allowed = free[near]
        best = self._exchanges(
            outs, lost, owner[allowed], near[allowed], local[allowed], regained[:, allowed]
        ).best()
        base = np.array([one.base for one in leaving], dtype=np.int64)
        asked = self._wide[1:][(self._asked_of_wide(lost)[1:] > 0).any(axis=1)]
        helps = (common != idle) | (self._adds[asked] != 0).any(axis=0)
        far, taken = self._far_rows(free, helps, owner, near, len(outs))
        at_once = max(1, MOST_AT_ONCE // max(1, len(far)))
        for begin in range(0, len(outs), at_once):
            owner, column = np.nonzero(~taken[begin : begin + at_once])
            owner += begin
            local = base[owner] + common[far[column]]
            best = min(best, self._exchanges(outs, lost, owner, far[column], local, None).best())
        return best[2:]

    def _shortfall_of_narrow(self) -> tuple[IntArray, int]:
        """Weighted shortfall of all demands but the wide ones, with each row added (rows,) and with none."""
        missing = np.where(self._is_wide, 0, self.missing)
        unmet = np.flatnonzero(missing)
        short = np.maximum(0, missing[unmet][:, None] - self._adds[unmet])
        return self.weight[unmet] @ short, int(self.weight @ missing)

    def _asked_of_wide(self, lost: IntArray) -> IntArray:
        """Shortage of each wide demand with these losses (wide, n); negative if it has more than that."""
        return (self._cover.needed - self._reached)[self._wide][:, None] + lost

    def _exchanges(
        self,
        outs: IntArray,
        lost: IntArray,
        owner: IntArray,
        into: IntArray,
        local: IntArray,
        regained: IntArray | None,
    ) -> _Exchanges:
        """The swaps of rows `outs[owner]` for `into`; `regained` adds to what these give wide demands."""
        asked = self._asked_of_wide(lost)
        missing, covered = local, -lost[0][owner]
        for k, demand in enumerate(self._wide):
            if k > 0 and not (asked[k] > 0).any():
                continue
            adds = self._adds[demand][into]
            if regained is not None:
                adds = adds + regained[k]
            if k == 0:
                covered = covered + adds
            missing = missing + self.weight[demand] * np.maximum(0, asked[k][owner] - adds)
        return _Exchanges(missing, covered, outs[owner], into)

    def _far_rows(
        self, free: BoolArray, helps: BoolArray, owner: IntArray, near: IntArray, outs: int
    ) -> tuple[IntArray, NDArray[np.bool_]]:
        """Rows to evaluate for every leaving row: all that help unmet demands, and those that add most.

        Also, for each leaving row and each of them, True where it is a near one (outs, rows).
        """
        others = np.flatnonzero(free & ~helps)
        others = others[np.argsort(-self._adds[0][others], kind="stable")]
        offered = FIRST_OF_FAR
        while True:
            first = others[:offered]
            far = np.concatenate([first, np.flatnonzero(free & helps)])
            column = np.full(self._cover.rows, -1, dtype=np.int64)
            column[far] = np.arange(len(far))
            taken = np.zeros((outs, len(far)), dtype=np.bool_)
            hit = column[near] >= 0
            taken[owner[hit], column[near[hit]]] = True
            if offered >= len(others) or not taken[:, : len(first)].all(axis=1).any():
                return far, taken
            offered *= 2

    def _all_leaving(self, outs: IntArray) -> list[_Leaving]:
        """Effects of each row leaving, computed again where they may have changed."""
        for out in outs.tolist():
            if out not in self._leaving:
                self._leaving[out] = self._without(out)
        known = [self._leaving[out] for out in outs.tolist()]
        owner = np.repeat(np.arange(len(known)), [len(one.support) for one in known])
        support = np.concatenate([one.support for one in known])
        lost = np.concatenate([one.lost for one in known])
        is_open = self._cover.needed[support] - self._reached[support] + lost > 0
        newest = self._row_changed[outs]
        np.maximum.at(newest, owner[is_open], self._demand_changed[support[is_open]])
        opened = np.bincount(owner[is_open], minlength=len(known))
        same = (newest <= [one.stamp for one in known]) & (opened == [one.opened for one in known])
        for k in np.flatnonzero(~same).tolist():
            known[k] = self._leaving[int(outs[k])] = self._without(int(outs[k]))
        return known

    def _without(self, out: int) -> _Leaving:
        """Effects of one row leaving."""
        columns = self._cover.columns_of(out)
        alone, almost = (columns[self._left[columns] == short] for short in (0, 1))
        lost = self._worths.of(alone)
        support = np.flatnonzero((lost != 0) | (self._worths.of(almost) != 0))
        support = support[~self._is_wide[support]]
        asked = self._cover.needed[support] - self._reached[support] + lost[support]
        opened, asked = support[asked > 0], asked[asked > 0]
        demands = np.concatenate([self._wide, opened])
        regained = self._worths.by_row(alone, demands)
        if len(almost):
            regained -= self._worths.by_row(almost, demands)
        adds = self._adds[opened]
        near = np.flatnonzero((regained != 0).any(axis=0) | (adds != 0).any(axis=0))
        adds, weight, now = adds[:, near], self.weight[opened], self.missing[opened]
        after = np.maximum(0, asked[:, None] - adds - regained[len(self._wide) :, near])
        return _Leaving(
            stamp=self._clock,
            support=support,
            lost=lost[support],
            lost_of_wide=lost[self._wide],
            opened=len(opened),
            base=int(weight @ (asked - now)),
            near=near,
            local=weight @ (after - np.maximum(0, now[:, None] - adds)),
            regained=regained[: len(self._wide), near],
        )
