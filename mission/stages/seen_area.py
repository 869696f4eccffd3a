"""Area of a plan's targets that its stops see by the solids of the model, by kind of element."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stopgo.mission.stages.figures import percent


@dataclass(frozen=True)
class SeenArea:
    """Area of some targets in m²."""

    total_m2: float
    """Of the targets that the plan counts as seen, over their whole height."""
    seen_m2: float
    """The part of it that rays from the stops reach."""
    length_m2: float = 0.0
    """Of all such targets, seen or not."""

    @property
    def share(self) -> float:
        return self.seen_m2 / self.total_m2 if self.total_m2 else 1.0


@dataclass(frozen=True)
class SeenSurface:
    """Area seen from a height, by kind of element, and the length that no ray reaches at any height."""

    height_m: float
    kinds: Mapping[str, SeenArea]
    hidden_m: float = 0.0
    """Length that level rays reach and no ray at the targets' own heights: it counts as not visible."""
    source: str = "the model's solids"

    def as_json(self) -> dict[str, Any]:
        """Return the object of reports and of coverage.json."""
        kinds = {
            kind: {"total_m2": round(area.total_m2, 3), "seen_m2": round(area.seen_m2, 3)}
            for kind, area in self.kinds.items()
        }
        return {"height_m": self.height_m, "kinds": kinds, "hidden_m": round(self.hidden_m, 3)}

    def lines(self) -> list[str]:
        """Return the lines for a person."""
        told = ", ".join(
            f"{percent(area.share)} of {area.total_m2:.0f} m² of {kind}"
            for kind, area in self.kinds.items()
            if area.total_m2 >= 0.5
        )
        if not told:
            return []
        found = [f"  surface     from {self.height_m:g} m, by {self.source}: {told}"]
        if self.hidden_m >= 0.05:
            found.append(
                f"              {self.hidden_m:.1f} m of targets are hidden at every height and not counted"
            )
        return found
