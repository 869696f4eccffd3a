"""Visibility -> selection: as few candidates as see the required shares of what is visible.

A method is a function `(cover, settings) -> (rows, bound)`: rows that meet every demand, and a number
of rows that no selection goes below.
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
from stopgo.planner.overlap import links_of
from stopgo.planner.selection.bound import counting_bound, lower_bound
from stopgo.planner.selection.connected_selection import JoinedCover, Search, connected
from stopgo.planner.selection.cover import Cover, cover_of
from stopgo.planner.selection.demands import demands_of
from stopgo.planner.selection.exact_cover import exact
from stopgo.planner.selection.greedy import greedy, in_greedy_order
from stopgo.planner.selection.improve import improved
from stopgo.planner.selection.separators import Conditions

Selector = Callable[[Cover, Settings], tuple[IntArray, int]]


def _greedy(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    rows = greedy(cover)
    return rows, lower_bound(cover, found=len(rows))


def _default(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    start, bound = _greedy(cover, settings)
    return improved(cover, start, at_least=bound), bound


def _exact(cover: Cover, settings: Settings) -> tuple[IntArray, int]:
    start, bound = _default(cover, settings)
    if len(start) <= bound:
        return start, bound
    rows, proved = exact(cover, start, settings=settings)
    return rows, max(bound, proved)


QUICK_SWAPS = 20
"""Swaps for each stop that a plan made only to tell about how many it takes tries to do without."""
ROUNDS = 6
"""Times that the default looks at what parts its selection."""
EXACT_ROUNDS = 60
SWAPS_BETWEEN = 120
"""Swaps tried in each of those rounds before a smaller selection is given up."""
METHODS: dict[str, Selector] = {"default": _default, "greedy": _greedy, "exact": _exact, "anywhere": _default}
NAMES = {
    "default": "greedy, drop-and-repair",
    "greedy": "greedy",
    "exact": "greedy, drop-and-repair, branch and bound",
    "anywhere": "greedy, drop-and-repair",
}


def select(visibility: Visibility) -> Selection:
    """Choose stops by the method named in the settings, and say how few there could be at best.

    Stops that must be used, and doorways added for registration, are chosen first and count. Where scans are
    to register with one another, doorways are offered too.
    """
    settings = visibility.candidates.space.settings
    method = variant("selector", settings.selector, METHODS)
    whole, fixed, problem = posed(visibility)
    if settings.least_overlap > 0:
        rows, bound = _connected(visibility, whole, fixed, np.arange(whole.rows), method)
        return _selection(visibility, whole, rows, bound, method)
    rows, bound = _solved(method, problem, settings)
    chosen = np.concatenate([fixed, in_greedy_order(problem, rows)]).astype(np.int64)
    return _selection(visibility, whole, chosen, len(fixed) + bound, method)


def quick(visibility: Visibility) -> tuple[int, int]:
    """About how many stops it takes, by few swaps after greedy, and the number that no choice goes below."""
    _, fixed, problem = posed(visibility)
    start, bound = _greedy(problem, visibility.candidates.space.settings)
    rows = improved(problem, start, at_least=bound, swaps=QUICK_SWAPS)
    return len(fixed) + len(rows), len(fixed) + bound


def posed(visibility: Visibility) -> tuple[Cover, IntArray, Cover]:
    """The whole problem, the rows that are chosen in any case, and what is left to choose after them."""
    candidates = visibility.candidates
    settings = candidates.space.settings
    whole = cover_of(visibility, demands_of(visibility))
    fixed = np.union1d(candidates.must_rows, candidates.doorway_rows if settings.door_scan else [])
    fixed = fixed.astype(np.int64)
    offered = np.arange(whole.rows)
    if not settings.door_candidates:
        offered = np.setdiff1d(offered, candidates.doorway_rows)
    return whole, fixed, whole.after(fixed).offering(offered)


def _connected(
    visibility: Visibility, whole: Cover, fixed: IntArray, offered: IntArray, method: Variant[Selector]
) -> tuple[IntArray, int]:
    """Rows whose scans register with one another, and a bound: one network, or as few as are possible.

    `fixed` come first, and are among those `offered`.
    """
    settings = visibility.candidates.space.settings
    cover = whole.with_one_of_each([np.array([row]) for row in fixed])
    task = JoinedCover(cover, links_of(visibility.candidates), offered)
    if method.name == "exact":
        rows, bound = connected(task, Searches.exact(settings), rounds=EXACT_ROUNDS)
    elif method.name == "default":
        rows, bound = connected(task, Searches.default(settings), rounds=ROUNDS)
    else:
        rows, bound = connected(task, lambda cover, *_: _solved(method, cover, settings), rounds=1)
    if method.ours:
        bound = max(bound, lower_bound(task.problem, found=len(rows)))
    problem = whole.after(fixed)
    others = in_greedy_order(problem, np.setdiff1d(rows, fixed))
    return np.concatenate([fixed, others]).astype(np.int64), bound


class Searches:
    """How our own methods look for fewer rows, from some that solve the problem and under conditions."""

    @staticmethod
    def default(settings: Settings) -> Search:
        """Drop-and-repair; the conditions are left to what joins its pieces."""
        return lambda cover, start, conditions: (
            improved(cover, start, at_least=counting_bound(cover), swaps=SWAPS_BETWEEN),
            0,
        )

    @staticmethod
    def exact(settings: Settings) -> Search:
        """Branch and bound, after drop-and-repair."""

        def search(cover: Cover, start: IntArray, conditions: Conditions) -> tuple[IntArray, int]:
            free = not len(conditions.least)
            better = improved(cover, start, at_least=counting_bound(cover)) if free else start
            return exact(cover, better, settings=settings, conditions=conditions)

        return search


def select_further(visibility: Visibility, done: IntArray) -> Selection:
    """As few candidates as see what the rows `done` leave of what is asked for; none where that is nothing.

    Where scans are to register with one another, they join those that were taken, too.

    Raises
    ------
    NegativeResult
        When it cannot be reached.
    """
    settings = visibility.candidates.space.settings
    method = variant("selector", settings.selector, METHODS)
    if settings.least_overlap > 0:
        whole = cover_of(visibility, demands_of(visibility))
        both, bound = _connected(visibility, whole, done, offered_further(visibility, done), method)
    else:
        whole, problem = left_by(visibility, done)
        rows, more = _solved(method, problem, settings)
        both, bound = np.concatenate([done, in_greedy_order(problem, rows)]), len(done) + more
    made = _selection(visibility, whole, both.astype(np.int64), bound, method)
    return replace(
        made,
        chosen=frozen(both[len(done) :], np.int64),
        coverage_steps=frozen(made.coverage_steps[len(done) :]),
        bound=bound,
    )


def offered_further(visibility: Visibility, done: IntArray) -> IntArray:
    """Rows that a further mission may join scans by, with those that were taken."""
    candidates = visibility.candidates
    left_out = np.setdiff1d(candidates.extra_rows, np.union1d(done, candidates.doorway_rows))
    return np.setdiff1d(np.arange(visibility.rows), left_out)


def left_by(visibility: Visibility, done: IntArray) -> tuple[Cover, Cover]:
    """The whole problem, and what the rows `done` leave of it to others."""
    whole = cover_of(visibility, demands_of(visibility))
    not_offered = np.union1d(done, visibility.candidates.extra_rows)
    return whole, whole.after(done).offering(np.setdiff1d(np.arange(whole.rows), not_offered))


def _solved(method: Variant[Selector], problem: Cover, settings: Settings) -> tuple[IntArray, int]:
    """The rows and the bound that a method gives, if they are some and meet every demand."""
    given, told = method.several(method.called(problem, settings), "rows, bound")
    rows = method.indices(given, "rows", length=None, below=problem.rows)
    bound = int(method.indices([told], "bound", length=1, below=len(rows) + 1)[0])
    if len(set(rows.tolist())) < len(rows):
        raise method.wrong("gave a row twice")
    missed = np.flatnonzero(problem.missing(problem.covered_by(rows)))
    if len(missed) and not method.ours:
        raise method.wrong(f"its {len(rows)} rows leave {len(missed)} of the coverages asked for unmet")
    return rows, bound


def _selection(
    visibility: Visibility, whole: Cover, chosen: IntArray, bound: int, method: Variant[Selector]
) -> Selection:
    settings = visibility.candidates.space.settings
    steps = coverage_steps(whole, chosen)
    if whole.missing(whole.covered_by(chosen))[0] > 0:
        name, reached = visibility.candidates.space.floor.name, steps[-1] if len(steps) else 0.0
        raise NegativeResult(
            f"{name}: coverage {reached:.3f} is reached, not {settings.coverage:g}; "
            "lower --coverage or offer more candidates"
        )
    proved = ", proved fewest" if method.ours else ", by its own word fewest"
    return Selection(
        visibility=visibility,
        chosen=frozen(chosen, np.int64),
        coverage_steps=frozen(steps),
        required=settings.coverage,
        bound=bound,
        method=NAMES.get(method.name, method.name) + (proved if len(chosen) == bound else ""),
    )


def coverage_steps(cover: Cover, rows: IntArray) -> FloatArray:
    """Coverage of the whole after each row."""
    counted, steps = np.zeros(cover.columns, dtype=np.int64), []
    for row in rows:
        counted[cover.columns_of(int(row))] += 1
        steps.append(cover.seen_weight(counted) / cover.total)
    return np.array(steps)


__all__ = [
    "METHODS",
    "Selector",
    "coverage_steps",
    "left_by",
    "offered_further",
    "posed",
    "quick",
    "select",
    "select_further",
]
