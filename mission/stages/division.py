"""A route's stops, shared out among robots or tours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stopgo.mission.stages import Route


@dataclass(frozen=True, eq=False)
class DividedRoute:
    """Routes that together visit every stop of a route once."""

    kind: Literal["robot", "tour"]
    """Of robots that drive at the same time, or of tours that one robot drives one after another."""
    routes: tuple[Route, ...]
    limit_s: float | None
    """Seconds that every tour stays within; None for robots."""
    bound: float
    """For robots, seconds that the longest tour takes at least; for tours, how many there are at least."""
    method: str
