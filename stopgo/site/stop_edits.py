"""Cost of a change of stops by hand, before the plan is made again: coverage, views from two stops, time.

Only the changed stops are looked from, and the targets that the others see are known. The tour stays in its
order; a new stop is driven where the detour is shortest. So the cost is there at once, and the route of the
plan that follows is at most as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.stages import Route
from stopgo.mission.stages.sight import Sight
from stopgo.planner.routing import check_position, legs_between
from stopgo.planner.visibility.sight.sightlines import SightLines

Spot = tuple[float, float]


@dataclass(frozen=True, eq=False)
class EditablePlan:
    """A plan whose stops may be changed by hand."""

    mission: Mission
    route: Route
    sight: Sight

    def cost(self, kept: Sequence[str], added: Sequence[Spot]) -> dict[str, Any]:
        """Return the figures with these stops of the plan and stops at more positions.

        Raises
        ------
        InputError
            If the robot does not fit at a position, or does not reach it.
        """
        for spot in added:
            check_position(self.route.visibility.candidates, "stop", spot)
        return {"before": self._before, "after": self.figures(kept, added)}

    @cached_property
    def _before(self) -> dict[str, float]:
        return self.figures([stop.id for stop in self.mission.stops], ())

    def figures(self, kept: Sequence[str], added: Sequence[Spot]) -> dict[str, float]:
        """Return the number of stops, coverage, fraction of targets seen from two stops, route and time."""
        totals = self.sight.totals
        views = self.sight.views_from(kept) + sum(self._views_from(spot) for spot in added)
        visible = totals.amount(totals.visible)
        length_m = self._length_m(kept, added)
        return {
            "stops": len(kept) + len(added),
            "coverage": totals.coverage(totals.enough(views)).whole.coverage or 0.0,
            "twice": totals.amount((views > 1) & totals.visible) / visible if visible else 0.0,
            "length_m": length_m,
            "total_s": self._total_s(len(kept) + len(added), length_m),
        }

    def _views_from(self, spot: Spot) -> IntArray:
        views = np.zeros(len(self.sight.totals.weight), dtype=np.int64)
        views[np.unique(self._lines.seen_from(np.array(spot)))] = 1
        return views

    def _total_s(self, stops: int, length_m: float) -> float:
        """Return the planned time, changed by the stops and the way that are more or less."""
        mission, first = self.mission, self.mission.stops[0]
        more = stops - len(mission.stops)
        way_s = (length_m - self._planned_m) / mission.robot.speed
        return schedule(mission).total_s + way_s + more * (first.settle_s + first.scan.duration_s)

    def _length_m(self, kept: Sequence[str], added: Sequence[Spot]) -> float:
        stay = {*kept}
        spots = [self._spots[k] for k, name in enumerate(self._names) if name is None or name in stay]
        lengths = legs_between(self.route.visibility.space, np.array([*spots, *added])).lengths
        order = [*range(len(spots))]
        for new in range(len(spots), len(spots) + len(added)):
            order = _with_shortest_detour(order, new, lengths, is_open=self.mission.return_ is None)
        return float(sum(lengths[a, b] for a, b in pairwise(order)))

    @cached_property
    def _lines(self) -> SightLines:
        return SightLines(self.route.visibility.space)

    @cached_property
    def _planned_m(self) -> float:
        return self._length_m([stop.id for stop in self.mission.stops], ())

    @cached_property
    def _names(self) -> list[str | None]:
        """Stops in the order of the tour; `None` for its start, and its end if it returns."""
        end = [] if self.mission.return_ is None else [None]
        return [None, *(stop.id for stop in self.mission.stops), *end]

    @cached_property
    def _spots(self) -> list[Spot]:
        mission = self.mission
        end = [] if mission.return_ is None else [mission.return_[-1]]
        return [(mission.start.x, mission.start.y), *((one.x, one.y) for one in mission.stops), *end]


def _with_shortest_detour(order: list[int], new: int, lengths: FloatArray, *, is_open: bool) -> list[int]:
    """Return the tour with one point more, where that is the shortest; an open tour may end with it."""
    detours = [lengths[a, new] + lengths[new, b] - lengths[a, b] for a, b in pairwise(order)]
    if is_open:
        detours.append(lengths[order[-1], new])
    place = int(np.argmin(detours)) + 1
    return [*order[:place], new, *order[place:]]
