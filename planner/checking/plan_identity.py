"""Mission + navigable space -> identity, frame and position on earth that are not those of the plan.

The id is a hash of the floor, the parameters and the version. An id that does not fit thus shows that one of
them was changed after planning, or a file that is read with the floor, such as the picture of a map.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from msgspec import UNSET

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import Problem
from stopgo.mission.stages import NavigableSpace
from stopgo.planner.routing.assemble import frame_of_floor, georeference_of
from stopgo.planner.routing.planned_mission import is_follow_up, is_of_plan


def foreign_identity(mission: Mission, space: NavigableSpace) -> Iterator[Problem]:
    """Id, allocation, frame and georeference of a mission that are not those of a plan of its floor."""
    is_plan, is_whole = is_of_plan(mission, space), mission.share is UNSET
    if not is_plan and not is_follow_up(mission, space):
        yield Problem(
            "$.id",
            "is not that of a plan of this floor by $.origin.parameters and $.origin.stopgo: one of these "
            "was changed since, or a file read with the floor (a map's picture, a schedule); plan again",
        )
    if is_plan and is_whole and mission.stops and not any(stop.sees.new_units for stop in mission.stops):
        yield Problem(
            "$.stops[*].sees.new_units",
            "is 0 at every stop, as if it were imported, but $.id is that of a plan; plan again",
        )
    if not is_whole and not space.settings.divided:
        yield Problem("$.share", "is set, but $.origin.parameters divide the floor among no robots or tours")
    if mission.georeference != georeference_of(space):
        yield Problem("$.georeference", "is not that of the floor or of $.origin.parameters; plan again")
    if space.floor.on_robots_map and mission.frame != frame_of_floor(space.floor):
        yield Problem("$.frame", "is not that of the robot's map, in which the floor was drawn; plan again")


def unverified(mission: Mission, space: NavigableSpace) -> Iterator[str]:
    """Return in words what no floor shows: its own name, the place in a robot's map, and a whole plan."""
    named, floor, to_map = mission.origin.floor, space.floor, mission.frame.to_map
    if named != floor.name:
        yield (
            f"$.origin.floor is {named}, this file's floor is called {floor.name}: "
            "it was renamed since, or the mission was changed"
        )
    if mission.share is not UNSET and space.settings.divided:
        yield (
            f"$.share is {mission.share.number} of {mission.share.of}: required coverage and accuracy are "
            "of all these missions together, and are not checked"
        )
    elif is_follow_up(mission, space):
        yield (
            "$.name is that of a follow-up mission: its $.id, and the coverage required in "
            "$.origin.parameters, depend on the run before, and are not checked"
        )
    if to_map is not None and not floor.on_robots_map:
        place = f"{to_map.x:.3f},{to_map.y:.3f},{math.degrees(to_map.heading):.3f}"
        yield f"$.frame.to_map is {place}, which no floor shows to be right; measure it with stopgo align"
