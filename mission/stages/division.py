"""Division of a route's stops among robots or tours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stopgo.mission.stages import Route


@dataclass(frozen=True, eq=False)
class DividedRoute:
    """Routes that together visit every stop of a route once."""

    kind: Literal["robot", "tour"]
    """`robot`: robots drive at the same time. `tour`: one robot drives the tours one after another."""
    routes: tuple[Route, ...]
    limit_s: float | None
    """Seconds that no tour exceeds; None for robots."""
    bound: float
    """Lower bound: for robots, of the longest tour's seconds; for tours, of their number."""
    method: str
