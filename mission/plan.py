"""A plan: the missions of a floor, and every noun on the way to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

from stopgo.mission.document import Mission
from stopgo.mission.document.schedule import schedule
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, NavigableSpace, Route, Selection, Visibility
from stopgo.mission.stages.figures import Figures, percent


@dataclass(frozen=True, eq=False, repr=False)
class PartPlan:
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

    @property
    def candidates(self) -> Candidates:
        return self.visibility.candidates

    @property
    def space(self) -> NavigableSpace:
        return self.candidates.space

    @property
    def floor(self) -> FloorPlan:
        return self.space.floor

    def nouns(self) -> Iterator[Any]:
        """Every noun from the floor to the figures, in the order in which they are made."""
        yield from (self.floor, self.space, self.candidates, self.visibility)
        yield from (self.selection, self.route, self.figures)

    def __repr__(self) -> str:
        share, length = percent(self.figures.whole.coverage), self.route.length
        return f"PartPlan({self.mission.name}: {len(self.mission.stops)} stops, {share} seen, {length:.1f} m)"


@dataclass(frozen=True, eq=False)
class DividedPlan:
    """A part's plan, shared out among robots or tours: a mission for each."""

    kind: Literal["robot", "tour"]
    whole: PartPlan
    """The plan of all stops, as one robot would drive them in one tour."""
    shares: tuple[PartPlan, ...]
    limit_s: float | None
    """Seconds that every tour stays within; None for robots."""
    bound: float
    """For robots, seconds that the longest takes at least; for tours, how many there are at least."""
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
    """Each with its mission; of a plan that is shared out, a share each."""
    divided: DividedPlan | None = None
    """How the stops are shared out; None where one mission has them all."""

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
        """The missions among which the stops are shared out; none where one mission has them all."""
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
        """The first part's plan with all its stops, shared out or not."""
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
        """The printed plan of the first part, for notebooks."""
        from stopgo.mission.files.plan_svg import plan_svg

        whole = self.whole
        return plan_svg(whole.route, whole.mission, whole.figures, self.shared, date="").decode()
