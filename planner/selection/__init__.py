"""Visibility -> selection: as few candidates as see the required share of what is visible.

A method is a function `(cover, settings) -> (rows, bound)`: rows that cover what is needed, and a number
of rows that no selection goes below.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mission.errors import AnswerIsNo, InputError
from mission.geometry import FloatArray, IntArray, frozen
from mission.planning import Selection, Visibility
from mission.settings import Settings
from planner.selection.bound import lower_bound
from planner.selection.cover import Cover, cover_of
from planner.selection.exact import exact
from planner.selection.greedy import greedy, in_greedy_order
from planner.selection.improve import improved

Method = Callable[[Cover, Settings], tuple[IntArray, int]]


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


METHODS: dict[str, Method] = {"default": _default, "greedy": _greedy, "exact": _exact}
NAMES = {
    "default": "greedy, drop-and-repair",
    "greedy": "greedy",
    "exact": "greedy, drop-and-repair, branch and bound",
}


def select(visibility: Visibility) -> Selection:
    """Choose stops by the method named in the settings, and say how few there could be at best.

    Stops that must be used are chosen first and count; doorways added for registration come last.
    """
    candidates = visibility.candidates
    settings = candidates.space.settings
    if settings.selector not in METHODS:
        raise InputError(f"selector = {settings.selector}: unknown; known: {', '.join(METHODS)}")
    whole = cover_of(visibility, required=settings.coverage)
    must = candidates.must_rows
    offered = np.arange(whole.rows)
    if not settings.door_candidates:
        offered = np.setdiff1d(offered, candidates.doorway_rows)
    problem = whole.after(must).offering(offered)
    rows, bound = METHODS[settings.selector](problem, settings)
    chosen = np.concatenate([must, in_greedy_order(problem, rows)]).astype(np.int64)
    if not settings.door_scan:
        return _selection(visibility, whole, chosen, len(must) + bound)
    fixed = np.union1d(must, candidates.doorway_rows)
    left = lower_bound(whole.after(fixed).offering(offered), found=len(rows))
    return _selection(visibility, whole, _with(chosen, fixed), len(fixed) + left)


def _with(chosen: IntArray, fixed: IntArray) -> IntArray:
    """The chosen rows, then those of `fixed` that are not among them."""
    return np.concatenate([chosen, np.setdiff1d(fixed, chosen)])


def _selection(visibility: Visibility, whole: Cover, chosen: IntArray, bound: int) -> Selection:
    settings = visibility.candidates.space.settings
    steps = _coverage_steps(whole, chosen)
    if whole.units(whole.covered_by(chosen)) < whole.needed:
        name, reached = visibility.candidates.space.floor.name, steps[-1] if len(steps) else 0.0
        raise AnswerIsNo(
            f"{name}: coverage {reached:.3f} is reached, not {settings.coverage:g}; "
            "lower --coverage or offer more candidates"
        )
    proved = ", proved fewest" if len(chosen) == bound else ""
    return Selection(
        visibility=visibility,
        chosen=frozen(chosen, np.int64),
        coverage_steps=frozen(steps),
        required=settings.coverage,
        bound=bound,
        method=NAMES[settings.selector] + proved,
    )


def _coverage_steps(cover: Cover, rows: IntArray) -> FloatArray:
    """Coverage after each row."""
    counted, steps = np.zeros(len(cover.weight), dtype=np.int64), []
    for row in rows:
        counted[cover.columns_of(int(row))] += 1
        steps.append(cover.units(counted) / cover.total)
    return np.array(steps)


__all__ = ["METHODS", "Method", "select"]
