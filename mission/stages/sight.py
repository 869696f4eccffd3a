"""What each stop of a mission sees: enough to say, once a run is over, what its scans really saw."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from stopgo.mission.document import Mission, Stop
from stopgo.mission.geometry import BoolArray, IntArray, frozen
from stopgo.mission.stages import Route, Targets
from stopgo.mission.stages.coverage_totals import CoverageTotals, ledger_of
from stopgo.mission.stages.figures import Figures, Shares

SAME_PLACE_M = 1e-6
"""A stop of another revision within this distance of a planned one sees the same."""


@dataclass(frozen=True)
class SeenFrom:
    """A stop, as it was planned."""

    id: str
    x: float
    y: float


@dataclass(frozen=True, eq=False)
class Sight:
    """What the stops of one revision of a mission see of its targets.

    Run k of stop number s, `pointer[s] <= k < pointer[s + 1]`, says that units `first[k]` to `last[k]`
    (inclusive, counted over all targets) are seen from there.
    """

    mission_id: str
    revision: int
    digest: str
    """That of the mission."""
    targets: Targets
    ledger: CoverageTotals
    stops: tuple[SeenFrom, ...]
    pointer: IntArray
    first: IntArray
    last: IntArray

    @cached_property
    def planned(self) -> Shares:
        """What all stops see."""
        return self.ledger.shares(self.all_seen)

    @cached_property
    def all_seen(self) -> BoolArray:
        """Whether each unit is seen from as many stops as it asks for (n,)."""
        return self.seen_units(self.ids)

    @cached_property
    def ids(self) -> tuple[str, ...]:
        return tuple(stop.id for stop in self.stops)

    def knows(self, stop: Stop) -> bool:
        """Whether it tells of this stop, at the place where the mission has it."""
        number = self._number.get(stop.id)
        if number is None:
            return False
        known = self.stops[number]
        return bool(np.hypot(known.x - stop.x, known.y - stop.y) <= SAME_PLACE_M)

    def seen_units(self, stops: Collection[str]) -> BoolArray:
        """Whether enough of these stops see each unit (n,); stops of other plans see nothing."""
        return self.ledger.enough(self.views_from(stops))

    def views_from(self, stops: Collection[str]) -> IntArray:
        """How many of these stops see each unit (n,)."""
        views = np.zeros(len(self.ledger.weight), dtype=np.int64)
        for stop in stops:
            number = self._number.get(stop)
            if number is not None:
                views += self._seen_by(number)
        return frozen(views, np.int64)

    def _seen_by(self, number: int) -> BoolArray:
        """Whether a stop sees each unit (n,)."""
        runs = slice(int(self.pointer[number]), int(self.pointer[number + 1]))
        change = np.zeros(len(self.ledger.weight) + 1, dtype=np.int64)
        np.add.at(change, self.first[runs], 1)
        np.add.at(change, self.last[runs] + 1, -1)
        return np.asarray(np.cumsum(change[:-1]) > 0)

    def shares(self, stops: Collection[str]) -> Shares:
        """What these stops see."""
        return self.ledger.shares(self.seen_units(stops))

    def brings(self, stop: str, views: IntArray) -> float:
        """The share of what is visible that counts as seen with this stop, after views from others (n,)."""
        visible = self.ledger.amount(self.ledger.visible)
        after = self.ledger.enough(views + self.views_from([stop]))
        more = after & ~self.ledger.enough(views) & self.ledger.visible
        return self.ledger.amount(more) / visible if visible else 0.0

    @cached_property
    def _number(self) -> dict[str, int]:
        return {stop.id: number for number, stop in enumerate(self.stops)}


def sight_of(route: Route, mission: Mission, figures: Figures) -> Sight:
    """What the stops of a plan see, in the order of driving."""
    visibility = route.selection.visibility
    rows = route.selection.chosen[route.order].tolist()
    runs = [slice(int(visibility.pointer[row]), int(visibility.pointer[row + 1])) for row in rows]
    counts = [run.stop - run.start for run in runs]
    return Sight(
        mission_id=mission.id,
        revision=mission.revision,
        digest=mission.digest,
        targets=visibility.targets,
        ledger=ledger_of(visibility, {item.room: item.why for item in figures.unreached}),
        stops=tuple(SeenFrom(stop.id, stop.x, stop.y) for stop in mission.stops),
        pointer=frozen(np.concatenate([[0], np.cumsum(counts)]), np.int64),
        first=frozen(np.concatenate([[0][:0], *(visibility.first[run] for run in runs)]), np.int64),
        last=frozen(np.concatenate([[0][:0], *(visibility.last[run] for run in runs)]), np.int64),
    )
