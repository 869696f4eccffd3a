"""The mission inside a recording: the document itself, one entity per revision."""

from __future__ import annotations

import rerun as rr

from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import encode, parse
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.values import Values


def carry_mission(canvas: Canvas, mission: Mission) -> None:
    """Put the mission.json of a revision into the recording."""
    document = {"document": encode(mission).decode()}
    canvas.show(entities.mission(mission.revision), rr.DynamicArchetype("Mission", components=document))


def missions_in(values: Values, name: str) -> tuple[Mission, ...]:
    """The revisions that a recording carries, in ascending order; `name` stands in error messages.

    Raises
    ------
    InputError
        When one of them is not the mission that its digest says it is.
    """
    documents = [row["document"][0] for row in values.below(entities.MISSION)]
    found = [parse(document.encode(), f"{name}: the mission in it") for document in documents]
    return tuple(sorted(found, key=lambda mission: mission.revision))
