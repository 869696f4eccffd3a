"""Selection -> selection over every allowed position of a stop, not only over the candidates.

The relaxed covering problem has a row for every position. It is solved over the known positions, and its
prices are compared with cells that contain all positions. A cell that may see units worth more than one
stop is cut in four. The centres of the quarters are tried: those that see so much are new positions. Prices
that are still too high for a cell are lowered, so that they prove a bound over every position. This holds
whatever cells remain uncut. All limits are counts, so that the same floor gives the same plan.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.planner.candidates import judged
from stopgo.planner.geometry.index_ranges import ranges
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.selection import cover_problem, select
from stopgo.planner.selection.continuous_selection.cells import CellVisibility, PositionCells
from stopgo.planner.selection.continuous_selection.prices import Prices, WantedUnits, prices_of
from stopgo.planner.selection.demands import demands_of
from stopgo.planner.selection.refine import extra_candidates, merged, with_rows
from stopgo.planner.space.stop_feasibility import StopFeasibility
from stopgo.planner.visibility import visibility

ROUNDS = 8
"""Rounds of prices and cuts."""
MOST_CUT = 1200
"""Cells cut in each round, those with the highest worth first."""
TOLERATED = 1e-3
"""Worth of a cell's visible units above one stop, up to which the cell is not cut."""
MOST_OFFERED = 600
"""Most new positions offered at the end, those of the highest worth."""
SELECTOR = "anywhere"


def select_anywhere(seen: Visibility) -> Selection:
    """The selection with new positions offered wherever they help, and a bound over every position.

    The bound is of selections whose scans need not register. It holds where they must, too.

    Raises
    ------
    InputError
        If the settings use a parameter for which the bound does not hold.
    """
    _check(seen.settings)
    search = _CellSearch(seen)
    search.run()
    found = _best_of(select(seen), search.offered())
    fixed, bound = len(search.fixed), search.bound
    least = min(fixed + bound, len(found.chosen))
    method = found.method.removesuffix(", proved fewest") + ", any place offered"
    closed = ", proved fewest of all places" if least == len(found.chosen) else ""
    return replace(found, bound=least, method=method + closed, everywhere=True)


def _check(settings: Settings) -> None:
    """Refuse parameters that the visibility of cells does not model."""
    wrong = {
        f"--min-views {settings.views}": settings.least_views > 1,
        f"--fov {settings.fov:g}": settings.fov < 360,
        f"--visibility {settings.visibility}": settings.visibility != "exact",
        "refine = true": bool(settings.refine),
    }
    for given, is_set in wrong.items():
        if is_set:
            raise InputError(f"--selector {SELECTOR}: not possible with {given}; remove one of them")


def _best_of(selection: Selection, wide: Visibility) -> Selection:
    """The selection, or one with fewer stops from more positions; of these only the chosen ones stay."""
    again = select(wide)
    if len(again.chosen) >= len(selection.chosen):
        return selection
    first = selection.visibility.rows
    rows = np.concatenate([np.arange(first), np.sort(again.chosen[again.chosen >= first])])
    at = np.full(wide.rows, -1)
    at[rows] = np.arange(len(rows))
    return replace(again, visibility=with_rows(wide, rows), chosen=frozen(at[again.chosen], np.int64))


class _CellSearch:
    """Positions and cells, refined in turn until the bound is as high as the relaxation allows."""

    def __init__(self, seen: Visibility) -> None:
        self._seen, self._known = seen, seen
        self._asked, self.fixed = _asked(seen)
        self._cell_visibility = CellVisibility(seen.candidates)
        self._place = StopFeasibility(seen.space)
        self._cells = self._cell_visibility.all_cells()
        self._prices: Prices | None = None
        self.bound = 0

    def run(self) -> None:
        """Repeat: compute prices, compare them with cells, cut cells, and add new positions."""
        for _ in range(ROUNDS if self._asked.needed.any() else 0):
            row, _, first, last = self._known.runs_apart
            prices = prices_of(self._asked, row, first, last, self._known.rows)
            if prices is None:
                return
            self._prices = prices
            worth = self._cells.worth(prices.unit)
            self.bound = max(self.bound, self._proved(prices, worth))
            dear = np.flatnonzero(worth > 1 + TOLERATED)
            if not len(dear) or self.bound >= np.ceil(prices.value - 1e-6):
                return
            self._refine(prices, dear[np.argsort(-worth[dear], kind="stable")][:MOST_CUT])

    def offered(self) -> Visibility:
        """The first visibility, with the new positions of the highest worth at the last prices."""
        if self._prices is None:
            return self._seen
        worth = _worth_of(self._known, self._prices.unit)
        first = self._seen.rows
        more = first + np.argsort(-worth[first:], kind="stable")[:MOST_OFFERED]
        return with_rows(self._known, np.concatenate([np.arange(first), np.sort(more)]))

    def _proved(self, prices: Prices, worth: FloatArray) -> int:
        """The bound over every position, with each unit's price lowered by its most expensive cell."""
        dearest = _most_on_each(self._cells, worth, len(prices.unit))
        known = _worth_of(self._known, prices.unit).max(initial=1.0)
        unit = prices.unit / (np.maximum(1.0, dearest) * max(1.0, known))
        least = Prices.of(self._asked, unit, prices.demand, prices.stops).value
        alike = prices.value / max(1.0, known, float(worth.max(initial=1.0)))
        return int(np.ceil(max(least, alike, 0.0) - 1e-6))

    def _refine(self, prices: Prices, dear: IntArray) -> None:
        """Cut these cells, and try the centres of the new cells whose worth exceeds one stop."""
        quarters = self._cell_visibility.cut(self._cells.among(dear))
        rest = np.setdiff1d(np.arange(len(self._cells)), dear)
        self._cells = self._cells.among(rest).joined(quarters)
        worth = quarters.worth(prices.unit)
        self._take(quarters.middle[worth > 1 + TOLERATED], prices)

    def _take(self, local: FloatArray, prices: Prices) -> None:
        """Add those of these positions (n, 2) that are allowed and whose worth exceeds one stop."""
        space = self._seen.space
        xy = local + local_origin(space.floor)
        tree = shapely.STRtree(self._place.rooms)
        room = tree.nearest(shapely.points(local)) if len(local) else np.empty(0, np.int64)
        found = judged(space, xy, room, part=self._seen.candidates.chosen_part)
        if not len(found.kept):
            return
        try:
            seen = visibility(extra_candidates(found, found.kept))
        except NegativeResult:  # none of them sees anything
            return
        good = np.flatnonzero(_worth_of(seen, prices.unit) > 1 + TOLERATED)
        if len(good):
            self._known = merged(self._known, with_rows(seen, good))


def _asked(seen: Visibility) -> tuple[WantedUnits, IntArray]:
    """Demands that remain after the required stops, and the rows of the required stops."""
    demands = demands_of(seen)
    _, fixed, problem = cover_problem(seen)
    weight = demands.weight.copy()
    weight[seen.seen_from(fixed)] = 0
    return WantedUnits(weight, demands.member, problem.needed.astype(float)), fixed


def _worth_of(seen: Visibility, price: FloatArray) -> FloatArray:
    """Total price of the units that each row sees (rows,)."""
    before = np.concatenate([[0.0], np.cumsum(price)])
    row, _, first, last = seen.runs_apart
    return np.bincount(row, before[last + 1] - before[first], seen.rows).astype(float)


def _most_on_each(cells: PositionCells, worth: FloatArray, units: int) -> FloatArray:
    """For each unit the highest worth of a cell that may see it, at least 1 (units,)."""
    most = np.ones(units)
    dear = np.flatnonzero(worth > 1)
    for cell in dear[np.argsort(worth[dear], kind="stable")]:
        runs = slice(cells.pointer[cell], cells.pointer[cell + 1])
        first = cells.first[runs]
        most[ranges(first, cells.last[runs] - first + 1)] = worth[cell]
    return most


__all__ = ["SELECTOR", "select_anywhere"]
