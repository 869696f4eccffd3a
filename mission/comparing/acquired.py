"""Acquired coverage: the targets that a run's scans saw, compared with the planned ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from stopgo.mission.geometry import BoolArray
from stopgo.mission.stages.figures import CoverageByGroup, CoveragePair, GroupCoverage, how_bad
from stopgo.mission.stages.sight import Sight

Certainty = Literal["yes", "no", "unknown"]


@dataclass(frozen=True, eq=False)
class Acquired:
    """Units seen by the scanned stops, computed again from the visibility of each stop."""

    sight: Sight
    """Plan of the newest known revision that the run followed."""
    planned_seen: BoolArray
    """True for units that enough planned stops see (n,)."""
    seen: BoolArray
    """True for units that enough scanned stops saw (n,)."""
    perhaps: BoolArray
    """The same, if every doubtful stop was scanned."""
    lost: dict[str, float]
    """Gain of a scan at each missing stop, as a fraction of all that is visible."""
    unknown: tuple[str, ...] = ()
    """Scanned stops without visibility data: more was seen than is counted."""
    is_part: bool = False
    """True if missions that share the floor are not known: their scans may have seen more."""

    @cached_property
    def coverage(self) -> CoverageByGroup:
        return self.sight.totals.coverage(self.seen)

    @cached_property
    def elements(self) -> tuple[GroupCoverage, ...]:
        """Every element with targets, in the floor's order."""
        return self.sight.totals.by_element(self.seen)

    @cached_property
    def planned(self) -> CoverageByGroup:
        return self.sight.totals.coverage(self.planned_seen)

    @cached_property
    def rooms(self) -> tuple[CoveragePair, ...]:
        """Rooms with targets as planned and as acquired, least seen first; last, units in no room."""
        totals = self.sight.totals
        planned, acquired = totals.rooms_seen(self.planned_seen), totals.rooms_seen(self.seen)
        return (*_paired(planned[:-1], acquired[:-1]), *_paired(planned[-1:], acquired[-1:]))

    @cached_property
    def kinds(self) -> tuple[CoveragePair, ...]:
        """The same of every kind of element."""
        totals = self.sight.totals
        return _paired(totals.kinds_seen(self.planned_seen), totals.kinds_seen(self.seen))

    @cached_property
    def answer(self) -> Certainty:
        """Answer to: is all seen that was required, of the whole, every room and every kind?"""
        if not self.coverage.short:
            return "yes"
        if self.unknown or self.is_part or not self.sight.totals.coverage(self.perhaps).short:
            return "unknown"
        return "no"


def _paired(
    planned: tuple[GroupCoverage, ...], acquired: tuple[GroupCoverage, ...]
) -> tuple[CoveragePair, ...]:
    pairs = [(before, after) for before, after in zip(planned, acquired, strict=True) if after.total]
    return tuple(sorted(pairs, key=lambda pair: how_bad(pair[1])))
