"""How a run goes on by a new revision of its mission: between two stops, and only if the way so far stays.

The stop that is worked on is finished as the old revision says. What has been driven, and the way to that
stop, must be the same in the new one: so the next leg begins where the robot stands, the way home is the
way it came, and stops that are done stay done. Everything after may be different.
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
    """The revision is followed once the stop that is worked on is behind; it replaces one that waited."""
    waiting = changed(run, next_revision=mission.revision)
    return Change(waiting, (partial(RevisionWaits, waiting=mission.revision),))


def taken(run: Run, mission: Mission) -> Change:
    """Between two stops: from here on the run follows `mission`."""
    revised = changed(run, revision=mission.revision, next_revision=None)
    change = next_leg(revised, mission)
    return Change(change.run, (partial(RevisionTaken, before=run.revision or 0), *change.events))


def dropped(change: Change) -> Change:
    """A revision that waits is let go with the run; told before the run's last event."""
    run = change.run
    if run.next_revision is None or not run.over:
        return change
    telling = partial(RevisionDropped, waiting=run.next_revision)
    return Change(changed(run, next_revision=None), (telling, *change.events))


def what_differs(run: Run, held: Mission, revised: Mission) -> str:
    """What of the way so far the new revision would change; empty if nothing."""
    if revised.frame != held.frame:
        return "its frame is another"
    for index, stop in enumerate(held.stops[: run.at + 1]):
        there = revised.stops[index] if index < len(revised.stops) else None
        if there is None or _way(there) != _way(stop):
            last = held.stops[min(run.at, len(held.stops) - 1)]
            return (
                f"stop {stop.id} or the way to it is not the same; only what comes after {last.id} may change"
            )
    return ""


def _way(stop: Stop) -> tuple[object, ...]:
    return (stop.id, stop.x, stop.y, stop.approach)
