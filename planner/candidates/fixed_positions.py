"""Positions that do not come from a strategy: doorways, and places the user asks for."""

from __future__ import annotations

import numpy as np
import shapely

from stopgo.mission.errors import InputError
from stopgo.mission.geometry import FloatArray
from stopgo.mission.stages import DROP_REASONS, KEPT, NavigableSpace, OpeningState
from stopgo.planner.candidates.proposals import Proposals
from stopgo.planner.geometry.shapes import local_origin, to_shape
from stopgo.planner.space.opening_joins import widest_clear
from stopgo.planner.space.stop_feasibility import StopFeasibility


def doorways(space: NavigableSpace) -> Proposals:
    """The middle of every opening the robot drives through, where that is asked for or may join scans."""
    settings = space.settings
    if not (settings.door_scan or settings.door_candidates or settings.least_overlap > 0):
        return Proposals.of(np.empty((0, 2)), [])
    index = {item.room: k for k, item in enumerate(space.rooms) if item.room is not None}
    obstacles = to_shape(space.obstacles, local_origin(space.floor))
    passable = [item for item in space.openings if item.passable]
    rooms = [next((index[k] for k in item.rooms if k is not None), 0) for item in passable]
    return Proposals.of([_middle(space, item, obstacles) for item in passable], rooms, doorway=True)


def _middle(space: NavigableSpace, state: OpeningState, obstacles: shapely.Geometry) -> FloatArray:
    """The middle of the opening's clear piece, in the drawing's coordinates."""
    origin = local_origin(space.floor)
    widest = widest_clear(shapely.LineString(state.opening.line - origin), obstacles)
    return shapely.get_coordinates(widest)[[0, -1]].mean(axis=0) + origin


def places_to_use(feasibility: StopFeasibility) -> Proposals:
    """The user's own stops.

    Raises
    ------
    InputError
        Where no stop may be, naming the feasibility and the reason.
    """
    points = np.array(feasibility.space.settings.use, dtype=np.float64).reshape(-1, 2)
    rooms = [feasibility.room_at(point) for point in points]
    for point, room in zip(points, rooms, strict=True):
        reason = int(feasibility.reasons(point[None], np.array([room]))[0])
        if reason != KEPT:
            raise InputError(f"use = {point[0]:g},{point[1]:g}: no stop may be there, {DROP_REASONS[reason]}")
    return Proposals.of(points, rooms, must=True)
