"""Visibility -> selection: as few candidates as see the required share of what is visible.

A method is a function `(cover, bound) -> rows`, where no selection has fewer rows than `bound`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mission.errors import InputError
from mission.geometry import FloatArray, IntArray, frozen
from mission.planning import Selection, Visibility
from planner.selection.bound import relaxation_bound
from planner.selection.cover import Cover, cover_of
from planner.selection.greedy import greedy, in_greedy_order
from planner.selection.improve import improved

Method = Callable[[Cover, int], IntArray]


def _greedy(cover: Cover, bound: int) -> IntArray:
    return greedy(cover)


def _default(cover: Cover, bound: int) -> IntArray:
    return improved(cover, greedy(cover), at_least=bound)


METHODS: dict[str, Method] = {"default": _default, "greedy": _greedy}
NAMES = {"default": "greedy, drop-and-repair", "greedy": "greedy"}


def select(visibility: Visibility) -> Selection:
    """Choose stops by the method named in the settings, and say how few there could be at best."""
    settings = visibility.candidates.space.settings
    if settings.selector not in METHODS:
        raise InputError(f"selector = {settings.selector}: unknown; known: {', '.join(METHODS)}")
    cover = cover_of(visibility, required=settings.coverage)
    bound = relaxation_bound(cover)
    rows = in_greedy_order(cover, METHODS[settings.selector](cover, bound))
    return Selection(
        visibility=visibility,
        chosen=frozen(rows, np.int64),
        coverage_steps=frozen(_coverage_steps(cover, rows)),
        required=settings.coverage,
        bound=bound,
        method=NAMES[settings.selector],
    )


def _coverage_steps(cover: Cover, rows: IntArray) -> FloatArray:
    return np.array([cover.units(cover.covered_by(rows[: k + 1])) / cover.total for k in range(len(rows))])


__all__ = ["METHODS", "Method", "select"]
