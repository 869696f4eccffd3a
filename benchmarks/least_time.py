"""Time saved by choosing stops and tour together, against fewest stops first, floor by floor."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.console.table import duration
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Route
from stopgo.planner.candidates import candidates
from stopgo.planner.covering_tour import least_time_route
from stopgo.planner.floors import read_floor
from stopgo.planner.routing import route
from stopgo.planner.selection.refine import select_refined
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility

SCANS: dict[str, dict[str, Any]] = {"60 s": {}, "10 s": {"scan_time": 10.0}}
"""Slow scans, where stops cost most, and quick ones."""


def main() -> None:
    """Measure every floor at hand and put the table into the README."""
    known = {name: value for name, value in FLOORS.items() if value[0].exists()}
    rows = [row(name, scan, *value) for scan in SCANS for name, value in known.items()]
    head = ["floor", "scan", "fewest stops first", "together", "saved", "of driving and turning"]
    head += ["stops", "bound", "above it", "CPU s more"]
    told = (
        "Times are min:s of the mission's schedule. Saved: of the whole, and of what is not settling and scanning in "
        "the plan of fewest stops. CPU s more: search and bound, beside what the other plan takes."
    )
    text = "\n\n".join((versions("numpy", "scipy", "shapely", "highspy"), table(head, rows), told))
    put("least-time", text)
    print(text)


def row(name: str, scan: str, path: Path, options: dict[str, float]) -> list[object]:
    """A floor's times by both methods."""
    settings = Settings(minimise="time", **{**options, **SCANS[scan]})
    before = route(select_refined(visibility(candidates(navigable(read_floor(path), settings)))))
    begin = time.process_time()
    made = least_time_route(before)
    took = time.process_time() - begin
    return [name, scan, *figures_of(before, made, settings), f"{took:.1f}"]


def figures_of(before: Route, made: Route, settings: Settings) -> list[str]:
    """Both times, the saving, stops and the lower bound."""
    told = made.time
    assert told is not None
    moving = told.two_step_s - len(before.order) * (settings.settle + settings.scan_time)
    stops = (
        str(len(made.order))
        if len(made.order) == len(before.order)
        else f"{len(before.order)} → {len(made.order)}"
    )
    return [
        *map(duration, (told.two_step_s, told.seconds)),
        f"{told.saved_s / told.two_step_s:.1%}",
        f"{told.saved_s / moving:.0%}",
        stops,
        duration(told.bound),
        f"{told.seconds / told.bound - 1:.1%}",
    ]


if __name__ == "__main__":
    main()
