"""Coverage as driven: what can be seen from where a robot really stood, beside what its plan reckons with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from stopgo.mission.geometry import BoolArray
from stopgo.mission.stages.coverage_totals import CoverageTotals
from stopgo.mission.stages.figures import Share, Shares


@dataclass(frozen=True, eq=False)
class AsDriven:
    """What was in sight from the places where a robot stood long enough for a scan."""

    ledger: CoverageTotals
    """The units of the floor, n of them."""
    planned: BoolArray
    """Whether enough of the mission's stops see each unit (n,)."""
    driven: BoolArray
    """Whether enough of the places where the robot stood see it (n,)."""

    @cached_property
    def shares(self) -> Shares:
        return self.ledger.shares(self.driven)

    @cached_property
    def pairs(self) -> tuple[tuple[Share, Share], ...]:
        """Of the whole, of every kind and of every room with targets: as planned, and as driven."""
        planned = {share.name: share for share in _all(self.ledger.shares(self.planned))}
        return tuple((planned[share.name], share) for share in _all(self.shares))

    @cached_property
    def elements(self) -> tuple[Share, ...]:
        """Every element with targets, in the floor's order, as driven."""
        return self.ledger.by_element(self.driven)

    @property
    def enough(self) -> bool:
        """Whether all that was asked for was in sight."""
        return not self.shares.short


def _all(shares: Shares) -> tuple[Share, ...]:
    return (shares.whole, *shares.kinds, *shares.rooms)
