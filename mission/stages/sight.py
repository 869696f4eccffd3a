"""Visibility from each stop of a mission: enough to compute the acquired coverage once a run is over."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import UNSET

from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import BoolArray, IntArray, frozen
from stopgo.mission.stages import Route, Targets
from stopgo.mission.stages.coverage_totals import CoverageTotals, totals_of_plan
from stopgo.mission.stages.figures import CoverageByGroup, Figures

SAME_PLACE_M = 1e-6
"""Within this distance of a planned stop, a stop of another revision sees the same."""


@dataclass(frozen=True)
class SeenFrom:
    """Position of a stop, as planned."""

    id: str
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class Sight:
    """Visibility of a mission's targets from the stops of one revision.

    Run k of stop number s, `pointer[s] <= k < pointer[s + 1]`, means that units `first[k]` to `last[k]`
    (inclusive, counted over all targets) are seen from this stop.
    """

    mission_id: str
    revision: int
    digest: str
    """Digest of the mission."""
    targets: Targets
    totals: CoverageTotals
    stops: tuple[SeenFrom, ...]
    pointer: IntArray
    first: IntArray
    last: IntArray

    @cached_property
    def planned(self) -> CoverageByGroup:
        """Coverage by all stops."""
        return self.totals.coverage(self.all_seen)

    @cached_property
    def all_seen(self) -> BoolArray:
        """True for units that enough stops see (n,)."""
        return self.seen_units(self.ids)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        return tuple(stop.id for stop in self.stops)

    def knows(self, stop: Stop) -> bool:
        """Return True if it has data for this stop, at the position in the mission."""
        number = self._number.get(stop.id)
        if number is None:
            return False
        known = self.stops[number]
        return bool(np.hypot(known.x - stop.x, known.y - stop.y) <= SAME_PLACE_M)

    def seen_units(self, stops: Collection[str]) -> BoolArray:
        """Return True for units that enough of these stops see (n,); stops of other plans see nothing."""
        return self.totals.enough(self.views_from(stops))

    def views_from(self, stops: Collection[str]) -> IntArray:
        """Return the number of these stops that see each unit (n,)."""
        views = np.zeros(len(self.totals.weight), dtype=np.int64)
        for stop in stops:
            number = self._number.get(stop)
            if number is not None:
                views += self._seen_by(number)
        return frozen(views, np.int64)

    def _seen_by(self, number: int) -> BoolArray:
        """Return True for units that a stop sees (n,)."""
        runs = slice(int(self.pointer[number]), int(self.pointer[number + 1]))
        change = np.zeros(len(self.totals.weight) + 1, dtype=np.int64)
        np.add.at(change, self.first[runs], 1)
        np.add.at(change, self.last[runs] + 1, -1)
        return np.asarray(np.cumsum(change[:-1]) > 0)

    def coverage(self, stops: Collection[str]) -> CoverageByGroup:
        """Return the coverage by these stops."""
        return self.totals.coverage(self.seen_units(stops))

    def brings(self, stop: str, views: IntArray) -> float:
        """Return the gain of this stop, as a fraction of all visible, after views from others (n,)."""
        return self.totals.brings(views, self.views_from([stop]))

    @cached_property
    def _number(self) -> dict[str, int]:
        return {stop.id: number for number, stop in enumerate(self.stops)}


def required_of(sight: Sight, mission: Mission) -> Sight:
    """Return the same with what is required of a mission: nothing if it shares its floor with others."""
    return sight if mission.share is UNSET else replace(sight, totals=sight.totals.without_requirements)


def sight_of(route: Route, mission: Mission, figures: Figures, totals: CoverageTotals | None = None) -> Sight:
    """Return the visibility of a plan's stops, in the order of driving; its `totals` may be known."""
    visibility = route.visibility
    rows = route.selection.chosen[route.order].tolist()
    runs = [slice(int(visibility.pointer[row]), int(visibility.pointer[row + 1])) for row in rows]
    counts = [run.stop - run.start for run in runs]
    return Sight(
        mission_id=mission.id,
        revision=mission.revision,
        digest=mission.digest,
        targets=visibility.targets,
        totals=totals or totals_of_plan(visibility, {item.room: item.why for item in figures.unreached}),
        stops=tuple(SeenFrom(stop.id, stop.x, stop.y) for stop in mission.stops),
        pointer=frozen(np.concatenate([[0], np.cumsum(counts)]), np.int64),
        first=frozen(np.concatenate([[0][:0], *(visibility.first[run] for run in runs)]), np.int64),
        last=frozen(np.concatenate([[0][:0], *(visibility.last[run] for run in runs)]), np.int64),
    )
