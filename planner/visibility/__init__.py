"""Candidates -> visibility: which units each candidate sees.

A method is a function `(candidates) -> Visibility`.
"""

from __future__ import annotations

from collections.abc import Callable

from mission.errors import AnswerIsNo, InputError
from mission.planning import Candidates, Visibility
from planner.visibility.bresenham import bresenham
from planner.visibility.exact import exact

Method = Callable[[Candidates], Visibility]
METHODS: dict[str, Method] = {"exact": exact, "bresenham": bresenham}


def visibility(candidates: Candidates) -> Visibility:
    """What the kept candidates see, by the method named in the settings."""
    settings = candidates.space.settings
    if settings.visibility not in METHODS:
        raise InputError(f"visibility = {settings.visibility}: unknown; known: {', '.join(METHODS)}")
    found = METHODS[settings.visibility](candidates)
    if not len(found.first):
        raise AnswerIsNo(
            f"{candidates.space.floor.name}: no target is within {settings.range:g} m of a candidate "
            "and in its sight; raise --range or lower --grid"
        )
    return found


__all__ = ["METHODS", "Method", "visibility"]
