"""Missions embedded in a recording: the whole document, one entity per revision."""

from __future__ import annotations

import rerun as rr

from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import encode, parse
from stopgo.recordings.drawing import entities
from stopgo.recordings.drawing.canvas import Canvas
from stopgo.recordings.embedded.values import Values


def embed_mission(canvas: Canvas, mission: Mission) -> None:
    """Embed the mission.json of a revision."""
    document = {"document": encode(mission).decode()}
    canvas.show(entities.mission(mission.revision), rr.DynamicArchetype("Mission", components=document))


def missions_in(values: Values, name: str) -> tuple[Mission, ...]:
    """Return the embedded revisions in ascending order; error messages begin with `name`.

    Raises
    ------
    InputError
        When a mission does not match its digest.
    """
    documents = [row["document"][0] for row in values.below(entities.MISSION)]
    found = [parse(document.encode(), f"{name}: embedded mission") for document in documents]
    return tuple(sorted(found, key=lambda mission: mission.revision))
