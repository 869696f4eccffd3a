"""Candidates -> visibility: the units that each candidate sees.

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
from stopgo.planner.visibility.solid_rays import clear_of_solids

VisibilityMethod = Callable[[Candidates], Visibility]
METHODS: dict[str, VisibilityMethod] = {"exact": exact, "bresenham": bresenham}


def visibility(candidates: Candidates) -> Visibility:
    """The units that the kept candidates see, by the method of the settings.

    Units outside the settings' limits on views count as not seen, with any method. So do units that no ray
    reaches past the floor's solids, where these are known. With a field of view below 360° the candidates
    of the result are positions with headings.
    """
    settings = candidates.settings
    method = variant("visibility", settings.visibility, METHODS)
    found = clear_of_solids(_checked(method, method.called(candidates), candidates))
    if not len(found.first):
        raise NegativeResult(
            f"{candidates.floor.name}: no target is visible within {settings.range:g} m of a "
            "candidate; raise --range or lower --grid"
        )
    return within_all_limits(found)


def within_all_limits(visible: Visibility) -> Visibility:
    """The part of a visibility within the settings' limits on views, and along the scanner's headings.

    Raises
    ------
    NegativeResult
        If the limits leave nothing.
    """
    seen = within_limits(visible)
    return with_headings(seen) if visible.settings.fov < 360 else seen


def _checked(method: Variant[VisibilityMethod], given: object, candidates: Candidates) -> Visibility:
    """A method's result, checked: ordered runs of units on segments for each kept candidate."""
    found: Visibility = method.of_kind(given, Visibility)
    if found.candidates is not candidates:
        raise method.wrong("is of other candidates than those it was given")
    if method.ours:
        return found
    targets = candidates.targets
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
    method.of_kind(found.method, str)
    pointer, segment, first, last = (frozen(values, np.int64) for values in (pointer, segment, first, last))
    return Visibility(candidates, pointer, segment, first, last, found.method)


__all__ = ["METHODS", "VisibilityMethod", "visibility", "within_all_limits"]
