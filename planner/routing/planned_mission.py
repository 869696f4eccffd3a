"""Missions of plans of a floor: known by their id; follow-up missions: known by their name."""

from __future__ import annotations

from stopgo.mission.document import Mission, ids_of_plan
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.space.reach import reach_of

FOLLOW_UP = "-top-up"
"""End of the name of a follow-up mission."""


def is_of_plan(mission: Mission, space: NavigableSpace) -> bool:
    """True for a mission of a plan of this floor, by the parameters and the version that it records."""
    parts = len(reach_of(space).parts.areas)
    return mission.id in ids_of_plan(mission, space.floor.source, space.settings, parts)


def is_follow_up(mission: Mission, space: NavigableSpace) -> bool:
    """True for a mission that acquires what a run left out: it has an id of its own."""
    return mission.name.endswith(FOLLOW_UP) and not is_of_plan(mission, space)
