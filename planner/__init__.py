"""Floor -> mission: where the scanner must stand, and by which route a robot visits those stops."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mission.document import Mission
    from mission.floor import FloorPlan
    from mission.planning import Candidates, NavigableSpace
    from mission.settings import Settings

Observe = Callable[[Any], None]


def plan(floor: FloorPlan, settings: Settings, *, observe: Observe = lambda noun: None) -> Mission:
    """Plan the part of the floor that holds the start, else the largest.

    Every noun on the way is handed to `observe` as soon as it is made.

    Raises
    ------
    AnswerIsNo
        No target, no candidate, or nothing in sight.
    InputError
        A start, an end or a variant that does not fit the floor.
    """
    from planner.candidates import candidates
    from planner.navigable import navigable

    observe(floor)
    space = navigable(floor, settings)
    observe(space)
    return plan_part(candidates(space), observe=observe)


def plan_part(
    found: Candidates, *, observe: Observe, number: int = 0, planned: frozenset[int] | None = None
) -> Mission:
    """Plan from candidates on; `number` tells the missions of one floor apart.

    `planned` are all parts of the floor that some plan of it enters; by default this one.
    """
    from planner.appraisal import figures_of
    from planner.assemble import assemble
    from planner.refine import refined
    from planner.routing import route
    from planner.selection import select
    from planner.visibility import visibility

    observe(found)
    seen = visibility(found)
    observe(seen)
    selection = refined(select(seen))
    if selection.visibility is not seen:
        observe(selection.visibility.candidates)
        observe(selection.visibility)
    observe(selection)
    driven = route(selection)
    observe(driven)
    observe(figures_of(driven, planned=planned))
    mission = assemble(driven, part=number)
    observe(mission)
    return mission


def parts_to_plan(space: NavigableSpace) -> list[Candidates]:
    """Candidates of every part that has any: the part of `plan` first, then the others by area.

    Parts that hold no room are left out where the floor has rooms: they lie behind exterior doors.
    """
    from planner.candidates import candidates

    first = candidates(space)
    in_room = [space.rooms[k].room is not None or not space.floor.rooms for k in first.room]
    found = {int(part) for part, inside in zip(first.part, in_room, strict=True) if part >= 0 and inside}
    return [first, *(candidates(space, part=part) for part in sorted(found - {first.chosen_part}))]


__all__ = ["Observe", "parts_to_plan", "plan", "plan_part"]
