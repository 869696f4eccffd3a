"""Candidates -> visibility: which units each candidate sees.

A method is a function `(candidates) -> Visibility`.
"""

from __future__ import annotations

from collections.abc import Callable

from mission.errors import AnswerIsNo, InputError
from mission.planning import Candidates, Visibility
from planner.visibility.bresenham import bresenham
from planner.visibility.exact_sight import exact
from planner.visibility.headings import with_headings

VisibilityMethod = Callable[[Candidates], Visibility]
METHODS: dict[str, VisibilityMethod] = {"exact": exact, "bresenham": bresenham}


def visibility(candidates: Candidates) -> Visibility:
    """What the kept candidates see, by the method named in the settings.

    With a field of view below 360° the candidates of the result are positions with headings.
    """
    settings = candidates.space.settings
    if settings.visibility not in METHODS:
        raise InputError(f"visibility = {settings.visibility}: unknown; known: {', '.join(METHODS)}")
    found = METHODS[settings.visibility](candidates)
    if not len(found.first):
        raise AnswerIsNo(
            f"{candidates.space.floor.name}: no target is within {settings.range:g} m of a candidate "
            "and in its sight; raise --range or lower --grid"
        )
    return with_headings(found) if settings.fov < 360 else found


__all__ = ["METHODS", "VisibilityMethod", "visibility"]
