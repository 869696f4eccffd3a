"""Visibility of whole candidate × unit matrices: `python -m benchmarks.visibility`.

Exact visibility interpreted and compiled, next to prepared shapely geometry asked pair by pair; then a
large floor, with the memory that its result takes.
"""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import shapely

from benchmarks.floors import office
from benchmarks.table import median_seconds, put, table, versions
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.geometry import compiling
from stopgo.planner.geometry.shapes import local_origin, to_grid, to_shape
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility.exact_sight import open_space
from stopgo.planner.visibility.sight.sight import Scene, scene_of, sight

SHARED = Path(__file__).parents[2] / "shared" / "data"
PAPER = ("case1_structural", "case2_structural", "case1_rooms", "case2_rooms")
PAIRS = 20_000
"""Pairs on which the other library is timed; its total time is extrapolated to all pairs."""


def scene_and_points(floor: FloorPlan, settings: Settings) -> tuple[Scene, np.ndarray, object]:
    """The scene of a floor, its candidates in grid steps, and the candidates."""
    found = candidates(navigable(floor, settings))
    origin, targets = local_origin(floor), found.space.targets
    scene = scene_of(
        open_space(found), targets.a - origin, targets.b - origin, targets.units, targets.occluding
    )
    return scene, to_grid(found.xy[found.kept] - origin), found


def timed(scene: Scene, points: np.ndarray, *, reach: float | None, compiled: bool) -> float:
    """Median seconds of the whole matrix at one of the two speeds."""
    usual = compiling.compiled_module
    if not compiled:
        compiling.compiled_module = lambda name: None  # type: ignore[assignment]
    try:
        return median_seconds(lambda: sight(scene, points, reach=reach))
    finally:
        compiling.compiled_module = usual


def peer_seconds(found, *, reach: float) -> float:
    """Seconds of the whole matrix by prepared geometry, from a seeded sample of pairs in reach."""
    origin, targets = local_origin(found.space.floor), found.space.targets
    occluders = to_shape(found.space.occluders, origin).buffer(-1e-6)
    shapely.prepare(occluders)
    points, units = found.xy[found.kept] - origin, targets.unit_xy - origin
    random = np.random.Generator(np.random.PCG64(1))
    pick = random.integers(0, len(points), PAIRS), random.integers(0, len(units), PAIRS)
    near = np.hypot(*(points[pick[0]] - units[pick[1]]).T) <= reach
    lines = shapely.linestrings(np.stack([points[pick[0]][near], units[pick[1]][near]], axis=1))
    spent = median_seconds(lambda: shapely.intersects(occluders, lines), runs=3)
    return spent * len(points) * len(units) / PAIRS


def paper_rows() -> list[list[object]]:
    """The paper's cases, where they are at hand."""
    rows: list[list[object]] = []
    for name in PAPER:
        path = SHARED / "paper" / f"synthetic_{name}.dxf"
        if not path.exists():
            continue
        rooms = name.endswith("rooms")
        settings = Settings(edge=0.35 if rooms else 0.0, doors="closed" if rooms else "open")
        scene, points, found = scene_and_points(
            read_floor(path, FloorOptions(d_dis=settings.d_dis)), settings
        )
        slow = timed(scene, points, reach=5.0, compiled=False)
        fast = timed(scene, points, reach=5.0, compiled=True)
        far = timed(scene, points, reach=None, compiled=True)
        peer = peer_seconds(found, reach=5.0)
        counts = [len(points), found.space.targets.total]
        rows.append([name, *counts, 1e3 * slow, 1e3 * fast, 1e3 * far, 1e3 * peer, peer / fast])
    return rows


def large_rows() -> list[list[object]]:
    """A floor of 200 × 200 m: 250 candidates, then 10 000."""
    scene, points, found = scene_and_points(office(200.0, 200.0, seed=1), Settings(d_dis=0.07))
    rows = []
    for count in (250, 10_000):
        some = points[np.linspace(0, len(points) - 1, count).astype(int)]
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        spent = timed(scene, some, reach=5.0, compiled=True)
        runs = sight(scene, some, reach=5.0)
        held = sum(part.nbytes for part in (runs.pointer, runs.segment, runs.low, runs.high)) / 1e6
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3
        units = found.space.targets.total
        rows.append([count, len(scene.units), units, 1e3 * spent, held, grown, count * units / 1e6])
    return rows


def main() -> None:
    """Measure, print, and put the tables into the README."""
    text = "\n\n".join(
        [
            "Whole matrix of candidates × units, medians of five runs on one thread, in ms. `shapely` asks "
            "prepared geometry for each pair in range, from a sample of 20 000 pairs. "
            + versions("numpy", "cython", "shapely"),
            table(
                [
                    "case",
                    "candidates",
                    "units",
                    "interpreted r 5",
                    "compiled r 5",
                    "compiled no range",
                    "shapely r 5",
                    "shapely / compiled",
                ],
                paper_rows(),
            ),
            "A synthetic floor of 200 × 200 m (r 5): what is kept grows with what is seen, not with the pairs.",
            table(
                ["candidates", "segments", "units", "ms", "result MB", "peak grown MB", "million pairs"],
                large_rows(),
            ),
        ]
    )
    print(text)
    put("visibility", text)


if __name__ == "__main__":
    main()
