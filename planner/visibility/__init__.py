"""Candidates -> visibility: which units each candidate sees.

A method is a function `(candidates) -> Visibility`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from stopgo.mission.console.plugins import Variant, variant
from stopgo.mission.errors import NegativeResult
from stopgo.mission.geometry import frozen
from stopgo.mission.stages import Candidates, Visibility
from stopgo.planner.visibility.bresenham import bresenham
from stopgo.planner.visibility.exact_sight import exact
from stopgo.planner.visibility.headings import with_headings
from stopgo.planner.visibility.limited import within_limits

VisibilityMethod = Callable[[Candidates], Visibility]
METHODS: dict[str, VisibilityMethod] = {"exact": exact, "bresenham": bresenham}


def visibility(candidates: Candidates) -> Visibility:
    """What the kept candidates see, by the method named in the settings.

    What is not seen within the settings' limits counts as not seen, whatever the method. With a field of view
    below 360° the candidates of the result are positions with headings.
    """
    settings = candidates.space.settings
    method = variant("visibility", settings.visibility, METHODS)
    found = _sound(method, method.called(candidates), candidates)
    if not len(found.first):
        raise NegativeResult(
            f"{candidates.space.floor.name}: no target is within {settings.range:g} m of a candidate "
            "and in its sight; raise --range or lower --grid"
        )
    return seen_well(found)


def seen_well(in_sight: Visibility) -> Visibility:
    """What of the things in sight is seen within the settings' limits, and along which headings.

    Raises
    ------
    NegativeResult
        When the limits leave nothing.
    """
    seen = within_limits(in_sight)
    return with_headings(seen) if in_sight.candidates.space.settings.fov < 360 else seen


def _sound(method: Variant[VisibilityMethod], given: object, candidates: Candidates) -> Visibility:
    """What a method gives, if it is runs of units on segments, in order, for each kept candidate."""
    found: Visibility = method.of_kind(given, Visibility)
    if found.candidates is not candidates:
        raise method.wrong("is of other candidates than those it was given")
    targets = candidates.space.targets
    runs = len(found.first)
    pointer = method.indices(found.pointer, "pointer", length=len(candidates.kept) + 1, below=runs + 1)
    segment = method.indices(found.segment, "segment", length=runs, below=len(targets.units))
    first = method.indices(found.first, "first", length=runs, below=targets.total)
    last = method.indices(found.last, "last", length=runs, below=targets.total)
    if (np.diff(pointer) < 0).any() or pointer[0] != 0 or pointer[-1] != runs:
        raise method.wrong("pointer does not go from 0 up to the number of runs")
    of = targets.unit_segment
    if (last < first).any() or (of[first] != segment).any() or (of[last] != segment).any():
        raise method.wrong("a run's units do not lie on its segment")
    if method.ours:
        return found
    method.of_kind(found.method, str)
    pointer, segment, first, last = (frozen(values, np.int64) for values in (pointer, segment, first, last))
    return Visibility(candidates, pointer, segment, first, last, found.method)


__all__ = ["METHODS", "VisibilityMethod", "seen_well", "visibility"]
