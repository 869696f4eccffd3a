"""Cost of plans whose scans all register: stops, bound, components and time of every floor."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from benchmarks.shares import FLOORS
from benchmarks.table import put, table, versions
from stopgo.mission.document import Overlap, stop_names
from stopgo.mission.plan import PartPlan
from stopgo.mission.settings import Settings
from stopgo.mission.stages.network import Network
from stopgo.planner import plan
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.overlap.registered import registered_pairs

SHARES = (0.1, 0.3)
DOOR_SCAN = "--door-scan"


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
            "Pieces: the scans that hang together, by the pairs that register at a share of 0.1. Seconds: the whole "
            "plan without files.",
        )
    )
    put("overlap", text)
    print(text)


def rows_of(name: str, path: Path, options: dict[str, float]) -> Iterator[list[str]]:
    """The plain plan, one with a scan in every doorway, and those that register."""
    plain = 0
    asked = {
        "plain": {"overlap": 0.0},
        DOOR_SCAN: {"overlap": 0.0, "door_scan": True},
        **{f"--overlap {share:g}": {"overlap": share} for share in SHARES},
    }
    for what, more in asked.items():
        settings = Settings(**options, **more)
        floor = read_floor(path, FloorOptions(d_dis=settings.d_dis))
        begin = time.process_time()
        made = plan(floor, settings).first
        seconds = time.process_time() - begin
        count = len(made.mission.stops)
        plain = plain or count
        network = Network(tuple(stop_names(count)), pairs_at(made, 0.1))
        minutes = sum(stop.scan.duration_s for stop in made.mission.stops) / 60
        yield [
            name if what == "plain" else "",
            what,
            f"{count} / {made.selection.bound}",
            f"{count / plain - 1:+.0%}" if what != "plain" else "",
            str(len(network.pieces)),
            f"{minutes:.0f}",
            str(len(network.bridges)),
            f"{seconds:.1f}",
        ]


def pairs_at(made: PartPlan, share: float) -> tuple[Overlap, ...]:
    """Pairs of a plan's stops that register, for any required overlap."""
    route = made.route
    space = made.space
    told = replace(space, settings=replace(space.settings, overlap=share))
    seen = replace(made.visibility, candidates=replace(made.candidates, space=told))
    return registered_pairs(replace(route, selection=replace(made.selection, visibility=seen)))


if __name__ == "__main__":
    main()
