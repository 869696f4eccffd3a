"""Fewest stops over all positions compared with fewest over the candidates, floor by floor."""

from __future__ import annotations

import time
from pathlib import Path

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.settings import Settings
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import read_floor
from stopgo.planner.selection.continuous_selection import SELECTOR, select_anywhere
from stopgo.planner.selection.refine import select_refined
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility


def main() -> None:
    """Measure every floor at hand and put the table into the README."""
    rows = [row(name, *value) for name, value in FLOORS.items() if value[0].exists()]
    head = ["floor", "m²", "default, of these candidates", "of all places", "gap", "CPU s, from the floor"]
    told = "Stops / bound. The gap is what is left between both, as a share of the stops."
    text = "\n\n".join((versions("numpy", "scipy", "shapely", "highspy"), table(head, rows), told))
    put("all-places", text)
    print(text)


def row(name: str, path: Path, options: dict[str, float]) -> list[object]:
    """A floor's stops and bounds by both methods."""
    floor = read_floor(path)
    settings = Settings(selector=SELECTOR, register=False, **options)  # type: ignore[arg-type]
    begin = time.process_time()
    seen = visibility(candidates(navigable(floor, settings)))
    found = select_anywhere(seen)
    took = time.process_time() - begin
    plain = select_refined(seen)
    stops, bound = len(found.chosen), found.bound
    gap = f"{100 * (stops - bound) / stops:.1f} %"
    return [name, round(floor.area), f"{len(plain.chosen)} / {plain.bound}", f"{stops} / {bound}", gap, took]


if __name__ == "__main__":
    main()
