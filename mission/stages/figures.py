"""What a plan amounts to: one set of numbers for the terminal, JSON, the printed plan and the recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from stopgo.mission.floor import Finding, Rank
from stopgo.mission.stages import Unreached


@dataclass(frozen=True)
class Share:
    """What of some targets can be seen at all, and what of that the chosen stops see.

    Counted in metres of boundary, or in units by the paper's rule.
    """

    name: str
    """A room, a kind of element, or `all`."""
    total: float
    visible: float
    """Seen from any reachable candidate."""
    seen: float
    """Of what is visible, seen by the stops."""
    required: float | None = None
    """Least share asked for, if any."""
    why: str = ""
    """Why a room is not entered."""

    @property
    def coverage(self) -> float | None:
        """Share of what is visible that is seen; None where nothing is visible."""
        return self.seen / self.visible if self.visible else None

    @property
    def visible_share(self) -> float:
        """Share of all that is visible."""
        return self.visible / self.total if self.total else 0.0

    @property
    def met(self) -> bool:
        """Whether as much is seen as is asked for; rounding alone never decides."""
        return self.required is None or self.seen >= (self.required - 1e-9) * self.visible


@dataclass(frozen=True)
class Shares:
    """What of the targets is seen, by room and kind."""

    whole: Share
    rooms: tuple[Share, ...]
    """Every room with targets, the one least seen first."""
    kinds: tuple[Share, ...]
    """Every kind of target, the one least seen first."""

    @property
    def short(self) -> tuple[Share, ...]:
        """Those of which less is seen than is asked for."""
        return tuple(share for share in (self.whole, *self.rooms, *self.kinds) if not share.met)


@dataclass(frozen=True)
class LimitCost:
    """What one limit on how targets are seen costs, by a plan made quickly without it."""

    limit: str
    """The parameter that sets it."""
    words: str
    stops: int
    """Of the plan, with all limits."""
    without: int
    """About how many it takes without this one."""
    bound: int
    """Without this one there are never fewer."""

    @property
    def told(self) -> str:
        """What it costs, in words."""
        more = self.stops - self.without
        cost = "costs no stop" if more <= 0 else f"costs about {more} stop{'s' * (more > 1)}"
        return f"{cost} (about {self.without} without, at least {self.bound})"


@dataclass(frozen=True)
class Quality:
    """How well targets are to be seen, and what that comes to."""

    costs: tuple[LimitCost, ...]
    in_sight: float
    """Of the targets, in the plan's unit, what some candidate has in sight at all."""
    possible: float
    """Of that, what enough candidates see well enough."""

    def told(self, unit: str) -> str:
        """What can be seen as asked, in words."""
        share = percent(self.possible / self.in_sight if self.in_sight else None)
        return f"{share} of the {self.in_sight:.0f} {unit} in sight can be seen as asked"


@dataclass(frozen=True)
class Figures:
    """A plan in numbers."""

    rule: Literal["length", "paper"]
    """Whether shares count metres or units."""
    whole: Share
    rooms: tuple[Share, ...]
    """Every room with targets, the one least seen first."""
    kinds: tuple[Share, ...]
    """Every kind of target, the one least seen first."""
    rooms_m2: float
    """Floor of all rooms, floor outside every room included."""
    reached_m2: float
    """Floor of the rooms, or parts of rooms, that the robot gets to."""
    unreached: tuple[Unreached, ...]
    findings: tuple[Finding, ...]
    """Everything odd, what bears on the plan most first."""
    quality: Quality | None = None
    """None where any view counts, from any stop."""

    @property
    def unit(self) -> str:
        return "m" if self.rule == "length" else "units"

    @property
    def grave(self) -> tuple[Finding, ...]:
        """Findings for which the plan may be wrong or leave something out."""
        return tuple(item for item in self.findings if item.rank == Rank.GRAVE)

    @property
    def crosses_ignored(self) -> bool:
        """Whether a leg crosses lines of which nobody knows what they stand for."""
        return any(item.code == LEG_OVER_IGNORED for item in self.findings)


LEG_OVER_IGNORED = "leg_over_ignored"


def worst_first(shares: Sequence[Share]) -> tuple[Share, ...]:
    """By coverage, then by name; where nothing is visible at the end."""
    return tuple(sorted(shares, key=how_bad))


def how_bad(share: Share) -> tuple[bool, float, str]:
    """What `worst_first` sorts by."""
    return share.coverage is None, share.coverage or 0.0, share.name


def percent(share: float | None, *, digits: int = 1) -> str:
    """A share as people read it, cut and not rounded up, so that 89.96 % is not told as 90.0 %."""
    if share is None:
        return "-"
    steps = 10**digits
    return f"{math.floor(100 * share * steps + 1e-9) / steps:.{digits}f} %"
