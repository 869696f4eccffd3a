"""A plan: the missions of a floor, and the results of all stages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, OfVisibility, Route, Selection, Visibility
from stopgo.mission.stages.coverage_totals import CoverageTotals, totals_of_plan
from stopgo.mission.stages.figures import Figures, percent
from stopgo.mission.stages.plan_results import PlanResults


@dataclass(frozen=True, eq=False, repr=False)
class PartPlan(OfVisibility):
    """The plan of one connected part of a floor."""

    route: Route
    figures: Figures
    mission: Mission

    @property
    def selection(self) -> Selection:
        return self.route.selection

    @property
    def visibility(self) -> Visibility:
        return self.selection.visibility

    @cached_property
    def totals(self) -> CoverageTotals:
        """Weights and groups of all units; those of a divided plan are also those of its shares."""
        return totals_of_plan(self.visibility, {item.room: item.why for item in self.figures.unreached})

    def stage_results(self) -> Iterator[Any]:
        """Yield every stage result from the floor to the figures, in the order in which they are made."""
        yield from (self.floor, self.space, self.candidates, self.visibility)
        yield from (self.selection, self.route, self.figures)

    @property
    def results(self) -> PlanResults:
        """The plan in numbers."""
        each = (*self.stage_results(), schedule(self.mission), self.mission)
        return PlanResults.of({type(item): item for item in each})

    def __repr__(self) -> str:
        share, length = percent(self.figures.whole.coverage), self.route.length
        return f"PartPlan({self.mission.name}: {len(self.mission.stops)} stops, {share} seen, {length:.1f} m)"


@dataclass(frozen=True, eq=False)
class DividedPlan:
    """The plan of one part of a floor, divided among robots or tours: a mission for each."""

    kind: Literal["robot", "tour"]
    whole: PartPlan
    """The plan of all stops, as one robot would drive them in one tour."""
    shares: tuple[PartPlan, ...]
    limit_s: float | None
    """Seconds that every tour stays within; None for robots."""
    bound: float
    """For robots, lower bound of the longest mission's seconds; for tours, lower bound of their number."""
    method: str

    @property
    def longest_s(self) -> float:
        """Seconds of the longest mission."""
        return max(schedule(share.mission).total_s for share in self.shares)

    @property
    def total_s(self) -> float:
        """Seconds of all missions together."""
        return sum(schedule(share.mission).total_s for share in self.shares)


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """The plans of a floor's parts; the first is of the part that holds the start, else of the largest."""

    parts: tuple[PartPlan, ...]
    """The plan of each part with its mission; of a divided plan, one for each robot or tour."""
    divided: DividedPlan | None = None
    """Division of the stops among robots or tours; None if one mission has them all."""

    @property
    def first(self) -> PartPlan:
        return self.parts[0]

    @property
    def mission(self) -> Mission:
        """The first part's mission."""
        return self.first.mission

    @property
    def missions(self) -> tuple[Mission, ...]:
        return tuple(part.mission for part in self.parts)

    @property
    def shared(self) -> tuple[Mission, ...]:
        """Missions of a divided plan; empty if one mission has all stops."""
        return () if self.divided is None else tuple(share.mission for share in self.divided.shares)

    @property
    def space(self) -> NavigableSpace:
        return self.first.space

    @property
    def floor(self) -> FloorPlan:
        return self.space.floor

    @property
    def settings(self) -> Settings:
        return self.space.settings

    @property
    def whole(self) -> PartPlan:
        """The first part's plan with all its stops, divided or not."""
        return self.first if self.divided is None else self.divided.whole

    @property
    def figures(self) -> Figures:
        return self.whole.figures

    @property
    def route(self) -> Route:
        return self.whole.route

    @property
    def selection(self) -> Selection:
        return self.whole.selection

    def __repr__(self) -> str:
        return f"Plan({', '.join(map(repr, self.parts))})"

    def _repr_svg_(self) -> str:
        """Return the printed plan of the first part, for notebooks."""
        from stopgo.mission.files.plan_svg import plan_svg

        whole = self.whole
        return plan_svg(whole.route, whole.mission, whole.figures, self.shared, date="").decode()
