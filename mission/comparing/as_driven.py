"""Coverage as driven: the targets visible from the robot's real standstills, compared with the plan."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from stopgo.mission.geometry import BoolArray
from stopgo.mission.stages.coverage_totals import CoverageTotals
from stopgo.mission.stages.figures import CoverageByGroup, CoveragePair, GroupCoverage


@dataclass(frozen=True, eq=False)
class AsDriven:
    """Targets visible from the positions where a robot was stationary long enough for a scan."""

    totals: CoverageTotals
    """The units of the floor, n of them."""
    planned: BoolArray
    """True for units that enough stops of the mission see (n,)."""
    driven: BoolArray
    """True for units that enough of the robot's standstills see (n,)."""

    @cached_property
    def coverage(self) -> CoverageByGroup:
        return self.totals.coverage(self.driven)

    @cached_property
    def pairs(self) -> tuple[CoveragePair, ...]:
        """Fractions of the whole, of every kind and of every room with targets: as planned, and as driven."""
        planned = {group.name: group for group in _all(self.totals.coverage(self.planned))}
        return tuple((planned[group.name], group) for group in _all(self.coverage))

    @cached_property
    def elements(self) -> tuple[GroupCoverage, ...]:
        """Every element with targets, in the floor's order, as driven."""
        return self.totals.by_element(self.driven)

    @property
    def enough(self) -> bool:
        """True if all that was required was visible."""
        return not self.coverage.short


def _all(groups: CoverageByGroup) -> tuple[GroupCoverage, ...]:
    return (groups.whole, *groups.kinds, *groups.rooms)
