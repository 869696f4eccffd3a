"""Floor, planned coverage and visibility of a plan, copied from its recording into the recording of a run."""

from __future__ import annotations

from stopgo.mission.document import Mission
from stopgo.mission.geometry import bounds
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.blueprint import Bounds
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.floor_lines import floor_lines
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.rrd.read import chunks

COPIED = (
    *(entities.FLOOR, entities.COVERAGE, entities.WORLD_FLOOR, entities.REPORT),
    *(entities.SIGHT, entities.FINDINGS),
)
"""Copied entities, with all entities below them."""


def embed_plan(canvas: Canvas, plan: Recording, mission: Mission) -> None:
    """Copy the floor of a plan's recording into the run's, if it is a plan of this mission."""
    properties = plan.contents.properties.get(entities.PROPERTY_PLAN, {})
    if plan.mission_id != mission.id or tuple(properties.get("local_origin", ())) != canvas.origin:
        return
    for chunk in chunks(plan.path):
        entity = str(chunk.entity_path)
        if any(entity == name or entity.startswith(f"{name}/") for name in COPIED):
            canvas.copy_chunk(chunk)


def planned_extent(plan: Recording | None) -> Bounds | None:
    """Return the bounds of the floor in a plan's recording, in the drawing's metres; None without a floor."""
    if plan is None:
        return None
    floor = floor_lines(plan.values, origin_in(plan))
    return None if floor is None else bounds(floor.outline)


def origin_in(recording: Recording) -> tuple[float, float]:
    """Return the position of the recording's local origin in the drawing."""
    for name in (entities.PROPERTY_PLAN, entities.PROPERTY_RUN):
        origin = recording.contents.properties.get(name, {}).get("local_origin")
        if origin is not None:
            return (float(origin[0]), float(origin[1]))
    return (0.0, 0.0)
