"""Computation of the acquired coverage of a run, and of the loss by each missing scan."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from msgspec import UNSET

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.comparison import Comparison, StopComparison
from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import IntArray, frozen
from stopgo.mission.stages.sight import Sight, required_of

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
    last = required_of(plans[-1], missions[-1])
    planned = {stop.id: stop for mission in missions for stop in mission.stops}
    done = [item.stop for item in stops if _is_scanned(item)]
    doubtful = [item.stop for item in stops if item.is_doubtful]
    views = _views(done, planned, plans)
    seen = last.totals.enough(views)
    wanted = [item.stop for item in stops if item.outcome not in (SCANNED, UNCONFIRMED)]
    return Acquired(
        sight=last,
        planned_seen=last.all_seen,
        seen=seen,
        perhaps=last.totals.enough(views + _views(doubtful, planned, plans)),
        lost={stop: last.brings(stop, views) for stop in wanted if stop in last.ids},
        unknown=tuple(stop for stop in done if _plan_with(stop, planned, plans) is None),
    )


def acquired_together(
    runs: Sequence[Comparison], missions: Sequence[Mission], sights: Iterable[Sight]
) -> Acquired | None:
    """Return the coverage that runs acquired together; None without visibility data of each mission.

    `missions` are the newest revisions of one plan of a floor: one mission, or those that share the floor.
    Scans of several runs at one position are one view. A scan outside its tolerance is doubtful.
    """
    known = list(sights)
    plans = [plan for mission in missions for plan in _plans_of(mission, known)]
    if not plans or {plan.mission_id for plan in plans} != {mission.id for mission in missions}:
        return None
    last, share = plans[-1], missions[-1].share
    done = scanned_positions(runs)
    perhaps = {
        (stop.x, stop.y): stop
        for run in runs
        for item, stop in _with_positions(run)
        if item.is_doubtful or item.outside_tolerance
    }
    views = _views_at(done.values(), plans)
    seen = last.totals.enough(views)
    also = [stop for position, stop in perhaps.items() if position not in done]
    stops = [(mission, stop) for mission in missions for stop in mission.stops]
    left = {name_of(mission, stop.id): stop for mission, stop in stops if (stop.x, stop.y) not in done}
    return Acquired(
        sight=last,
        planned_seen=last.totals.enough(_views_at((stop for _, stop in stops), plans)),
        seen=seen,
        perhaps=last.totals.enough(views + _views_at(also, plans)),
        lost={name: last.totals.brings(views, _views_at([stop], plans)) for name, stop in left.items()},
        unknown=tuple(stop.id for stop in done.values() if not any(plan.knows(stop) for plan in plans)),
        is_part=share is not UNSET and len(missions) < share.of,
    )


def name_of(mission: Mission, stop: str) -> str:
    """Return the name of a stop among those of all missions that share its floor."""
    return stop if mission.share is UNSET else f"{mission.share.number}:{stop}"


def scanned_positions(runs: Iterable[Comparison]) -> dict[tuple[float, float], Stop]:
    """Return the stops that a run scanned within tolerance, by planned position."""
    pairs = (pair for run in runs for pair in _with_positions(run))
    return {
        (stop.x, stop.y): stop for item, stop in pairs if _is_scanned(item) and not item.outside_tolerance
    }


def _with_positions(run: Comparison) -> Iterable[tuple[StopComparison, Stop]]:
    """Return the stops of a run that its mission contains, each with its planned position."""
    planned = {stop.id: stop for mission in run.missions for stop in mission.stops}
    return ((item, planned[item.stop]) for item in run.stops if item.stop in planned)


def _is_scanned(item: StopComparison) -> bool:
    return item.outcome == SCANNED and not item.is_doubtful


def _views_at(stops: Iterable[Stop], sights: Sequence[Sight]) -> IntArray:
    """Return the number of these stops, one for each position, that see each unit."""
    views = np.zeros(len(sights[-1].totals.weight), dtype=np.int64)
    for stop in stops:
        views += _views([stop.id], {stop.id: stop}, sights)
    return frozen(views, np.int64)


def _plans_of(mission: Mission, sights: Iterable[Sight]) -> list[Sight]:
    """Return the plans of this mission, by revision; those of other targets than the newest are left out."""
    mine = sorted(
        (item for item in sights if item.mission_id == mission.id and item.revision <= mission.revision),
        key=lambda item: item.revision,
    )
    return [item for item in mine if len(item.totals.weight) == len(mine[-1].totals.weight)]


def _views(stops: Iterable[str], planned: dict[str, Stop], sights: Sequence[Sight]) -> IntArray:
    """Return the number of these stops that see each unit."""
    views = np.zeros(len(sights[-1].totals.weight), dtype=np.int64)
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
