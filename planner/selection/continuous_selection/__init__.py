"""Selection -> selection over every place where a stop may be, not only over the candidates offered.

The relaxed covering problem has a row for every place. It is solved over the places known; its prices are
held against cells that hold all places. Where a cell may see units that cost more than a stop, the cell is
cut, and its quarters' middles are tried: those that really see so much are new places. What then is still too
dear in a cell is made cheaper there, so that the prices prove a bound over every place, whatever was left
uncut. All limits are counts, so that the same floor gives the same plan.
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
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.selection import posed, select
from stopgo.planner.selection.continuous_selection.cells import CellVisibility, PlaceCells
from stopgo.planner.selection.continuous_selection.prices import Prices, WantedUnits, prices_of
from stopgo.planner.selection.demands import demands_of
from stopgo.planner.selection.refine import joined, taken, with_rows
from stopgo.planner.space.stop_feasibility import StopFeasibility
from stopgo.planner.visibility import visibility
from stopgo.planner.visibility.unit_ranges import ranges

ROUNDS = 8
"""Times that prices are asked for."""
MOST_CUT = 1200
"""Cells cut in each round, the dearest first."""
TOLERATED = 1e-3
"""What the units in sight of a cell may cost beyond a stop without the cell being cut."""
MOST_OFFERED = 600
"""New places that are offered in the end, those that see what costs most."""
SELECTOR = "anywhere"


def anywhere(selection: Selection) -> Selection:
    """The selection with places offered wherever they help, and the bound over every place.

    Raises
    ------
    InputError
        Where something is asked for that the bound does not hold for.
    """
    seen = selection.visibility
    _check(seen.candidates.space.settings)
    search = _CellSearch(seen)
    search.run()
    found = _best_of(selection, search.offered())
    fixed, bound = len(search.fixed), search.bound
    least = min(fixed + bound, len(found.chosen))
    method = found.method.removesuffix(", proved fewest") + ", any place offered"
    closed = ", proved fewest of all places" if least == len(found.chosen) else ""
    return replace(found, bound=least, method=method + closed, everywhere=True)


def _check(settings: Settings) -> None:
    """Refuse what changes what a stop sees or needs in ways that cells do not know."""
    wrong = {
        f"overlap = {settings.least_overlap:g}": settings.least_overlap > 0,
        f"views = {settings.views}": settings.least_views > 1,
        f"fov = {settings.fov:g}": settings.fov < 360,
        f"visibility = {settings.visibility}": settings.visibility != "exact",
        "refine = true": bool(settings.refine),
    }
    for told, asked in wrong.items():
        if asked:
            raise InputError(f"selector = {SELECTOR}: is not done with {told}; leave one of them out")


def _best_of(selection: Selection, wide: Visibility) -> Selection:
    """The selection, or one with fewer stops out of more places; of these only the chosen stay offered."""
    again = select(wide)
    if len(again.chosen) >= len(selection.chosen):
        return selection
    first = selection.visibility.rows
    rows = np.concatenate([np.arange(first), np.sort(again.chosen[again.chosen >= first])])
    at = np.full(wide.rows, -1)
    at[rows] = np.arange(len(rows))
    return replace(again, visibility=with_rows(wide, rows), chosen=frozen(at[again.chosen], np.int64))


class _CellSearch:
    """Places and cells, refined in turn until the bound is as high as the relaxation allows."""

    def __init__(self, seen: Visibility) -> None:
        self._seen, self._known = seen, seen
        self._asked, self.fixed = _asked(seen)
        self._overlook = CellVisibility(seen.candidates)
        self._place = StopFeasibility(seen.candidates.space)
        self._cells = self._overlook.whole()
        self._prices: Prices | None = None
        self.bound = 0

    def run(self) -> None:
        """Ask for prices, hold them against cells, cut cells and take new places, so many times."""
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
        """What was seen at first, and from new places that are worth most at the last prices."""
        if self._prices is None:
            return self._seen
        worth = _worth_of(self._known, self._prices.unit)
        first = self._seen.rows
        more = first + np.argsort(-worth[first:], kind="stable")[:MOST_OFFERED]
        return with_rows(self._known, np.concatenate([np.arange(first), np.sort(more)]))

    def _proved(self, prices: Prices, worth: FloatArray) -> int:
        """The bound over every place: units are made as cheap as the dearest cell asks that may see them."""
        dearest = _most_on_each(self._cells, worth, len(prices.unit))
        known = _worth_of(self._known, prices.unit).max(initial=1.0)
        unit = prices.unit / (np.maximum(1.0, dearest) * max(1.0, known))
        least = Prices.of(self._asked, unit, prices.demand, prices.stops).value
        alike = prices.value / max(1.0, known, float(worth.max(initial=1.0)))
        return int(np.ceil(max(least, alike, 0.0) - 1e-6))

    def _refine(self, prices: Prices, dear: IntArray) -> None:
        """Cut these cells, and take what is seen from the new cells' middles where it costs too much."""
        quarters = self._overlook.cut(self._cells.among(dear))
        rest = np.setdiff1d(np.arange(len(self._cells)), dear)
        self._cells = self._cells.among(rest).joined(quarters)
        worth = quarters.worth(prices.unit)
        self._take(quarters.middle[worth > 1 + TOLERATED], prices)

    def _take(self, local: FloatArray, prices: Prices) -> None:
        """Know these places (n, 2) too, where a stop may be there and sees more than a stop costs."""
        space = self._seen.candidates.space
        xy = local + local_origin(space.floor)
        tree = shapely.STRtree(self._place.rooms)
        room = tree.nearest(shapely.points(local)) if len(local) else np.empty(0, np.int64)
        found = judged(space, xy, room, part=self._seen.candidates.chosen_part)
        if not len(found.kept):
            return
        try:
            seen = visibility(taken(found, found.kept))
        except NegativeResult:  # nothing is in sight from any of them
            return
        good = np.flatnonzero(_worth_of(seen, prices.unit) > 1 + TOLERATED)
        if len(good):
            self._known = joined(self._known, with_rows(seen, good))


def _asked(seen: Visibility) -> tuple[WantedUnits, IntArray]:
    """What stops must see besides what those see that are chosen in any case; and the rows of these."""
    demands = demands_of(seen)
    _, fixed, problem = posed(seen)
    weight = demands.weight.copy()
    weight[seen.seen_from(fixed)] = 0
    return WantedUnits(weight, demands.member, problem.needed.astype(float)), fixed


def _worth_of(seen: Visibility, price: FloatArray) -> FloatArray:
    """What the units that each row sees cost together (rows,)."""
    before = np.concatenate([[0.0], np.cumsum(price)])
    row, _, first, last = seen.runs_apart
    return np.bincount(row, before[last + 1] - before[first], seen.rows).astype(float)


def _most_on_each(cells: PlaceCells, worth: FloatArray, units: int) -> FloatArray:
    """Of each unit the most that the units in sight of one cell cost which may see it (units,)."""
    most = np.ones(units)
    dear = np.flatnonzero(worth > 1)
    for cell in dear[np.argsort(worth[dear], kind="stable")]:
        runs = slice(cells.pointer[cell], cells.pointer[cell + 1])
        first = cells.first[runs]
        most[ranges(first, cells.last[runs] - first + 1)] = worth[cell]
    return most


__all__ = ["SELECTOR", "anywhere"]
