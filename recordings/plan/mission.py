"""A mission in 2D and 3D: stops with numbers and headings, the route, and the planned drive.

Plan and field recordings both draw it, at the same entities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from stopgo.mission.document import Mission, Point, Stop
from stopgo.mission.geometry import FloatArray, bounds
from stopgo.mission.stages.network import magnified_errors, network_of
from stopgo.recordings.drawing import entities, palette, strokes
from stopgo.recordings.drawing.blueprint import Bounds
from stopgo.recordings.drawing.canvas import Canvas, on_screen
from stopgo.recordings.drawing.palette import Colour
from stopgo.recordings.drawing.pens import ORDER
from stopgo.recordings.drawing.robot import draw_robot, quaternions
from stopgo.recordings.plan.drive import Drive

ABOVE_FLOOR = 0.05
"""Height in metres of 3D lines above the floor, so that the floor does not hide them."""
LARGEST_ERROR = 1.0
"""Metres of the largest half axis of a drawn error ellipse."""
ARROW = 0.6
"""Length of a stop's heading, in metres."""
MOST_NAMES = 60
"""Number of stops above which names would cover the plan; they are then shown at the mouse pointer."""
HEAD = 1.5
"""Height of the marks on stops in 3D, in metres."""

Leg = tuple[Point, ...]


def draw_mission(canvas: Canvas, mission: Mission) -> None:
    """Draw stops and route, which do not change with time."""
    _draw_route(canvas, mission)
    _draw_network(canvas, mission)
    _draw_errors(canvas, mission)
    if mission.stops:
        _draw_stops(canvas, mission)


def mission_extent(mission: Mission) -> Bounds:
    """Return the bounds of the mission's legs and of the scanner's range around them."""
    start = np.array([(mission.start.x, mission.start.y)])
    paths = [start, *(np.array(stop.approach).reshape(-1, 2) for stop in mission.stops)]
    left, low, right, high = bounds([*paths, np.array(mission.return_ or ()).reshape(-1, 2)])
    reach = mission.scanner.range
    return (left - reach, low - reach, right + reach, high + reach)


def plan_states(canvas: Canvas, mission: Mission, drive: Drive) -> None:
    """Draw the planned states of the robot, and the tolerances, next to those of the runs."""
    lane = entities.PLANNED_STATE
    canvas.show(lane, state_colours())
    limits = {entities.METRIC_DEVIATION: [1.0], entities.METRIC_CROSS_TRACK: [1.0, -1.0]}
    for metric, sides in limits.items():
        look = rr.SeriesLines(colors=[palette.FAILED.colour] * len(sides), names=["tolerance"] * len(sides))
        canvas.show(entities.child(metric, "planned"), look)
    scanning = drive.leaving_s - [stop.scan.duration_s for stop in mission.stops]
    settling = scanning - [stop.settle_s for stop in mission.stops]
    changes = np.stack([settling, scanning, drive.leaving_s], axis=1).ravel()
    states = ["NAVIGATING", *("SETTLING", "SCANNING", "NAVIGATING") * len(scanning)]
    index = rr.TimeColumn(entities.MISSION_TIME, duration=[0.0, *changes.tolist()])
    canvas.columns(lane, index, rr.StateChange.columns(state=states))
    for metric, sides in limits.items():
        values = np.outer([stop.tolerance_m for stop in mission.stops], sides).ravel() * 1000
        column = rr.Scalars.columns(scalars=values).partition([len(sides)] * len(scanning))
        index = rr.TimeColumn(entities.MISSION_TIME, duration=scanning.tolist())
        canvas.columns(entities.child(metric, "planned"), index, column)
    least = entities.child(entities.METRIC_BATTERY, "planned")
    canvas.show(least, rr.SeriesLines(colors=palette.FAILED.colour, names="least, then home"))
    for seconds in (0.0, float(drive.seconds[-1])):
        canvas.at(least, rr.Scalars(100 * mission.policy.battery_min), mission_s=seconds)


def state_colours() -> rr.StateConfiguration:
    """Return the colour of every state, for a lane."""
    return rr.StateConfiguration(
        values=list(palette.STATE_COLOURS), colors=list(palette.STATE_COLOURS.values())
    )


def plot_planned_coverage(canvas: Canvas, coverage: FloatArray, drive: Drive) -> None:
    """Plot coverage over mission time if every scan is done as planned; `coverage` after each scan (k,)."""
    seconds = np.concatenate([[0.0], drive.leaving_s])
    planned = entities.COVERAGE_PLANNED
    index = rr.TimeColumn(entities.MISSION_TIME, duration=seconds)
    canvas.columns(planned, index, rr.Scalars.columns(scalars=np.concatenate([[0.0], 100 * coverage])))
    style = rr.SeriesLines(
        colors=palette.ROUTE, names="coverage as planned", widths=2, interpolation_mode="StepAfter"
    )
    canvas.show(planned, style)


def draw_drive(canvas: Canvas, drive: Drive, *, radius: float) -> None:
    """Draw the planned pose over mission time."""
    index = rr.TimeColumn(entities.MISSION_TIME, duration=drive.seconds)
    xy = canvas.local(drive.poses[:, :2])
    turn = quaternions(drive.poses[:, 2])
    for robot in (entities.PLANNED_ROBOT, entities.WORLD_PLANNED_ROBOT):
        columns = rr.Transform3D.columns(translation=strokes.level(xy, 0.0), quaternion=turn)
        canvas.columns(robot, index, columns)
    robots = (entities.PLANNED_ROBOT, entities.WORLD_PLANNED_ROBOT)
    draw_robot(partial(canvas.at, mission_s=0.0), *robots, radius=radius, colour=palette.PLANNED)


def _draw_route(canvas: Canvas, mission: Mission) -> None:
    legs, colours = legs_of(mission)
    if legs:
        flat, solid = route_lines(canvas, legs, colours)
        canvas.show(entities.ROUTE, flat)
        canvas.show(entities.WORLD_ROUTE, solid)


def _draw_network(canvas: Canvas, mission: Mission) -> None:
    """Draw pairs of stops whose scans register; pairs without an alternative have their own colour."""
    network = network_of(mission)
    if network is None or not network.overlaps:
        return
    at = {stop.id: (stop.x, stop.y) for stop in mission.stops}
    bridges = set(network.bridges)
    lines = rr.LineStrips2D(
        canvas.strips([np.array([at[item.a], at[item.b]]) for item in network.overlaps]),
        colors=[palette.BRIDGE if item in bridges else palette.PAIR for item in network.overlaps],
        labels=[network.in_words(item) for item in network.overlaps],
        show_labels=False,
        radii=on_screen(1.0),
        draw_order=ORDER["route"] + 0.5,
    )
    canvas.show(entities.NETWORK, lines)


def _draw_errors(canvas: Canvas, mission: Mission) -> None:
    """Draw the predicted error of each scan as an ellipse, magnified."""
    found = magnified_errors(mission, most_m=LARGEST_ERROR)
    if found is None:
        return
    lines = rr.LineStrips2D(
        canvas.strips(list(found.outlines.values())),
        colors=palette.ERROR,
        labels=[f"{words}; drawn {found.factor:g} times as large" for words in found.words.values()],
        show_labels=False,
        radii=on_screen(0.8),
        draw_order=ORDER["route"] + 0.6,
    )
    canvas.show(entities.ERRORS, lines)


def legs_of(mission: Mission) -> tuple[list[Leg], list[Colour]]:
    """Return every driven leg and its colour, the return path last."""
    legs = [stop.approach for stop in mission.stops if len(stop.approach) > 1]
    colours = [palette.ROUTE] * len(legs)
    if mission.return_:
        legs.append(mission.return_)
        colours.append(palette.RETURN)
    return legs, colours


def route_lines(
    canvas: Canvas, legs: Sequence[Leg], colours: Sequence[Colour], *, above: float = 0.0
) -> tuple[rr.LineStrips2D, rr.LineStrips3D]:
    """Return legs in 2D and 3D; `above`, a fraction of a step of ORDER, raises and widens them."""
    lines = [np.array(leg) for leg in legs]
    order, size = ORDER["route"] + above, 1 + above
    flat = rr.LineStrips2D(
        canvas.strips(lines), colors=colours, radii=on_screen(1.2 * size), draw_order=order
    )
    raised = [strokes.level(canvas.local(line), ABOVE_FLOOR + 0.2 * above) for line in lines]
    return flat, rr.LineStrips3D(raised, colors=colours, radii=0.03 * size)


def _draw_stops(canvas: Canvas, mission: Mission) -> None:
    marks = stop_marks(canvas, mission.stops)
    canvas.show(entities.STOPS, marks.points, _details(mission))
    canvas.show(entities.HEADINGS, marks.headings)
    canvas.show(entities.WORLD_STOPS, marks.heads)
    canvas.show(entities.POLES, marks.poles)


@dataclass(frozen=True)
class StopMarks:
    """Stops in 2D and 3D."""

    points: rr.Points2D
    headings: rr.Arrows2D
    heads: rr.Points3D
    poles: rr.LineStrips3D


def stop_marks(
    canvas: Canvas,
    stops: Sequence[Stop],
    *,
    colour: Colour | None = None,
    labels: Sequence[str] = (),
    above: float = 0.0,
) -> StopMarks:
    """Return stops in their own colours with their names, or in one colour with labels at the mouse pointer.

    `above` is the distance above other stops, as a fraction of a step of ORDER; the marks are larger by it.
    """
    xy = canvas.local(np.array([(stop.x, stop.y) for stop in stops]))
    heads = strokes.level(xy, HEAD)
    size, order = 1 + above, ORDER["stop"] + above
    look: dict[str, Any] = {
        "labels": list(labels) or [stop.id for stop in stops],
        "show_labels": not labels and len(stops) <= MOST_NAMES,
        "colors": [colour or (palette.DOORWAY if stop.doorway else palette.STOP) for stop in stops],
    }
    poles = np.stack([strokes.level(xy, 0.0), heads], axis=1)
    return StopMarks(
        points=rr.Points2D(xy, radii=on_screen(5 * size), draw_order=order, **look),
        headings=_headings(xy, stops, colour or palette.STOP, order),
        heads=rr.Points3D(heads, radii=0.12 * size, **look),
        poles=rr.LineStrips3D(poles, colors=colour or palette.STOP, radii=0.02 * size),
    )


def _details(mission: Mission) -> rr.AnyValues:
    """Details shown at the mouse pointer."""
    return rr.AnyValues(
        doorway=[stop.doorway for stop in mission.stops],
        units=[stop.sees.units for stop in mission.stops],
        new_units=[stop.sees.new_units for stop in mission.stops],
    )


def _headings(xy: NDArray[Any], stops: Sequence[Stop], colour: Colour, order: float) -> rr.Arrows2D:
    heading = np.array([stop.heading for stop in stops])
    facing = ARROW * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    return rr.Arrows2D(origins=xy, vectors=facing, colors=colour, radii=on_screen(1.5), draw_order=order)
