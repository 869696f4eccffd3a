"""Positions that do not come from a strategy: doorways, and stops that the user requires."""

from __future__ import annotations

import numpy as np

from stopgo.mission.errors import InputError
from stopgo.mission.stages import DROP_REASONS, KEPT, NavigableSpace
from stopgo.planner.candidates.proposals import Proposals
from stopgo.planner.space.stop_feasibility import StopFeasibility


def doorways(space: NavigableSpace) -> Proposals:
    """Middle of every opening that is driven through, if the settings require it or it may join scans."""
    settings = space.settings
    if not (settings.door_scan or settings.door_candidates or settings.registers):
        return Proposals.of(np.empty((0, 2)), [])
    index = {item.room: k for k, item in enumerate(space.rooms) if item.room is not None}
    passable = [item for item in space.openings if item.passable]
    rooms = [next((index[k] for k in item.rooms if k is not None), 0) for item in passable]
    return Proposals.of([item.middle for item in passable], rooms, doorway=True)


def required_stops(feasibility: StopFeasibility) -> Proposals:
    """Return the stops that the user requires.

    Raises
    ------
    InputError
        Where a stop is not allowed; it names the position and the reason.
    """
    points = np.array(feasibility.space.settings.use, dtype=np.float64).reshape(-1, 2)
    rooms = [feasibility.room_at(point) for point in points]
    for point, room in zip(points, rooms, strict=True):
        reason = int(feasibility.reasons(point[None], np.array([room]))[0])
        if reason != KEPT:
            why = DROP_REASONS[reason]
            raise InputError(
                f"--require-stop {point[0]:g},{point[1]:g}: a stop is not allowed there ({why}); "
                "choose another position"
            )
    return Proposals.of(points, rooms, must=True)
