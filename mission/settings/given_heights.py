"""Heights of elements, openings and the ceiling of a drawing, as a person gives them."""

from __future__ import annotations

import math
from collections.abc import Iterable

from stopgo.mission.errors import InputError
from stopgo.mission.settings.element_kinds import KINDS

CEILING, DOORS, PASSAGES = "ceiling", "doors", "passages"
TOPS = (CEILING, DOORS, PASSAGES)
"""What has one height: the ceiling's underside, and the undersides of lintels."""
HIGHEST = 100.0
"""Metres above which nothing in a building is."""

GivenHeights = dict[str, tuple[float, float]]
"""Lower and upper height above the floor in metres by kind; twice the same for what has one height."""


def heights_by_kind(entries: Iterable[str]) -> GivenHeights:
    """Return the heights that entries such as `beams=2.4..2.8` or `ceiling=2.8` give.

    Raises
    ------
    InputError
        Naming the entry and what would be right.
    """
    found: GivenHeights = {}
    for entry in entries:
        kind, _, given = (part.strip() for part in entry.partition("="))
        known = (*KINDS, *TOPS)
        if kind not in known:
            raise InputError(f"--heights {entry}: no such kind; known: {', '.join(known)}")
        if kind in found:
            raise InputError(f"--heights {entry}: {kind} is given twice; give it once")
        found[kind] = _span(entry, kind, given)
    ceiling = found.get(CEILING, (HIGHEST, HIGHEST))[0]
    for kind, (low, _) in found.items():
        if low >= ceiling and kind != CEILING:
            raise InputError(f"--heights {kind}={low:g}: not below the ceiling at {ceiling:g} m; lower it")
    return found


def _span(entry: str, kind: str, given: str) -> tuple[float, float]:
    parts = given.split("..")
    try:
        values = [float(part) for part in parts]
    except ValueError:
        values = []
    if kind in TOPS and len(values) == 1:
        values = values * 2
    good = len(values) == 2 and all(math.isfinite(value) for value in values)
    if not good or len(parts) != (1 if kind in TOPS else 2):
        form = f"{kind}=2.1" if kind in TOPS else f"{kind}=LOW..HIGH, such as {kind}=0..0.8"
        raise InputError(f"--heights {entry}: write {form}, in metres above the floor")
    low, high = values
    if not 0 <= low <= high <= HIGHEST or high <= 0 or (low == high and kind not in TOPS):
        raise InputError(f"--heights {entry}: heights go upward, from 0 to {HIGHEST:g} m; correct them")
    return low, high
