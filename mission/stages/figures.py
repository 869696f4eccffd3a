"""Figures of a plan: one set of numbers for the terminal, JSON, the printed plan and the recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from stopgo.mission.console.table import counted
from stopgo.mission.floor import Finding, Rank
from stopgo.mission.stages import Unreached


@dataclass(frozen=True)
class GroupCoverage:
    """Coverage of some targets: their visible part, and what the chosen stops see of it.

    Counted in metres of boundary, or in units by the paper's rule.
    """

    name: str
    """A room, a kind of element, or `all`."""
    total: float
    visible: float
    """Visible from any reachable candidate."""
    seen: float
    """Seen by the stops, of all visible."""
    required: float | None = None
    """Least fraction required, if any."""
    why: str = ""
    """Reason why a room is not entered."""

    @property
    def coverage(self) -> float | None:
        """Fraction of all visible that is seen; None if nothing is visible."""
        return self.seen / self.visible if self.visible else None

    @property
    def visible_fraction(self) -> float:
        """Fraction of the total that is visible."""
        return self.visible / self.total if self.total else 0.0

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """Total, visible and seen part, and the coverage, as tables print them."""
        return f"{self.total:.1f}", f"{self.visible:.1f}", f"{self.seen:.1f}", percent(self.coverage)

    @property
    def met(self) -> bool:
        """True if the required fraction is seen; rounding alone never decides."""
        return self.required is None or self.seen >= (self.required - 1e-9) * self.visible


CoveragePair = tuple[GroupCoverage, GroupCoverage]
"""Planned and present coverage of one group."""


def pair_cells(planned: GroupCoverage, group: GroupCoverage) -> tuple[str, str, str, str]:
    """Return name, planned, present and required coverage in percent, as tables print them."""
    before, now, least = (
        percent(value).removesuffix(" %") for value in (planned.coverage, group.coverage, group.required)
    )
    return group.name, before, now, least


@dataclass(frozen=True)
class CoverageByGroup:
    """Coverage of all targets, by room and kind."""

    whole: GroupCoverage
    rooms: tuple[GroupCoverage, ...]
    """Every room with targets, the one least seen first."""
    kinds: tuple[GroupCoverage, ...]
    """Every kind of target, the one least seen first."""

    @property
    def short(self) -> tuple[GroupCoverage, ...]:
        """Those with less coverage than required."""
        return tuple(group for group in (self.whole, *self.rooms, *self.kinds) if not group.met)


@dataclass(frozen=True)
class LimitCost:
    """Cost of one limit on how targets are seen, from a quick plan without it."""

    limit: str
    """The parameter of the limit."""
    words: str
    stops: int
    """Number of stops of the plan, with all limits."""
    without: int
    """Approximate number of stops without this limit."""
    bound: int
    """Lower bound of the stops without this limit."""

    @property
    def text(self) -> str:
        """The cost in words."""
        more = self.stops - self.without
        cost = "costs no stop" if more <= 0 else f"costs about {counted(more, 'stop')}"
        return f"{cost} (about {self.without} without, at least {self.bound})"


@dataclass(frozen=True)
class Quality:
    """Limits on how targets are seen, and their effect."""

    costs: tuple[LimitCost, ...]
    in_sight: float
    """Amount of the targets, in the plan's unit, in the line of sight of some candidate."""
    possible: float
    """Part of it that enough candidates see within the limits."""

    def text(self, unit: str) -> str:
        """Return the possible part in words."""
        possible = percent(self.possible / self.in_sight if self.in_sight else None)
        return (
            f"{possible} of the {self.in_sight:.0f} {unit} in line of sight can be covered within the limits"
        )


@dataclass(frozen=True)
class Figures:
    """A plan in numbers."""

    rule: Literal["length", "paper"]
    """`length`: fractions of metres. `paper`: fractions of units."""
    whole: GroupCoverage
    rooms: tuple[GroupCoverage, ...]
    """Every room with targets, the one least seen first."""
    kinds: tuple[GroupCoverage, ...]
    """Every kind of target, the one least seen first."""
    rooms_m2: float
    """Floor area of all rooms, with the floor outside every room."""
    reached_m2: float
    """Floor area of the rooms, or parts of rooms, that the robot can reach."""
    unreached: tuple[Unreached, ...]
    findings: tuple[Finding, ...]
    """All findings, those with the greatest effect on the plan first."""
    quality: Quality | None = None
    """None if any view counts, from any stop."""

    @property
    def unit(self) -> str:
        return "m" if self.rule == "length" else "units"

    @property
    def grave(self) -> tuple[Finding, ...]:
        """Findings that may make the plan wrong or incomplete."""
        return tuple(item for item in self.findings if item.rank == Rank.GRAVE)

    @property
    def crosses_ignored(self) -> bool:
        """True if a leg crosses lines of unknown meaning."""
        return any(item.code == LEG_OVER_IGNORED for item in self.findings)

    @property
    def is_inaccurate(self) -> bool:
        """True if a scan's predicted error exceeds the accuracy required."""
        return any(item.code == ACCURACY_NOT_MET for item in self.findings)


LEG_OVER_IGNORED = "leg_over_ignored"
ACCURACY_NOT_MET = "accuracy_not_met"


def worst_first(groups: Sequence[GroupCoverage]) -> tuple[GroupCoverage, ...]:
    """Sort by coverage, then by name; without visible targets last."""
    return tuple(sorted(groups, key=how_bad))


def how_bad(group: GroupCoverage) -> tuple[bool, float, str]:
    """Return the sort key of `worst_first`."""
    return group.coverage is None, group.coverage or 0.0, group.name


def percent(fraction: float | None, *, digits: int = 1) -> str:
    """Format a fraction, cut and not rounded up, so that 89.96 % is not printed as 90.0 %."""
    if fraction is None:
        return "-"
    steps = 10**digits
    return f"{math.floor(100 * fraction * steps + 1e-9) / steps:.{digits}f} %"
