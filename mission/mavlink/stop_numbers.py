"""Stop ids as numbers, for items that carry nothing else."""

from __future__ import annotations

import re

from stopgo.mission.document import Mission

LARGEST = 65_535
"""Largest number that every field for a stop's number holds exactly: uint16, far below float32's 2^24."""


def numbers_of(mission: Mission) -> tuple[int, ...]:
    """Return a number for each stop: that of its id, "S07" is 7; else, for all stops, the index from 1.

    The ids' own numbers are taken only if every id has one and no two have the same.
    """
    own = [_number(stop.id) for stop in mission.stops]
    numbers = [number for number in own if number is not None and number <= LARGEST]
    if len(set(numbers)) == len(mission.stops):
        return tuple(numbers)
    return tuple(range(1, len(mission.stops) + 1))


def stop_numbered(mission: Mission, number: float) -> str | None:
    """Return the id of the stop that `numbers_of` gives this number; None if there is none."""
    ids = dict(zip(numbers_of(mission), (stop.id for stop in mission.stops), strict=True))
    return ids.get(int(number)) if number == round(number) else None


def _number(name: str) -> int | None:
    digits = re.search(r"[0-9]+$", name)
    return int(digits.group()) if digits else None
