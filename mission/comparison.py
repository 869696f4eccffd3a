"""Plan against run: what each stop was planned to be, and what it was."""

from __future__ import annotations

from dataclasses import dataclass

from mission.document import Mission


@dataclass(frozen=True)
class StopComparison:
    """One stop; what did not happen is None."""

    stop: str
    planned_s: float | None
    """Planned arrival, from the start of the mission; None if no plan has this stop."""
    driven_s: float | None
    """Last arrival in the run, from the start of the run."""
    deviation_m: float | None
    """Distance of the robot from the stop when it scanned there, else when it last arrived."""
    outcome: str
    """`scanned`, `skipped`, `failed` or `not reached`; `withdrawn` if a revision dropped it unreached."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """A run beside its mission."""

    mission: Mission
    run_id: str | None
    stops: tuple[StopComparison, ...]
    planned_s: float
    driven_s: float | None
    """Duration of the run; None if it has not ended."""

    @property
    def scanned(self) -> int:
        """Number of stops that were scanned."""
        return sum(item.outcome == "scanned" for item in self.stops)

    @property
    def greatest_deviation_m(self) -> float | None:
        """Of all stops where the robot was; None if it was at none."""
        return max((item.deviation_m for item in self.stops if item.deviation_m is not None), default=None)
