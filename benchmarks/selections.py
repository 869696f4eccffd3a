"""Selections next to branch and bound by HiGHS, on the same covering problems: `python -m benchmarks.selections`."""

from __future__ import annotations

import time
from pathlib import Path

from benchmarks.table import put, table, versions
from stopgo.mission.settings import Settings
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.selection import cover_problem, select
from stopgo.planner.selection.exact_cover import exact
from stopgo.planner.selection.greedy import greedy
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility import visibility

ROOT = Path(__file__).parents[1]
OFFICE = ROOT.parent / "shared/data/layered/office-l1.dxf"
FLOORS = (
    *((ROOT / "recordings/samples/office.dxf", 5.0), (ROOT.parent / "shared/data/dxf/house.dxf", 5.0)),
    *((OFFICE, 5.0), (OFFICE, 10.0), (OFFICE, 20.0)),
)
"""Floors, and ranges of the scanner in m."""
PATIENCE_S = 30.0
"""Time that HiGHS has for each."""


def main() -> None:
    """Select on every floor at hand, and put the table into the README."""
    rows = [row_of(floor, metres) for floor, metres in FLOORS if floor.exists()]
    head = ["floor", "range m", "entries", "stops / bound", "CPU s", "HiGHS: stops / bound", "CPU s"]
    text = "\n\n".join(
        (
            f"The scans need not register here, and HiGHS ends after {PATIENCE_S:.0f} s. It begins with the greedy selection. "
            + versions("highspy", "numpy", "scipy"),
            table(head, rows),
        )
    )
    print(text)
    put("selections", text)


def row_of(path: Path, metres: float) -> list[object]:
    """The selection of a floor, and that of HiGHS."""
    settings = Settings(range=metres, register=False, time_limit=PATIENCE_S)
    seen = visibility(candidates(navigable(read_floor(path, FloorOptions()), settings)))
    begin = time.process_time()
    ours = select(seen)
    middle = time.process_time()
    _, fixed, problem = cover_problem(seen)
    rows, bound = exact(problem, greedy(problem), settings=settings)
    end = time.process_time()
    counts = (f"{len(ours.chosen)} / {ours.bound}", f"{len(fixed) + len(rows)} / {len(fixed) + bound}")
    return [path.stem, metres, problem.sees.nnz, counts[0], middle - begin, counts[1], end - middle]


if __name__ == "__main__":
    main()
