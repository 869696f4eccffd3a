"""Floor -> navigable space: stop areas, drive area, targets and occluders."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any, TypeAlias, TypeVar

import numpy as np
from shapely.geometry.base import BaseGeometry

from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.floor import FloorPlan
from stopgo.mission.frames.geodesy import out_of_reach
from stopgo.mission.geometry import FloatArray, IntArray, Polygon, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, RoomSpace, Targets
from stopgo.planner.geometry.instance_cache import store
from stopgo.planner.geometry.shapes import local_origin, to_polygons, to_shape
from stopgo.planner.geometry.side_work import SideWork
from stopgo.planner.space.connected_parts import parts_of
from stopgo.planner.space.faced_rooms import faced_rooms
from stopgo.planner.space.ground import Ground, drivable
from stopgo.planner.space.local_shapes import drive_area_of, drive_parts_of, obstacles_of
from stopgo.planner.space.opening_joins import barrier
from stopgo.planner.space.opening_states import opening_states
from stopgo.planner.space.room_spaces import floor_outside, room_spaces, stop_area_of
from stopgo.planner.space.targets import occluders_of, targets_of

MANY = 1000
"""Elements from which targets, and what concerns rooms, are found in processes of their own."""
MANY_CORNERS = 8000
"""The same for the corners of elements: round columns have many."""
NOTHING = np.empty((0, 2, 2))
T = TypeVar("T")
_Kept: TypeAlias = tuple[tuple[Polygon, ...], BaseGeometry]


def navigable(floor: FloorPlan, settings: Settings) -> NavigableSpace:
    """Return the navigable space of a floor, for this robot and these clearances."""
    floor = floor if settings.targets is None else floor.with_targets(settings.targets)
    origin = local_origin(floor)
    _check_georeference(floor, origin, settings)
    large = is_large(floor)
    with _SideWorks(forked=large) as works:
        scanned = partial(_occluders_and_targets, floor, settings)
        scanning = works.begun(partial(scanned, NOTHING)) if settings.doors == "open" else None
        ground = Ground.of(floor, settings, forked=large)
        scanning = scanning or works.begun(partial(scanned, _closed_doors(ground, settings)))
        clearing = works.begun(partial(_cleared, ground, settings), after=scanning)
        drive_area, gaps = drivable(ground, settings, forked=large)
        (drive_polygons, drive_shape), gaps = _kept(drive_area, origin), frozen(gaps + origin)
        parts = parts_of(drive_shape, gaps - origin)
        occluders, targets = scanning.result()
        _check_targets(floor, targets)
        (obstacles, obstacle_shape), areas = clearing.result()
        dividing = works.begun(partial(_rooms, ground, drive_area, areas, targets))
        states, findings = opening_states(ground, parts, settings)
        rooms, faced = dividing.result()
    space = NavigableSpace(
        floor=floor,
        settings=settings,
        rooms=rooms,
        openings=states,
        obstacles=obstacles,
        occluders=to_polygons(occluders, origin),
        barriers=frozen(ground.barriers + origin),
        drive_area=drive_polygons,
        gaps=gaps,
        targets=targets,
        unit_room=faced,
        ground=to_polygons(ground.outline, origin),
        findings=(*floor.findings, *findings),
    )
    store(drive_area_of, space, drive_shape)
    store(obstacles_of, space, obstacle_shape)
    store(drive_parts_of, space, parts)
    return space


def is_large(floor: FloorPlan) -> bool:
    """True for a floor of so many elements, or corners of them, that other processes save time."""
    corners = sum(len(solid.exterior) for item in floor.elements for solid in item.solids)
    return len(floor.elements) >= MANY or corners >= MANY_CORNERS


class _SideWorks(ExitStack):
    """Work that goes on next to other work; the end of the block ends all of it."""

    def __init__(self, *, forked: bool) -> None:
        super().__init__()
        self._forked = forked

    def begun(self, work: Callable[[], T], *, after: SideWork[Any] | None = None) -> SideWork[T]:
        """The work, begun now or once that `after` is done."""
        return self.enter_context(SideWork(work, forked=self._forked, after=after))


def _occluders_and_targets(
    floor: FloorPlan, settings: Settings, closed: FloatArray
) -> tuple[BaseGeometry, Targets]:
    occluders = occluders_of(floor, closed)
    return occluders, targets_of(floor, occluders, d_dis=settings.d_dis)


def _cleared(ground: Ground, settings: Settings) -> tuple[_Kept, tuple[BaseGeometry, BaseGeometry]]:
    """The obstacles, the area where stops may be, and the floor outside every room."""
    return _kept(ground.obstacles, ground.origin), (stop_area_of(ground, settings), floor_outside(ground))


def _rooms(
    ground: Ground, drive_area: BaseGeometry, areas: tuple[BaseGeometry, BaseGeometry], targets: Targets
) -> tuple[tuple[RoomSpace, ...], IntArray]:
    """The rooms, and the room that each unit faces."""
    rooms = room_spaces(ground, drive_area, *areas)
    return rooms, faced_rooms(targets, rooms, ground)


def _kept(shape: BaseGeometry, origin: FloatArray) -> _Kept:
    """A shape as polygons in the drawing's coordinates, and the shape that these are in the local frame."""
    polygons = to_polygons(shape, origin)
    return polygons, to_shape(polygons, origin)


def _check_georeference(floor: FloorPlan, corner: FloatArray, settings: Settings) -> None:
    """Refuse `--origin` for a floor that lies far from its 0,0, which the origin georeferences."""
    far = out_of_reach((float(corner[0]), float(corner[1])))
    if settings.origin is not None and far:
        raise InputError(f"{floor.name}: its corner {far}, or plan without --origin")


def _check_targets(floor: FloorPlan, targets: Targets) -> None:
    """Refuse a floor without targets; one without elements with the reason that its file gives."""
    if targets.total:
        return
    kinds = ", ".join(sorted({item.kind for item in floor.elements})) or "none"
    width, height = np.ptp(np.concatenate([polygon.exterior for polygon in floor.outline]), axis=0).tolist()
    remedy = "see --targets"
    if max(width, height) < NARROWEST:
        remedy = f"it is only {max(width, height):.2g} m across: correct the unit of length of its file"
    elif not floor.elements and floor.findings:
        remedy = min(floor.findings, key=lambda finding: finding.rank).message
    raise NegativeResult(f"{floor.name}: no target on the floor; elements: {kinds} ({remedy})")


NARROWEST = 1.0
"""Extent in metres below which no floor holds a robot: its file's unit of length is wrong."""


def _closed_doors(ground: Ground, settings: Settings) -> FloatArray:
    """Lines (k, 2, 2) of doors that block the laser: with `doors = closed` all of them."""
    doors = [item for item in ground.crossings if settings.doors != "open" and item.opening.kind == "door"]
    return np.array([barrier(item, ground.origin, ground.obstacle_rings) for item in doors])
