"""Cost of plans whose scans all register: stops, bound, components and time of every floor."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.document import stop_names
from stopgo.mission.settings import Settings
from stopgo.mission.stages.network import Network
from stopgo.planner import plan
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.overlap.registered import registered_pairs

REGISTER = "default"
OVERLAP = 0.3
PLAIN, DOOR_SCAN = "--no-register", "--no-register --door-scan"


def main() -> None:
    """Measure every floor at hand and put the table into the README."""
    rows = [
        row
        for name, (path, options) in FLOORS.items()
        if path.exists()
        for row in rows_of(name, path, options)
    ]
    text = "\n\n".join(
        (
            versions("numpy", "scipy", "shapely", "highspy"),
            table(
                ["floor", "asked for", "stops / bound", "stops", "pieces", "scan min", "bridges", "s"], rows
            ),
            "Pieces: the scans that hang together, by the pairs that register. Seconds: the whole plan without files.",
        )
    )
    put("overlap", text)
    print(text)


def rows_of(name: str, path: Path, options: dict[str, float]) -> Iterator[list[str]]:
    """The plain plan, one with a scan in every doorway, and those that register."""
    plain = 0
    asked = {
        PLAIN: {"register": False},
        DOOR_SCAN: {"register": False, "door_scan": True},
        REGISTER: {},
        f"--overlap {OVERLAP:g}": {"overlap": OVERLAP},
    }
    for what, more in asked.items():
        settings = Settings(**options, **more)
        floor = read_floor(path, FloorOptions(d_dis=settings.d_dis))
        begin = time.process_time()
        made = plan(floor, settings).first
        seconds = time.process_time() - begin
        count = len(made.mission.stops)
        plain = plain or count
        network = Network(tuple(stop_names(count)), registered_pairs(made.route))
        minutes = sum(stop.scan.duration_s for stop in made.mission.stops) / 60
        yield [
            name if what == PLAIN else "",
            what,
            f"{count} / {made.selection.bound}",
            f"{count / plain - 1:+.0%}" if what != PLAIN else "",
            str(len(network.pieces)),
            f"{minutes:.0f}",
            str(len(network.bridges)),
            f"{seconds:.1f}",
        ]


if __name__ == "__main__":
    main()
