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
    if not is_of_plan(mission, space) and not is_follow_up(mission, space):
        yield Problem(
            "$.id",
            "is not that of a plan of this floor by $.origin.parameters and $.origin.stopgo: one of these "
            "was changed since, or a file read with the floor (a map's picture, a schedule); plan again",
        )
    if mission.share is not UNSET and not space.settings.divided:
        yield Problem("$.share", "is set, but $.origin.parameters divide the floor among no robots or tours")
    if mission.georeference != georeference_of(space):
        yield Problem("$.georeference", "is not that of the floor or of $.origin.parameters; plan again")
    if space.floor.on_robots_map and mission.frame != frame_of_floor(space.floor):
        yield Problem("$.frame", "is not that of the robot's map, in which the floor was drawn; plan again")


def unverified(mission: Mission, space: NavigableSpace) -> Iterator[str]:
    """Return in words what no floor shows to be right: its own name, and the place in a robot's map."""
    named, floor, to_map = mission.origin.floor, space.floor, mission.frame.to_map
    if named != floor.name:
        yield (
            f"$.origin.floor is {named}, this file's floor is called {floor.name}: "
            "it was renamed since, or the mission was changed"
        )
    if to_map is not None and not floor.on_robots_map:
        place = f"{to_map.x:.3f},{to_map.y:.3f},{math.degrees(to_map.heading):.3f}"
        yield f"$.frame.to_map is {place}, which no floor shows to be right; measure it with stopgo align"
