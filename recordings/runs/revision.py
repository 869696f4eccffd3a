"""Changes of a new revision: withdrawn stops and legs, and new ones."""

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
"""Distance of a revision's changes above earlier drawings, as a fraction of a step of ORDER."""


@dataclass(frozen=True)
class RevisionChange:
    """Differences between two revisions; a moved stop is withdrawn and new."""

    withdrawn: tuple[Stop, ...]
    added: tuple[Stop, ...]
    withdrawn_legs: tuple[Leg, ...]
    added_legs: tuple[tuple[Leg, Colour], ...]


def change_between(before: Mission, after: Mission) -> RevisionChange:
    """Return the differences between two revisions of a mission."""
    (old_legs, _), (new_legs, colours) = legs_of(before), legs_of(after)
    old, new = ({_pose_key(stop) for stop in mission.stops} for mission in (before, after))
    return RevisionChange(
        withdrawn=tuple(stop for stop in before.stops if _pose_key(stop) not in new),
        added=tuple(stop for stop in after.stops if _pose_key(stop) not in old),
        withdrawn_legs=tuple(leg for leg in old_legs if leg not in new_legs),
        added_legs=tuple(
            (leg, colour) for leg, colour in zip(new_legs, colours, strict=True) if leg not in old_legs
        ),
    )


def _pose_key(stop: Stop) -> tuple[object, ...]:
    return (stop.id, stop.x, stop.y, stop.heading, stop.doorway)


def draw_change(canvas: Canvas, change: RevisionChange, names: entities.Revision, draw: Draw) -> None:
    """Draw withdrawn stops and legs grey, and new ones in the colours of stops and routes.

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
