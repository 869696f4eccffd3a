"""Results and times of reading architects' drawings: `python -m benchmarks.drawings`."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import shapely
from shapely.affinity import translate

from benchmarks.table import put, table, versions
from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import read_floor

DATA = Path(__file__).parents[2] / "shared" / "data"
RUNS = 3


def main() -> None:
    """Read every drawing and write the tables."""
    rows = [row(path) for path in sorted((DATA / "dxf").glob("*.dxf"))]
    text = [
        f"CPU time of one core, least of {RUNS} readings, file to floor. {versions('ezdxf', 'shapely')}",
        table(("drawing", "rooms", "doors", "passages", "floor m²", "s"), rows),
        against_the_truth(),
    ]
    put("drawings", "\n\n".join(text))
    print("\n\n".join(text))


def row(path: Path) -> list[object]:
    times = []
    for _ in range(RUNS):
        begin = time.process_time()
        try:
            floor = read_floor(path)
        except InputError:
            return [path.stem, "refused", "", "", "", time.process_time() - begin]
        times.append(time.process_time() - begin)
    kinds = [item.kind for item in floor.openings]
    return [
        path.stem,
        len(floor.rooms),
        kinds.count("door"),
        kinds.count("passage"),
        round(floor.area),
        min(times),
    ]


def against_the_truth() -> str:
    """Agreement of the messy office's rooms with those of its source model."""
    truth = read_floor(DATA / "layered" / "office-l1.dxf")
    found = read_floor(DATA / "dxf" / "office-l1-messy.dxf")
    off = lowest(truth) - lowest(found)
    mine = [translate(shape, *off) for shape in shapes(found)]
    best = [max(a.intersection(b).area / a.union(b).area for b in mine) for a in shapes(truth)]
    good, fair = (sum(share > least for share in best) for least in (0.85, 0.5))
    return (
        f"office-l1-messy against its model's {len(best)} rooms: {fair} share more than half of their area "
        f"(intersection over union), {good} more than 85 %; {len(mine)} rooms are found in all."
    )


def shapes(floor: FloorPlan) -> list[shapely.Geometry]:
    return [
        shapely.union_all([shapely.Polygon(part.exterior, part.holes) for part in room.polygons])
        for room in floor.rooms
    ]


def lowest(floor: FloorPlan) -> np.ndarray:
    """The lower left corner of all walls."""
    solids = [solid.exterior for item in floor.elements if item.kind == "walls" for solid in item.solids]
    return np.concatenate(solids).min(axis=0)


if __name__ == "__main__":
    main()
