"""Coverage as acquired: what the scans of a run really saw, beside what its plan would have seen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from stopgo.mission.geometry import BoolArray
from stopgo.mission.stages.figures import Share, Shares, how_bad
from stopgo.mission.stages.sight import Sight

Certainty = Literal["yes", "no", "unknown"]


@dataclass(frozen=True, eq=False)
class Acquired:
    """What stops saw that were scanned, recomputed from what each stop sees."""

    sight: Sight
    """The plan, by the revision that the run followed last of those that are known."""
    seen: BoolArray
    """Whether enough scanned stops saw each unit (n,)."""
    perhaps: BoolArray
    """The same, if every stop was scanned of which nobody says so, though the robot was through with it."""
    lost: dict[str, float]
    """What of all that is visible a scan at each missing stop would still bring, by stop."""
    unknown: tuple[str, ...] = ()
    """Stops that were scanned and of which no plan tells what they see: more was seen than is told."""

    @cached_property
    def shares(self) -> Shares:
        return self.sight.ledger.shares(self.seen)

    @cached_property
    def elements(self) -> tuple[Share, ...]:
        """Every element with targets, in the floor's order."""
        return self.sight.ledger.by_element(self.seen)

    @property
    def planned(self) -> Shares:
        return self.sight.planned

    @cached_property
    def rooms(self) -> tuple[tuple[Share, Share], ...]:
        """Every room with targets as planned and as acquired, least seen first; last what faces none."""
        ledger = self.sight.ledger
        planned, acquired = ledger.rooms_seen(self.sight.all_seen), ledger.rooms_seen(self.seen)
        return (*_paired(planned[:-1], acquired[:-1]), *_paired(planned[-1:], acquired[-1:]))

    @cached_property
    def kinds(self) -> tuple[tuple[Share, Share], ...]:
        """The same of every kind of element."""
        ledger = self.sight.ledger
        return _paired(ledger.kinds_seen(self.sight.all_seen), ledger.kinds_seen(self.seen))

    @cached_property
    def answer(self) -> Certainty:
        """Whether all is seen that the plan was asked for: of the whole, of every room and every kind."""
        if not self.shares.short:
            return "yes"
        if self.unknown or not self.sight.ledger.shares(self.perhaps).short:
            return "unknown"
        return "no"


def _paired(planned: tuple[Share, ...], acquired: tuple[Share, ...]) -> tuple[tuple[Share, Share], ...]:
    pairs = [(before, after) for before, after in zip(planned, acquired, strict=True) if after.total]
    return tuple(sorted(pairs, key=lambda pair: how_bad(pair[1])))
