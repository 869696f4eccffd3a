"""A plan's floor, planned coverage and sight, taken from its recording into that of a run."""

from __future__ import annotations

from mission.document import Mission
from recordings import entities
from recordings.canvas import Canvas
from recordings.carried.reading import Recording
from recordings.read import chunks

TAKEN = (entities.FLOOR, entities.COVERAGE, entities.WORLD_FLOOR, entities.SIGHT, entities.FINDINGS)
"""What is taken, with all below it."""


def carry_plan(canvas: Canvas, plan: Recording, mission: Mission) -> None:
    """Put what a plan's recording tells of the floor into the run's, if it is a plan of this mission."""
    of = plan.contents.properties.get(entities.PROPERTY_PLAN, {})
    if plan.mission_id != mission.id or tuple(of.get("local_origin", ())) != canvas.origin:
        return
    for chunk in chunks(plan.path):
        entity = str(chunk.entity_path)
        if any(entity == name or entity.startswith(f"{name}/") for name in TAKEN):
            canvas.take(chunk)
