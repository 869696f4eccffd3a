"""Visibility -> selection: the fewest candidates that see the required fractions of what is visible.

A method is a function `(cover, settings) -> (rows, bound)`: rows that meet every demand, and a lower
bound on the number of rows of any selection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from stopgo.mission.console.plugins import Variant, variant
from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import FloatArray, IntArray, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection, Visibility
from stopgo.planner.geometry.instance_cache import forget, instance_cached, taken
from stopgo.planner.overlap import links_of
from stopgo.planner.selection.bound import (
    FEW,
    FINE,
    LARGEST,
    coarse_bound,
    counting_bound,
    early_bound,
    first_bound,
    likely_rows,
    lower_bound,
    relaxation_bound,
)
from stopgo.planner.selection.connected_selection import ConnectedCover, Search, connected
from stopgo.planner.selection.cover import Cover, cover_of
from stopgo.planner.selection.demands import demands_of
from stopgo.planner.selection.exact_cover import exact
from stopgo.planner.selection.greedy import greedy, in_greedy_order
from stopgo.planner.selection.improve import (
    EntriesLeft,
    found_among,
    improved,
    improved_otherwise,
    repaired_again,
)
from stopgo.planner.selection.separators import Conditions

Selector = Callable[[Cover, Settings], tuple[IntArray, int]]
BoundOf = Callable[..., int]
"""`(problem, found=rows)`: a lower bound on the rows of any selection."""


def _greedy(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    rows = greedy(cover)
    return rows, lower_bound(cover, found=len(rows))


def _default(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    start = greedy(cover)
    bound = early_bound(cover, found=len(start))
    rows = improved(cover, start, at_least=bound)
    rows = improved_otherwise(cover, rows, at_least=bound, work=EntriesLeft())
    return rows, bound if len(rows) <= bound else max(bound, lower_bound(cover, found=len(rows)))


def _draft(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    """The rows of the default method before the removal of other rows, with a bound by counting."""
    bound = counting_bound(cover)
    return improved(cover, greedy(cover), at_least=bound), bound


def _exact(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    start, bound = _default(cover, settings)
    if len(start) <= bound:
        return start, bound
    rows, proved = exact(cover, start, settings=settings)
    return rows, max(bound, proved)


QUICK_SWAPS = 20
"""Swaps per removed stop in a plan that only estimates the number of stops."""
ROUNDS = 12
"""Rounds in which the default method adds cuts to connect its selection."""
GUIDED = 150
"""Most stops of a selection that is searched for again among the rows that a relaxation uses."""
PATIENCE = 3
"""Rounds without fewer stops after which it adds no more."""
EXACT_ROUNDS = 60
"""The same for the exact method."""
METHODS: dict[str, Selector] = {"default": _default, "greedy": _greedy, "exact": _exact, "anywhere": _default}
NAMES = {
    "default": "greedy, drop-and-repair",
    "greedy": "greedy",
    "exact": "greedy, drop-and-repair, branch and bound",
    "anywhere": "greedy, drop-and-repair",
}


def select(visibility: Visibility, *, joined: bool = True, bound_of: BoundOf = lower_bound) -> Selection:
    """Choose stops by the method of the settings, with a lower bound on their number.

    Required stops, and doorways added for registration, are chosen first and count. Where scans must
    register with one another, doorways are offered too. Not `joined`, the scans need not register, and the
    default method's bound is by counting. The bound of scans that register is that of `bound_of`.
    """
    settings = visibility.settings
    method = variant("selector", settings.selector, METHODS)
    whole, fixed, problem = cover_problem(visibility)
    if settings.registers and joined:
        rows, bound = _connected(visibility, whole, fixed, np.arange(whole.rows), method, bound_of)
        return _selection(visibility, whole, rows, bound, method)
    if method.name == "default" and not joined:
        rows, bound = _draft(problem, settings)
    else:
        rows, bound = _solved(method, problem, settings)
    chosen = np.concatenate([fixed, in_greedy_order(problem, rows)]).astype(np.int64)
    return _selection(visibility, whole, chosen, len(fixed) + bound, method)


def quick_estimate(visibility: Visibility) -> tuple[int, int]:
    """Estimated number of stops, from greedy and a few swaps, and a first lower bound on it."""
    _, fixed, problem = cover_problem(visibility)
    start = greedy(problem)
    bound = first_bound(problem, found=len(start))
    rows = improved(problem, start, at_least=bound, swaps=QUICK_SWAPS)
    return len(fixed) + len(rows), len(fixed) + bound


def quick_count(visibility: Visibility) -> int:
    """The estimate of `quick_estimate` alone."""
    _, fixed, problem = cover_problem(visibility)
    return len(fixed) + len(improved(problem, greedy(problem), at_least=0, swaps=QUICK_SWAPS))


def greedy_takes_at_most(most: int, visibility: Visibility) -> bool:
    """True if a greedy selection whose scans need not register has so many stops or fewer."""
    _, fixed, problem = cover_problem(visibility)
    if len(fixed) + counting_bound(problem) > most:
        return False
    return len(fixed) + len(greedy(problem)) <= most


@instance_cached
def _whole(visibility: Visibility) -> Cover:
    return cover_of(visibility, demands_of(visibility))


LARGE = 4_000_000
"""Entries of a covering matrix, from which on it is not kept: 40 MB."""


def forget_large_cover(visibility: Visibility) -> None:
    """Forget the problem of a visibility from which nothing is selected soon, if it takes much memory."""
    if _whole(visibility).sees.nnz > LARGE:
        forget(_whole, visibility)


def cover_problem(visibility: Visibility) -> tuple[Cover, IntArray, Cover]:
    """The whole problem, the required rows, and the problem that remains after them."""
    candidates = visibility.candidates
    settings = candidates.settings
    whole = _whole(visibility)
    fixed = np.union1d(candidates.must_rows, candidates.doorway_rows if settings.door_scan else [])
    fixed = fixed.astype(np.int64)
    offered = np.arange(whole.rows)
    if not settings.door_candidates:
        offered = np.setdiff1d(offered, candidates.doorway_rows)
    return whole, fixed, whole.after(fixed).offering(offered)


def _connected(
    visibility: Visibility,
    whole: Cover,
    fixed: IntArray,
    offered: IntArray,
    method: Variant[Selector],
    bound_of: BoundOf = lower_bound,
) -> tuple[IntArray, int]:
    """Rows whose scans form one network by registration, or as few networks as possible; and a bound.

    Rows `fixed` come first and are among the rows `offered`.
    """
    settings = visibility.settings
    cover = whole.with_one_of_each([np.array([row]) for row in fixed])
    task = ConnectedCover(cover, taken(links_of, visibility.candidates), offered)
    if method.name == "exact":
        rows, bound = connected(task, Searches.exact(settings), rounds=EXACT_ROUNDS)
    elif method.name == "default":
        rows, bound = connected(task, Searches.default(task), rounds=ROUNDS, patience=PATIENCE)
        rows, bound = _connected_again(task, rows, bound)
    else:
        rows, bound = connected(task, lambda cover, *_: _solved(method, cover, settings), rounds=1)
    if method.ours and bound < len(rows):
        problem = task.problem
        del task, cover  # before another process is forked for the bound: the links are large
        bound = max(bound, bound_of(problem, found=len(rows)))
    problem = whole.after(fixed)
    others = in_greedy_order(problem, np.setdiff1d(rows, fixed))
    return np.concatenate([fixed, others]).astype(np.int64), bound


def _connected_again(task: ConnectedCover, rows: IntArray, bound: int) -> tuple[IntArray, int]:
    """Fewer rows, searched for from those that a relaxation uses, where that may help and is quick."""
    problem, coarse = task.problem, task.problem.sees.nnz > FINE
    largest = LARGEST if len(rows) <= FEW else FINE
    if bound >= len(rows) - 1 or len(rows) > GUIDED or problem.sees.nnz > largest:
        return rows, bound
    bound = max(bound, coarse_bound(problem) if coarse else relaxation_bound(problem))
    if bound >= len(rows) - 1:
        return rows, bound
    search = Searches.default(task, likely=likely_rows(problem, coarse=coarse))
    return connected(task, search, rounds=ROUNDS, patience=PATIENCE, known=(rows, bound))


class Searches:
    """Searches of our own methods for fewer rows, from a known solution and under conditions."""

    @staticmethod
    def default(task: ConnectedCover, likely: IntArray | None = None) -> Search:
        """Drop-and-repair, under the conditions too, though not all of them are necessary.

        It begins with a selection of the rows `likely`, if they are given and see enough.
        The first bound holds for later problems too, which only have more demands. The rows found last are
        repaired first, since they miss little but the newest demands.
        """
        bound, last, settled, work = 0, np.empty(0, np.int64), set[int](), EntriesLeft()

        def search(cover: Cover, start: IntArray, conditions: Conditions) -> tuple[IntArray, int]:
            nonlocal bound, last
            bound = bound or early_bound(cover, found=len(start))
            sets = conditions.sets
            if sets:
                cover.forget_seers()  # before the next one: each is a large part of the memory
            asked = cover.with_one_of_each(sets)
            again = repaired_again(asked, last) if 0 < len(last) < len(start) else None
            if likely is not None and not len(last):
                again = found_among(asked, likely, at_least=bound)
            first = start if again is None else again
            last = improved(asked, first, at_least=bound, settled=settled)
            if not task.parts(last):
                last = improved_otherwise(asked, last, at_least=bound, work=work)
            return last, bound

        return search

    @staticmethod
    def exact(settings: Settings) -> Search:
        """Branch and bound, after drop-and-repair."""

        def search(cover: Cover, start: IntArray, conditions: Conditions) -> tuple[IntArray, int]:
            free = not len(conditions.least)
            better = improved(cover, start, at_least=counting_bound(cover)) if free else start
            return exact(cover, better, settings=settings, conditions=conditions)

        return search


def select_follow_up(visibility: Visibility, done: IntArray) -> Selection:
    """The fewest candidates that see what the rows `done` leave to see; none where nothing is left.

    Where scans must register with one another, the new scans also register with the existing ones.

    Raises
    ------
    NegativeResult
        If the required coverage cannot be reached.
    """
    settings = visibility.settings
    method = variant("selector", settings.selector, METHODS)
    if settings.registers:
        whole = cover_of(visibility, demands_of(visibility))
        both, bound = _connected(visibility, whole, done, offered_for_follow_up(visibility, done), method)
    else:
        whole, problem = remaining_cover(visibility, done)
        rows, more = _solved(method, problem, settings)
        both, bound = np.concatenate([done, in_greedy_order(problem, rows)]), len(done) + more
    made = _selection(visibility, whole, both.astype(np.int64), bound, method)
    return replace(
        made,
        chosen=frozen(both[len(done) :], np.int64),
        coverage_steps=frozen(made.coverage_steps[len(done) :]),
        bound=bound,
    )


def offered_for_follow_up(visibility: Visibility, done: IntArray) -> IntArray:
    """Rows that may connect scans in a follow-up mission, with those already scanned."""
    candidates = visibility.candidates
    left_out = np.setdiff1d(candidates.extra_rows, np.union1d(done, candidates.doorway_rows))
    return np.setdiff1d(np.arange(visibility.rows), left_out)


def remaining_cover(visibility: Visibility, done: IntArray) -> tuple[Cover, Cover]:
    """The whole problem, and the problem that remains after the rows `done`."""
    whole = cover_of(visibility, demands_of(visibility))
    not_offered = np.union1d(done, visibility.candidates.extra_rows)
    return whole, whole.after(done).offering(np.setdiff1d(np.arange(whole.rows), not_offered))


def _solved(method: Variant[Selector], problem: Cover, settings: Settings) -> tuple[IntArray, int]:
    """The rows and the bound that a method returns, after a check of both."""
    given, reported = method.several(method.called(problem, settings), "rows, bound")
    rows = method.indices(given, "rows", length=None, below=problem.rows)
    bound = int(method.indices([reported], "bound", length=1, below=len(rows) + 1)[0])
    if len(set(rows.tolist())) < len(rows):
        raise method.wrong("gave a row twice")
    missed = np.flatnonzero(problem.missing(problem.covered_by(rows)))
    if len(missed) and not method.ours:
        raise method.wrong(f"its {len(rows)} rows leave {len(missed)} of the required coverages unmet")
    return rows, bound


def _selection(
    visibility: Visibility, whole: Cover, chosen: IntArray, bound: int, method: Variant[Selector]
) -> Selection:
    settings = visibility.settings
    steps = coverage_steps(whole, chosen)
    if whole.missing(whole.covered_by(chosen))[0] > 0:
        name, reached = visibility.floor.name, steps[-1] if len(steps) else 0.0
        raise NegativeResult(
            f"{name}: coverage reaches {reached:.3f}, not {settings.coverage:g}; "
            "lower --coverage or offer more candidates"
        )
    proved = ", proved fewest" if method.ours else ", fewest as reported"
    return Selection(
        visibility=visibility,
        chosen=frozen(chosen, np.int64),
        coverage_steps=frozen(steps),
        required=settings.coverage,
        bound=bound,
        method=NAMES.get(method.name, method.name) + (proved if len(chosen) == bound else ""),
    )


def coverage_steps(cover: Cover, rows: IntArray) -> FloatArray:
    """Fraction of the whole that is covered after each row."""
    counted, steps = np.zeros(cover.columns, dtype=np.int64), []
    seen = cover.seen_weight(counted)
    for row in rows:
        columns = cover.columns_of(int(row))
        counted[columns] += 1
        seen += int(cover.weight[columns[counted[columns] == cover.asks[columns]]].sum())
        steps.append(seen / cover.total)
    return np.array(steps)


__all__ = [
    "METHODS",
    "BoundOf",
    "Selector",
    "cover_problem",
    "coverage_steps",
    "forget_large_cover",
    "greedy_takes_at_most",
    "offered_for_follow_up",
    "quick_count",
    "quick_estimate",
    "remaining_cover",
    "select",
    "select_follow_up",
]
