"""Computation of the acquired coverage of a run, and of the loss by each missing scan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.comparison import StopComparison
from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages.sight import Sight

SCANNED, UNCONFIRMED = "scanned", "unconfirmed"


def acquired_by(
    stops: Sequence[StopComparison], missions: Sequence[Mission], sights: Iterable[Sight]
) -> Acquired | None:
    """Return the acquired coverage; None if no plan of this mission contains visibility data.

    `missions` are the revisions that were followed. Their plans are of one floor and one set of
    parameters, which the mission's id is a hash of, so that their targets are the same.
    """
    plans = _plans_of(missions[-1], sights)
    if not plans:
        return None
    last = plans[-1]
    planned = {stop.id: stop for mission in missions for stop in mission.stops}
    done = [item.stop for item in stops if item.outcome == SCANNED and not item.is_doubtful]
    doubtful = [item.stop for item in stops if item.is_doubtful]
    views = _views(done, planned, plans)
    seen = last.ledger.enough(views)
    wanted = [item.stop for item in stops if item.outcome not in (SCANNED, UNCONFIRMED)]
    return Acquired(
        sight=last,
        seen=seen,
        perhaps=last.ledger.enough(views + _views(doubtful, planned, plans)),
        lost={stop: last.brings(stop, views) for stop in wanted if stop in last.ids},
        unknown=tuple(stop for stop in done if _plan_with(stop, planned, plans) is None),
    )


def _plans_of(mission: Mission, sights: Iterable[Sight]) -> list[Sight]:
    """Return the plans of this mission, by revision; those of other targets than the newest are left out."""
    mine = sorted(
        (item for item in sights if item.mission_id == mission.id and item.revision <= mission.revision),
        key=lambda item: item.revision,
    )
    return [item for item in mine if len(item.ledger.weight) == len(mine[-1].ledger.weight)]


def _views(stops: Iterable[str], planned: dict[str, Stop], sights: Sequence[Sight]) -> IntArray:
    """Return the number of these stops that see each unit."""
    views = np.zeros(len(sights[-1].ledger.weight), dtype=np.int64)
    for stop in stops:
        sight = _plan_with(stop, planned, sights)
        if sight is not None:
            views += sight.views_from([stop])
    return frozen(views, np.int64)


def _plan_with(stop: str, planned: dict[str, Stop], sights: Sequence[Sight]) -> Sight | None:
    """Return the newest plan that has visibility data for this stop at its position."""
    position = planned.get(stop)
    found = [sight for sight in sights if position is not None and sight.knows(position)]
    return found[-1] if found else None
