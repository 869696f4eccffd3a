"""The smallest worlds the tests of this folder need, built by hand."""

from __future__ import annotations

import math

import numpy as np

from stopgo.mission.document import (
    Frame,
    Mission,
    Origin,
    Policy,
    RobotSpec,
    Scan,
    ScannerSpec,
    Sees,
    Start,
    Stop,
    with_digest,
)
from stopgo.mission.document.floor_source import FloorSource
from stopgo.mission.floor import Element, FloorPlan, Opening, Room
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.geometry import Polygon, frozen
from stopgo.mission.settings import Settings
from stopgo.mission.settings.element_kinds import KINDS
from stopgo.mission.stages import (
    Candidates,
    NavigableSpace,
    OpeningState,
    RoomSpace,
    Route,
    Selection,
    Targets,
    Visibility,
)


def stop(name: str, *approach: tuple[float, float], heading: float = 0.0, units: int = 10) -> Stop:
    """A stop at the end of `approach`."""
    x, y = approach[-1]
    return Stop(
        id=name, x=x, y=y, heading=heading, doorway=False, tolerance_m=0.05, settle_s=2.0,
        scan=Scan(profile="default", duration_s=60.0, timeout_s=120.0),
        on_failure="ask", retries=1, approach=approach, sees=Sees(units=units, new_units=units),
    )  # fmt: skip


def mission_of(
    *stops: Stop,
    back: tuple[tuple[float, float], ...] | None = None,
    begin: tuple[float, float] = (0.0, 0.0),
) -> Mission:
    """A mission over `stops` from `begin`, facing +x: 1 m/s, 1 m/s², 90° a second."""
    return with_digest(Mission(
        id="0123456789abcdef0123456789abcdef", revision=1, name="room", digest="",
        frame=Frame(name="room"), georeference=SiteOrigin(lat=51.5, lon=7.5, alt=100.0, heading_deg=0.0),
        robot=RobotSpec(radius=0.35, speed=1.0, turn_rate=math.pi / 2, acceleration=1.0),
        scanner=ScannerSpec(profile="default", range=5.0),
        start=Start(x=begin[0], y=begin[1], heading=0.0, reason="given"),
        stops=stops, return_=back,
        policy=Policy(link_loss="continue", link_loss_after_s=30.0, battery_min=0.15),
        origin=Origin(floor="room.dxf", floor_digest="0" * 64, parameters={"seed": 1}, stopgo="0.1.0"),
    ))  # fmt: skip


def square_tour() -> Mission:
    """Two stops, 4 m ahead and then 3 m to the left of that, and straight back: a 3-4-5 triangle."""
    return mission_of(
        stop("S1", (0.0, 0.0), (4.0, 0.0)),
        stop("S2", (4.0, 0.0), (4.0, 3.0), heading=math.pi / 2),
        back=((4.0, 3.0), (0.0, 0.0)),
    )


def room_floor() -> FloorPlan:
    """A room of 8 × 4 m in walls 0.2 m thick, two columns of 0.4 m, a window, a door, a passage."""
    inner = box(0, 0, 8, 4)
    walls = Polygon.of(box(-0.2, -0.2, 8.2, 4.2), [inner])
    columns = [Polygon.of(box(x, 1.8, x + 0.4, 2.2)) for x in (2.4, 5.2)]
    return FloorPlan(
        name="room",
        source=FloorSource("test.dxf", "0" * 64),
        outline=(Polygon.of(box(-0.2, -0.2, 8.2, 4.2)),),
        rooms=(Room("R1", "Hall <1> & co", (Polygon.of(inner),)),),
        openings=(
            Opening("D1", "door", frozen([[3.5, -0.1], [4.5, -0.1]])),
            Opening("P1", "passage", frozen([[8.1, 1.7], [8.1, 2.3]])),
        ),
        elements=(
            element("W1", "walls", walls, global_id="0LiOMJvJv5Bu0hPkJYEFGw"),
            *(element(f"C{number}", "columns", column) for number, column in enumerate(columns, 1)),
            element("N1", "windows", Polygon.of(box(1, -0.2, 2, 0))),
        ),
    )


def element(name: str, kind: str, solid: Polygon, global_id: str | None = None) -> Element:
    """An element with the defaults of its kind."""
    means = KINDS[kind]
    return Element(
        name, kind, (solid,), global_id=global_id,
        occludes=means.occludes, obstacle=means.obstacle, target=means.target,
    )  # fmt: skip


def box(x0: float, y0: float, x1: float, y1: float) -> list[tuple[float, float]]:
    """A rectangle's corners, counter-clockwise."""
    return [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]


def room_route() -> Route:
    """Two stops in the room's halves; each sees the 1 m units of its half, the third candidate all."""
    floor = room_floor()
    targets = room_targets(floor)
    space = NavigableSpace(
        floor=floor, settings=Settings(d_dis=1.0), rooms=(whole_room(floor),), openings=opening_states(floor),
        obstacles=(), occluders=(), barriers=frozen(np.empty((0, 2, 2))), drive_area=(),
        gaps=frozen(np.empty((0, 2, 2))), targets=targets,
        unit_room=frozen(np.zeros(targets.total), np.int64),
    )  # fmt: skip
    xy = frozen([[1.2, 2.0], [6.8, 2.0], [4.0, 2.0]])
    zeros = frozen([0, 0, 0], np.int64)
    candidates = Candidates(space, xy=xy, room=zeros, reason=zeros, part=zeros, strategy="hand")
    selection = Selection(
        visibility=halves_seen(candidates), chosen=frozen([1, 0], np.int64),
        coverage_steps=frozen([0.5, 1.0]), required=0.9, bound=2, method="hand",
    )  # fmt: skip
    return Route(
        selection=selection, order=frozen([1, 0], np.int64), start=(1.2, 1.0, 0.0), start_reason="given",
        approaches=(frozen([[1.2, 1.0], [1.2, 2.0]]), frozen([[1.2, 2.0], [4.0, 1.2], [6.8, 2.0]])),
        return_leg=frozen([[6.8, 2.0], [1.2, 1.0]]), tour="closed", bound=10.0, method="hand",
    )  # fmt: skip


def whole_room(floor: FloorPlan) -> RoomSpace:
    """The floor's only room, where stops may be anywhere."""
    room = floor.rooms[0]
    return RoomSpace(0, room.label, area=room.polygons, stop_area=room.polygons)


def opening_states(floor: FloorPlan) -> tuple[OpeningState, ...]:
    """The door is passable, the passage is not."""
    door, passage = floor.openings
    return (
        OpeningState(door, (0, None), clear_width=1.0, middle=door.line.mean(axis=0), passable=True, why=""),
        OpeningState(
            passage,
            (0, None),
            clear_width=0.6,
            middle=passage.line.mean(axis=0),
            passable=False,
            why="narrower than 0.7 m",
        ),
    )


def room_targets(floor: FloorPlan) -> Targets:
    """The room's four faces in units of 1 m, and one unit on each face of the columns."""
    rings = [floor.elements[0].solids[0].holes[0]]
    rings += [solid.exterior for item in floor.elements[1:3] for solid in item.solids]
    a = np.concatenate(rings)
    b = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    units = np.maximum(1, np.rint(np.hypot(*(b - a).T)))
    owners = np.repeat([0, 1, 2], 4)
    return Targets(
        a=frozen(a), b=frozen(b), units=frozen(units, np.int64), element=frozen(owners, np.int64),
        occluding=frozen(np.ones(12), np.bool_), raw={"walls": 48, "columns": 8},
    )  # fmt: skip


def halves_seen(candidates: Candidates) -> Visibility:
    """Candidate 0 sees the units left of x = 4, candidate 1 the others, candidate 2 all but the last."""
    targets = candidates.targets
    left = targets.unit_xy[:, 0] < 4
    rows = [left, ~left, np.arange(targets.total) < targets.total - 1]
    runs = [run for row in rows for run in unit_runs(row, targets)]
    counts = [len(unit_runs(row, targets)) for row in rows]
    segment, first, last = (frozen(column, np.int64) for column in zip(*runs, strict=True))
    pointer = frozen(np.concatenate([[0], np.cumsum(counts)]), np.int64)
    return Visibility(candidates, pointer, segment, first, last, method="hand")


def unit_runs(seen: np.ndarray, targets: Targets) -> list[tuple[int, int, int]]:
    """(segment, unit, unit) of every unit seen."""
    return [(int(targets.unit_segment[unit]), unit, unit) for unit in np.flatnonzero(seen).tolist()]


def room_mission() -> Mission:
    """The mission of `room_route`."""
    route = room_route()
    approaches = [tuple((float(x), float(y)) for x, y in leg) for leg in route.approaches]
    stops = [stop(f"S{number}", *leg) for number, leg in enumerate(approaches, 1)]
    return mission_of(*stops, back=((6.8, 2.0), (1.2, 1.0)), begin=(1.2, 1.0))
