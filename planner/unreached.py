"""Rooms that a plan does not enter, each with the reason."""

from __future__ import annotations

import numpy as np

from mission.planning import AT_EDGE, IN_HOLE, KEPT, OTHER_PART, TOO_CLOSE, UNREACHABLE, Candidates, Unreached

LEAST_AREA = 0.01
"""Rooms smaller than this (m²) are not told of."""


def unreached(candidates: Candidates, elsewhere: frozenset[int] = frozenset()) -> tuple[Unreached, ...]:
    """Every room without a reachable candidate of this part, with its area.

    `elsewhere` are rooms (indices into `NavigableSpace.rooms`) that plans of other parts enter.
    """
    space = candidates.space
    told = []
    for index, room in enumerate(space.rooms):
        reasons = candidates.reason[candidates.room == index]
        area = sum(polygon.area for polygon in room.area)
        if area > LEAST_AREA and index not in elsewhere and not np.any(reasons == KEPT):
            told.append(Unreached(room.name, _why(candidates, index, set(reasons.tolist())), area))
    return tuple(told)


def entered(candidates: Candidates) -> frozenset[int]:
    """Rooms with a reachable candidate of this part."""
    return frozenset(candidates.room[candidates.kept].tolist())


def _why(candidates: Candidates, index: int, reasons: set[int]) -> str:
    settings = candidates.space.settings
    closed = _closed_openings(candidates, index)
    if candidates.space.rooms[index].room is None and candidates.space.floor.rooms:
        return "outside every room, and no inner opening leads there"
    if OTHER_PART in reasons:
        told = f"in another part of the floor ({closed})" if closed else "in another part of the floor"
        return f"{told}; --all-parts plans it too"
    if UNREACHABLE in reasons:
        return f"the robot does not fit in ({closed or 'too narrow'})"
    if TOO_CLOSE in reasons:
        return f"no place {settings.d_sec:g} m from every element"
    if AT_EDGE in reasons:
        return f"no place {settings.edge:g} m from the floor's edges"
    return "no floor in it" if IN_HOLE in reasons else "no place for a stop"


def _closed_openings(candidates: Candidates, index: int) -> str:
    """The openings of a room that are not passable, in words."""
    room = candidates.space.rooms[index].room
    if room is None:
        return ""
    closed = [item for item in candidates.space.openings if room in item.rooms and not item.passable]
    return "; ".join(f"{item.opening.kind} {item.opening.id}: {item.why}" for item in closed)
