"""Proven lower bounds on the number of stops, each by weak duality from prices checked here."""

from __future__ import annotations

import numpy as np

from stopgo.mission.geometry import IntArray
from stopgo.planner.geometry.instance_cache import instance_cached
from stopgo.planner.selection.bound_by_parts import bound_by_parts, has_parts
from stopgo.planner.selection.branching_bound import branching_bound
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.cover_relaxation import CoverRelaxation
from stopgo.planner.selection.growing_relaxation import growing_bound
from stopgo.planner.selection.knapsack_cuts import CHOSEN
from stopgo.planner.selection.multiplier_bound import multiplier_bound, rounded_up

LARGEST = 400_000
"""Entries of the covering matrix above which the relaxation is not solved: it takes up to 3 s below."""
COARSE = 30_000
"""Entries of a coarse relaxation, about."""
FINE = 100_000
"""Entries of a relaxation, about: with more the bound is hardly better, and takes up to 4 times as long."""
FEW = 30
"""Most rows of a selection that a bound often proves the fewest."""
FIRST_STEPS = 100
"""Steps of a first bound by the multipliers, for problems that are too large for a relaxation."""
FIRST_WORK = 40_000_000
"""Entries evaluated in all of them together."""
LONG_WORK = 600_000_000
"""Entries evaluated in all steps of the multiplier bound where the range is long: some 2 s."""
WIDE = 6_000_000
"""Entries above which the multiplier bound gets too few steps."""
MOST_GROWN = 300
"""Most rows of a selection that is bounded by a relaxation that grows: 2 s for 44 rows, and 15 s for 256."""


def counting_bound(cover: Cover) -> int:
    """Fewest rows whose views could meet the hardest demand, if no views overlapped without need."""
    gains = cover.adds.tocsc()
    each = np.split(gains.data, gains.indptr[1:-1])
    simple = max(map(_fewest, each, cover.views_needed.tolist()), default=0)
    return max(simple, int(cover.asks.min(initial=simple)) if cover.needed.any() else 0)


def _fewest(gains: IntArray, needed: int) -> int:
    return int(np.searchsorted(np.cumsum(np.sort(gains)[::-1]), needed)) + 1 if needed > 0 else 0


def lower_bound(cover: Cover, *, found: int) -> int:
    """Lower bound on the rows of a selection; `found` rows are known to suffice.

    Small problems use the linear relaxation, large ones that of one part after another. Where the range is
    long, these use one to which rows are added, or the multiplier bound: that is as good if many rows meet
    each demand and it gets enough steps. For few rows a coarse relaxation comes first, which often proves
    them, and branches come last.
    """
    simple, entries = counting_bound(cover), cover.sees.nnz
    if simple >= found or not cover.needed.any():
        return simple
    if entries > LARGEST:
        if has_parts(cover):
            return max(simple, bound_by_parts(cover, found=found))
        if found <= MOST_GROWN and (entries > WIDE or found <= len(cover.needed)):
            return max(simple, growing_bound(cover))
        return max(simple, multiplier_bound(cover, found=found, work=LONG_WORK))
    coarse = coarse_bound(cover) if found <= FEW and entries > COARSE else 0
    bound = max(simple, coarse if coarse >= found else relaxation_bound(cover))
    is_near = bound == found - 1 and found <= FEW
    return max(bound, branching_bound(cover, found=found)) if is_near else bound


def early_bound(cover: Cover, *, found: int) -> int:
    """A lower bound for the end of a search; `found` rows are known to suffice.

    A search for many rows seldom reaches its bound, which takes longer than the search. It has that by
    counting. One for few rows has that of the coarse relaxation, or by a few steps of the multiplier bound.
    """
    simple = counting_bound(cover)
    if simple >= found or found > FEW or not cover.needed.any():
        return simple
    if cover.sees.nnz > LARGEST:
        return first_bound(cover, found=found)
    return max(simple, coarse_bound(cover) if cover.sees.nnz > COARSE else relaxation_bound(cover))


def first_bound(cover: Cover, *, found: int) -> int:
    """Lower bound by a few steps of the multiplier bound; `found` rows are known to suffice."""
    simple = counting_bound(cover)
    if simple >= found or not cover.needed.any():
        return simple
    steps = min(FIRST_STEPS, FIRST_WORK // max(1, cover.sees.nnz))
    return max(simple, multiplier_bound(cover, found=found, steps=steps))


def relaxation_bound(cover: Cover) -> int:
    """Rounded-up optimum of: min Σ x_i, v_j y_j <= Σ x_i that see j, y_j <= 1, Σ w_kj y_j >= needed_k.

    Where columns need more than one view, x_i <= 1 too. Knapsack cover inequalities Σ c_hi x_i >= 1 follow.
    The result does not depend on the solver's tolerances: any prices u_j >= 0 of columns, p >= 0 of demands
    and q >= 0 of inequalities give the bound Σ needed_k p_k + Σ q_h - Σ_j max(0, Σ w_kj p_k - v_j u_j)
    - Σ_i max(0, Σ_j in i u_j + Σ c_hi q_h - 1) by weak duality, and it is computed from the solver's. Of a
    large problem neighbouring columns are one, as in the coarse bound.
    """
    return _fine(cover)[0]


def coarse_bound(cover: Cover) -> int:
    """Rounded-up bound at the prices of a relaxation in which neighbouring columns are one.

    A group may be seen in part, and its columns have prices by their weight. By weak duality these too
    prove a bound of the whole problem. It is a little weaker than the relaxation's, at about half the time.
    """
    return _coarse(cover)[0]


def likely_rows(cover: Cover, *, coarse: bool = False) -> IntArray:
    """Rows of which a relaxation has a part (n,): a good selection is often among them."""
    return (_coarse if coarse else _fine)(cover)[1]


@instance_cached
def _coarse(cover: Cover) -> tuple[int, IntArray]:
    return _relaxed(cover, COARSE)


@instance_cached
def _fine(cover: Cover) -> tuple[int, IntArray]:
    return _relaxed(cover, FINE)


def _relaxed(cover: Cover, entries: int) -> tuple[int, IntArray]:
    """The bound of a relaxation of about so many entries, and the rows of which its solution has a part."""
    if not cover.needed.any():
        return 0, np.empty(0, np.int64)
    relaxation = CoverRelaxation(cover, entries)
    solution = relaxation.solution()
    if solution is None:
        return 0, np.empty(0, np.int64)
    return rounded_up(relaxation.proved(solution)), np.flatnonzero(solution.values[: cover.rows] > CHOSEN)
