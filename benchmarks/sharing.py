"""Task allocation: the longest mission of fleets, the number of tours, and their bounds."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.table import put, table, versions
from stopgo.mission.console.table import duration
from stopgo.mission.document.schedule import schedule
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.floors import FloorOptions, read_floor

ROOT = Path(__file__).parents[1]
FLOORS = {
    "office (sample)": (ROOT / "recordings/samples/office.dxf", (10.0, 8.5, 0.0)),
    "office-l1": (ROOT.parent / "shared/data/layered/office-l1.dxf", (26.33345, -31.6849, 0.0)),
}
"""Floors, and where all robots start."""
ASKED: dict[str, dict[str, Any]] = {
    "2 robots": {"robots": 2},
    "3 robots": {"robots": 3},
    "tours of 10 min": {"shift": 600.0},
    "tours of 30 min": {"shift": 1800.0},
}


def main() -> None:
    """Measure every floor at hand and put the table into the README."""
    rows = [
        row for name, (path, start) in FLOORS.items() if path.exists() for row in rows_of(name, path, start)
    ]
    text = "\n\n".join(
        (
            versions("pyvrp", "numpy", "scipy"),
            table(["floor", "shared out", "missions", "longest", "bound", "gap", "together", "s"], rows),
            "Times are min:s of the planned schedule, from one start and back; the bound is of the longest mission "
            "for robots, of the number of tours else. Seconds: the whole plan without files.",
        )
    )
    put("sharing", text)
    print(text)


def rows_of(name: str, path: Path, start: tuple[float, float, float]) -> Iterator[list[str]]:
    """One robot alone, then every allocation."""
    floor = read_floor(path, FloorOptions())
    alone = schedule(plan(floor, Settings(start=start)).mission).total_s
    yield [name, "1 robot", "1", duration(alone), "", "", duration(alone), ""]
    for what, more in ASKED.items():
        yield ["", what, *figures_of(floor, Settings(start=start, **more))]


def figures_of(floor: FloorPlan, settings: Settings) -> list[str]:
    """Missions, the longest, its bound, the gap, the total time, and the planning time."""
    begin = time.process_time()
    divided = plan(floor, settings).divided
    seconds = time.process_time() - begin
    assert divided is not None
    count = len(divided.shares)
    reached = divided.longest_s if divided.kind == "robot" else count
    bound = duration(divided.bound) if divided.kind == "robot" else f"{divided.bound:.0f} tours"
    times = [duration(seconds) for seconds in (divided.longest_s, divided.total_s)]
    return [str(count), times[0], bound, f"{reached / divided.bound - 1:.0%}", times[1], f"{seconds:.1f}"]


if __name__ == "__main__":
    main()
