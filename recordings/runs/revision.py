"""What a new revision changes of the mission a run follows: stops and legs it withdraws, and new ones."""

from __future__ import annotations

from dataclasses import dataclass

import rerun as rr

from stopgo.mission.document import Mission, Stop
from stopgo.recordings.drawing import entities, palette
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.drawing.palette import Colour
from stopgo.recordings.drawing.robot import Draw
from stopgo.recordings.plan.mission import Leg, StopMarks, legs_of, route_lines, stop_marks

STEP = 0.02
"""How far what a revision changes lies above what was drawn before, as a share of a step of ORDER."""


@dataclass(frozen=True)
class RevisionChange:
    """What one revision has and another has not; a stop that has moved is withdrawn and new."""

    withdrawn: tuple[Stop, ...]
    added: tuple[Stop, ...]
    withdrawn_legs: tuple[Leg, ...]
    added_legs: tuple[tuple[Leg, Colour], ...]


def change_between(before: Mission, after: Mission) -> RevisionChange:
    """From one revision of a mission to another."""
    (old_legs, _), (new_legs, colours) = legs_of(before), legs_of(after)
    old, new = ({_place(stop) for stop in mission.stops} for mission in (before, after))
    return RevisionChange(
        withdrawn=tuple(stop for stop in before.stops if _place(stop) not in new),
        added=tuple(stop for stop in after.stops if _place(stop) not in old),
        withdrawn_legs=tuple(leg for leg in old_legs if leg not in new_legs),
        added_legs=tuple(
            (leg, colour) for leg, colour in zip(new_legs, colours, strict=True) if leg not in old_legs
        ),
    )


def _place(stop: Stop) -> tuple[object, ...]:
    return (stop.id, stop.x, stop.y, stop.heading, stop.doorway)


def draw_change(canvas: Canvas, change: RevisionChange, names: entities.Revision, draw: Draw) -> None:
    """Grey over what is withdrawn, and what is new in the colours of stops and routes.

    `draw` draws an archetype at an entity, at the time of the change.
    """
    low = 2 * STEP * names.number
    high = low + STEP
    if change.withdrawn_legs:
        grey = [palette.WITHDRAWN] * len(change.withdrawn_legs)
        lines = route_lines(canvas, change.withdrawn_legs, grey, above=low)
        _draw_legs(names, draw, entities.WITHDRAWN_ROUTE, lines)
    if change.added_legs:
        legs, colours = zip(*change.added_legs, strict=True)
        _draw_legs(names, draw, entities.NEW_ROUTE, route_lines(canvas, legs, colours, above=high))
    if change.withdrawn:
        labels = [f"{stop.id} until revision {names.number}" for stop in change.withdrawn]
        marks = stop_marks(canvas, change.withdrawn, colour=palette.WITHDRAWN_STOP, labels=labels, above=low)
        _draw_stops(names, draw, entities.WITHDRAWN, marks)
    if change.added:
        _draw_stops(names, draw, entities.NEW_STOPS, stop_marks(canvas, change.added, above=high))


def _draw_legs(
    names: entities.Revision, draw: Draw, name: str, lines: tuple[rr.LineStrips2D, rr.LineStrips3D]
) -> None:
    flat, solid = lines
    draw(names.flat(name), flat)
    draw(names.solid(name), solid)


def _draw_stops(names: entities.Revision, draw: Draw, name: str, marks: StopMarks) -> None:
    draw(names.flat(name), marks.points)
    draw(entities.headings(names.flat(name)), marks.headings)
    draw(names.solid(name), marks.heads)
    draw(entities.poles(names.solid(name)), marks.poles)
