"""Change of a running mission to a new revision: between two stops, and only if the driven route stays.

The current stop is finished as the old revision says. The legs driven so far and the leg to the current
stop must be the same in the new revision. So the next leg begins at the robot, the robot can return on the
route it came by, and done stops stay done. Everything after may be different.
"""

from __future__ import annotations

from functools import partial
from typing import Literal

from stopgo.mission.document import Mission, Stop
from stopgo.mission.run.events import RevisionDropped, RevisionTaken, RevisionWaits
from stopgo.mission.run.states import Change, Run, changed, next_leg

RevisionPolicy = Literal["next-stop", "refuse"]
POLICIES: dict[str, RevisionPolicy] = {"next-stop": "next-stop", "refuse": "refuse"}


def waits(run: Run, mission: Mission) -> Change:
    """Let a revision wait until the current stop is done; it replaces one that waited."""
    waiting = changed(run, next_revision=mission.revision)
    return Change(waiting, (partial(RevisionWaits, waiting=mission.revision),))


def taken(run: Run, mission: Mission) -> Change:
    """Follow `mission` from here on; called between two stops."""
    revised = changed(run, revision=mission.revision, next_revision=None)
    change = next_leg(revised, mission)
    return Change(change.run, (partial(RevisionTaken, before=run.revision or 0), *change.events))


def dropped(change: Change) -> Change:
    """Drop a waiting revision when its run is over; reported before the run's last event."""
    run = change.run
    if run.next_revision is None or not run.over:
        return change
    event = partial(RevisionDropped, waiting=run.next_revision)
    return Change(changed(run, next_revision=None), (event, *change.events))


def driven_route_change(run: Run, held: Mission, revised: Mission) -> str:
    """Return the change of the driven route that a new revision would make; empty if none."""
    if revised.frame != held.frame:
        return "its frame differs"
    for index, stop in enumerate(held.stops[: run.at + 1]):
        there = revised.stops[index] if index < len(revised.stops) else None
        if there is None or _driven_part(there) != _driven_part(stop):
            last = held.stops[min(run.at, len(held.stops) - 1)]
            return f"stop {stop.id} or the leg to it differs; only stops after {last.id} may change"
    return ""


def _driven_part(stop: Stop) -> tuple[object, ...]:
    return (stop.id, stop.x, stop.y, stop.approach)
