"""What the scanned stops of a run really saw, and what the others cost."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.comparison import StopComparison
from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages.sight import Sight

SCANNED, UNSURE = "scanned", "unconfirmed"


def acquired_by(
    stops: Sequence[StopComparison], missions: Sequence[Mission], sights: Iterable[Sight]
) -> Acquired | None:
    """What the stops of a run saw; None where no plan of this mission tells what they see.

    `missions` are the revisions that were followed. Their plans are of one floor and one set of
    parameters, which the mission's id is a hash of, so that their targets are the same.
    """
    known = _of(missions[-1], sights)
    if not known:
        return None
    last = known[-1]
    places = {stop.id: stop for mission in missions for stop in mission.stops}
    done = [item.stop for item in stops if item.outcome == SCANNED]
    unsure = [item.stop for item in stops if item.outcome == UNSURE]
    views = _views(done, places, known)
    seen = last.ledger.enough(views)
    wanted = [item.stop for item in stops if item.outcome not in (SCANNED, UNSURE)]
    return Acquired(
        sight=last,
        seen=seen,
        perhaps=last.ledger.enough(views + _views(unsure, places, known)),
        lost={stop: last.brings(stop, views) for stop in wanted if stop in last.ids},
        unknown=tuple(stop for stop in done if _knowing(stop, places, known) is None),
    )


def _of(mission: Mission, sights: Iterable[Sight]) -> list[Sight]:
    """The plans of this mission, by revision; those of other targets than the newest are left out."""
    mine = sorted(
        (item for item in sights if item.mission_id == mission.id and item.revision <= mission.revision),
        key=lambda item: item.revision,
    )
    return [item for item in mine if len(item.ledger.weight) == len(mine[-1].ledger.weight)]


def _views(stops: Iterable[str], places: dict[str, Stop], sights: Sequence[Sight]) -> IntArray:
    """How many of these stops see each unit."""
    views = np.zeros(len(sights[-1].ledger.weight), dtype=np.int64)
    for stop in stops:
        sight = _knowing(stop, places, sights)
        if sight is not None:
            views += sight.views_from([stop])
    return frozen(views, np.int64)


def _knowing(stop: str, places: dict[str, Stop], sights: Sequence[Sight]) -> Sight | None:
    """The newest plan that tells what is seen from where this stop is."""
    place = places.get(stop)
    having = [sight for sight in sights if place is not None and sight.knows(place)]
    return having[-1] if having else None
