"""List of a mission's stops: one row per stop, as text, tables, sheets and JSON show it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from stopgo.mission.console.table import duration
from stopgo.mission.document import Mission, Stop
from stopgo.mission.document.schedule import Schedule, schedule
from stopgo.mission.geometry import frozen, polyline_length

COLUMNS = ("no", "stop", "x m", "y m", "heading °", "doorway", "approach m", "units", "new", "arrives")


@dataclass(frozen=True)
class ListedStop:
    """A stop with its number in the order of driving, and its time of arrival."""

    number: int
    """From 1."""
    stop: Stop
    arrival_s: float

    @property
    def approach_m(self) -> float:
        """Length of the leg that leads to it."""
        return polyline_length(frozen(self.stop.approach).reshape(-1, 2))

    @cached_property
    def cells(self) -> Mapping[str, str]:
        """The row of a table: text by the column's heading."""
        stop = self.stop
        cells = (
            *(str(self.number), stop.id, f"{stop.x:.3f}", f"{stop.y:.3f}"),
            *(f"{math.degrees(stop.heading):.1f}", "yes" if stop.doorway else "", f"{self.approach_m:.2f}"),
            *(str(stop.sees.units), str(stop.sees.new_units), duration(self.arrival_s)),
        )
        return dict(zip(COLUMNS, cells, strict=True))

    def as_json(self) -> dict[str, Any]:
        """Return the row for a program."""
        stop = self.stop
        return {
            **{"number": self.number, "id": stop.id, "x": stop.x, "y": stop.y},
            **{"heading_deg": math.degrees(stop.heading), "doorway": stop.doorway},
            **{"approach_m": self.approach_m, "units": stop.sees.units},
            **{"new_units": stop.sees.new_units, "arrival_s": self.arrival_s},
        }


def stop_list(mission: Mission, times: Schedule | None = None) -> list[ListedStop]:
    """Return the stops in the order of driving."""
    arrivals = (times or schedule(mission)).arrival_s
    return [
        ListedStop(number, stop, arrival)
        for number, (stop, arrival) in enumerate(zip(mission.stops, arrivals, strict=True), 1)
    ]
