"""Seen part of a driven path, and the gaps in its poses."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.mission.console.table import counted, duration
from stopgo.mission.document import Point
from stopgo.mission.stages.figures import percent

MOST_GAPS = 6
"""Number of gaps that a text lists, the longest first."""


@dataclass(frozen=True)
class PoseGap:
    """A time of a run without poses; seconds since the run began."""

    begin_s: float
    end_s: float
    begin: Point | None
    """Last position before the gap; None if the run began in it."""
    end: Point | None
    """First position after it; None if the poses ended in it."""
    metres: float
    """Length of the path in the gap, along the legs, and at least the straight distance."""
    restarted: bool = False
    """True if the robot restarted in the gap."""

    @property
    def seconds(self) -> float:
        return self.end_s - self.begin_s

    @property
    def words(self) -> str:
        """The gap in words: length, begin, and where."""
        missing = f"no poses for {duration(self.seconds)} from {duration(self.begin_s)}"
        if self.restarted:
            missing += ", the robot restarted"
        return f"{missing}: {self.metres:.1f} m of the path unseen, {self._where}"

    @property
    def _where(self) -> str:
        if self.begin is not None and self.end is not None:
            return f"from ({_metres(self.begin)}) to ({_metres(self.end)})"
        if self.end is not None:
            return f"from the start to ({_metres(self.end)})"
        return "all of it" if self.begin is None else f"after ({_metres(self.begin)})"


@dataclass(frozen=True)
class SightedPath:
    """Path of a run as far as its poses show it."""

    seen_m: float
    """Length of the path between poses without a gap."""
    gaps: tuple[PoseGap, ...] = ()

    @property
    def unseen_s(self) -> float:
        return sum(gap.seconds for gap in self.gaps)

    @property
    def unseen_m(self) -> float:
        return sum(gap.metres for gap in self.gaps)

    @property
    def fraction(self) -> float:
        """Seen fraction of the path by length; 1 if no path is missing."""
        return self.seen_m / (self.seen_m + self.unseen_m) if self.unseen_m else 1.0

    @property
    def longest(self) -> tuple[PoseGap, ...]:
        """The longest gaps, in the order of time."""
        longest = sorted(self.gaps, key=lambda gap: -gap.seconds)[:MOST_GAPS]
        return tuple(sorted(longest, key=lambda gap: gap.begin_s))

    @property
    def lines(self) -> tuple[str, ...]:
        """A line for each of the longest gaps, and the number of the others."""
        rest = len(self.gaps) - MOST_GAPS
        return (*(gap.words for gap in self.longest), *([counted(rest, "shorter gap")] if rest > 0 else []))

    @property
    def limits(self) -> str:
        """Part of the path that figures of the path are of; empty if all was seen."""
        if not self.gaps:
            return ""
        return f"while recorded ({percent(self.fraction)} of the path), unseen {duration(self.unseen_s)}"


def _metres(point: Point) -> str:
    return f"{point[0]:.2f}, {point[1]:.2f}"
