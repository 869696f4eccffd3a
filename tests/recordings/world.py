"""The smallest floor that has every stage: a room of 6 × 4 m with two columns, a door, and two stops."""

from __future__ import annotations

import msgspec
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
from stopgo.mission.document.schedule import Schedule
from stopgo.mission.floor import Element, Finding, FloorPlan, Opening, Room
from stopgo.mission.geometry import Polygon, frozen
from stopgo.mission.run.events import Pose
from stopgo.mission.settings import Settings
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

MISSION_ID = "0123456789abcdef0123456789abcdef"
FLOOR_DIGEST = "f" * 64
UNITS = 16
"""Target units: four on each face of the first column; the second column stays unseen."""


def box(x: float, y: float, width: float, height: float) -> Polygon:
    return Polygon.of([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def floor_at(x: float = 0.0, y: float = 0.0) -> FloorPlan:
    """The floor with its lower left corner at (x, y)."""
    walls = (
        *(box(x, y, 6.4, 0.2), box(x, y + 4.2, 6.4, 0.2)),
        *(box(x, y + 0.2, 0.2, 4.0), box(x + 6.2, y + 0.2, 0.2, 1.5), box(x + 6.2, y + 2.7, 0.2, 1.5)),
    )
    elements = (
        Element("w1", "walls", solids=walls, occludes=True, obstacle=True, target=True),
        Element(
            "c1", "columns", solids=(box(x + 2, y + 2, 0.4, 0.4),), occludes=True, obstacle=True, target=True
        ),
        Element(
            "c2", "columns", solids=(box(x + 4, y + 2, 0.4, 0.4),), occludes=True, obstacle=True, target=True
        ),
        Element("s1", "stairs", solids=(box(x + 0.2, y + 3.2, 1.2, 1.0),), occludes=True, obstacle=True),
        Element("b1", "beams", lines=(frozen([(x + 0.2, y + 1.0), (x + 6.2, y + 1.0)]),), target=True),
    )
    return FloorPlan(
        name="small room",
        source=FloorSource("small.dxf", FLOOR_DIGEST),
        outline=(Polygon.of(box(x, y, 7.4, 4.4).exterior, [box(x + 5.2, y + 3.2, 0.6, 0.6).exterior]),),
        rooms=(Room("r1", "Room 1", (box(x + 0.2, y + 0.2, 6.0, 4.0),)),),
        openings=(Opening("d1", "door", frozen([(x + 6.3, y + 1.7), (x + 6.3, y + 2.7)])),),
        elements=elements,
        findings=(Finding("unknown_layer", "layer FOO holds 1 line, left out"),),
    )


def space_of(floor: FloorPlan) -> NavigableSpace:
    x, y = floor.outline[0].exterior[0]
    corners = [floor.elements[index].solids[0].exterior for index in (1, 2)]
    a = np.concatenate(corners)
    b = np.concatenate([np.roll(ring, -1, axis=0) for ring in corners])
    targets = Targets(
        a=frozen(a),
        b=frozen(b),
        units=frozen([4] * 8, np.int64),
        element=frozen([1] * 4 + [2] * 4, np.int64),
        occluding=frozen([True] * 8, np.bool_),
        raw={"columns": 32},
    )
    area = floor.rooms[0].polygons
    return NavigableSpace(
        floor=floor,
        settings=Settings(),
        rooms=(RoomSpace(0, "Room 1", area, (box(x + 0.9, y + 0.9, 4.6, 0.4),)),),
        openings=(
            OpeningState(floor.openings[0], (0, None), 1.0, floor.openings[0].line.mean(axis=0), True, ""),
        ),
        obstacles=(),
        occluders=(),
        barriers=frozen(np.empty((0, 2, 2))),
        drive_area=(box(x + 0.55, y + 0.55, 5.3, 1.1),),
        gaps=frozen(np.empty((0, 2, 2))),
        targets=targets,
        unit_room=frozen(np.zeros(targets.total), np.int64),
        findings=(*floor.findings, Finding("narrow_door", "door d1 is 1.000 m wide")),
    )


def candidates_of(space: NavigableSpace) -> Candidates:
    """Three kept, one too close, one outside."""
    x, y = space.floor.outline[0].exterior[0]
    xy = np.array([(1.0, 1.0), (2.2, 1.6), (3.2, 1.0), (5.0, 1.0), (7.0, 1.0)])
    return Candidates(
        space=space,
        xy=frozen(xy + np.array([x, y])),
        room=frozen([0] * 5, np.int64),
        reason=frozen([0, 3, 0, 0, 1], np.int64),
        part=frozen([0, -1, 0, 0, -1], np.int64),
        strategy="grid",
    )


def visibility_of(candidates: Candidates) -> Visibility:
    """Row 0 sees the left and lower face of column 1, row 1 its right face too, row 2 the lower of 2."""
    return Visibility(
        candidates=candidates,
        pointer=frozen([0, 2, 4, 5], np.int64),
        segment=frozen([0, 3, 0, 1, 4], np.int64),
        first=frozen([0, 12, 0, 4, 16], np.int64),
        last=frozen([3, 15, 3, 6, 18], np.int64),
        method="exact",
    )


def selection_of(visibility: Visibility) -> Selection:
    """Of 14 visible units, the first stop sees 8 and the second 3 more."""
    return Selection(
        visibility=visibility,
        chosen=frozen([0, 1], np.int64),
        coverage_steps=frozen([8 / 14, 11 / 14]),
        required=0.7,
        bound=2,
        method="greedy",
    )


def route_of(selection: Selection) -> Route:
    first, second = selection.xy
    return Route(
        selection=selection,
        order=frozen([0, 1], np.int64),
        start=(float(first[0]), float(first[1]), 0.0),
        start_reason="the stop nearest the widest exterior door",
        approaches=(frozen([first, first]), frozen([first, second])),
        return_leg=None,
        tour="open",
        bound=2.2,
        method="local search",
    )


def origin() -> Origin:
    return Origin(floor="small.dxf", floor_digest=FLOOR_DIGEST, parameters={"seed": 1}, stopgo="0.1.0")


def mission_of(route: Route) -> Mission:
    sees = (Sees(units=8, new_units=8), Sees(units=7, new_units=3))
    stops = tuple(
        Stop(
            id=f"S{number + 1}",
            x=float(xy[0]),
            y=float(xy[1]),
            heading=0.0,
            doorway=False,
            tolerance_m=0.05,
            settle_s=2.0,
            scan=Scan(profile="default", duration_s=60.0, timeout_s=120.0),
            on_failure="ask",
            retries=1,
            approach=tuple((float(px), float(py)) for px, py in leg),
            sees=sees[number],
        )
        for number, (xy, leg) in enumerate(zip(route.xy, route.approaches, strict=True))
    )
    return with_digest(
        Mission(
            id=MISSION_ID,
            revision=1,
            name="small room",
            digest="",
            frame=Frame(name="site"),
            georeference=None,
            robot=RobotSpec(radius=0.35, speed=0.5, turn_rate=0.785, acceleration=0.5),
            scanner=ScannerSpec(profile="default", range=5.0),
            start=Start(x=route.start[0], y=route.start[1], heading=0.0, reason=route.start_reason),
            stops=stops,
            return_=None,
            policy=Policy(link_loss="continue", link_loss_after_s=30.0, battery_min=0.15),
            origin=origin(),
        )
    )


def nouns_at(x: float = 0.0, y: float = 0.0) -> list[object]:
    """Every noun of the plan, in the order the planner makes them."""
    floor = floor_at(x, y)
    space = space_of(floor)
    candidates = candidates_of(space)
    visibility = visibility_of(candidates)
    selection = selection_of(visibility)
    route = route_of(selection)
    schedule = Schedule(drive_s=4.4, turn_s=0.0, settle_s=4.0, scan_s=120.0, arrival_s=(0.0, 62.0 + 4.4))
    return [floor, space, candidates, visibility, selection, route, schedule, mission_of(route)]


def pose_at(x: float, y: float) -> Pose:
    return Pose(x=x, y=y, heading=0.0)


def revised(mission: Mission) -> Mission:
    """Revision 2: the second stop 0.4 m farther down, and a third one at the end of the room."""
    first, second = mission.stops
    places = ((first.x, first.y), (second.x, second.y - 0.4), (second.x + 1.6, second.y + 0.6))
    later = [
        msgspec.structs.replace(second, id=name, x=x, y=y, approach=(places[k], (x, y)))
        for k, (name, (x, y)) in enumerate(zip(("S2", "S3"), places[1:], strict=True))
    ]
    return with_digest(msgspec.structs.replace(mission, revision=2, stops=(first, *later)))
