"""Times of reading a storey of a real model, first and again, and of IfcOpenShell's geometry iterator."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.table import put, table, versions

MODELS = Path(__file__).parents[2] / "shared" / "data" / "ifc"
STOREYS = {
    "fzk-haus.ifc": "Erdgeschoss",
    "duplex.ifc": "Level 1",
    "office.ifc": "Level 1",
    "school.ifc": "u4pyxnN8d1",
    "schependomlaan-structure.ifc": "1e Verdiepingvloer",
}
READING = """
import json, resource, sys, time
from pathlib import Path
from stopgo.planner.floors import FloorOptions, read_floor
begin = time.perf_counter()
floor = read_floor(Path(sys.argv[1]), FloorOptions(storey=sys.argv[2]))
seconds = time.perf_counter() - begin
peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
both = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
worked = sum(item.ru_utime + item.ru_stime for item in both)
print(json.dumps([seconds, worked, peak / 1024, len(floor.rooms), len(floor.elements), len(floor.openings)]))
"""
ITERATING = """
import json, resource, sys, time
import ifcopenshell, ifcopenshell.geom
begin = time.perf_counter()
model = ifcopenshell.open(sys.argv[1])
(storey,) = [item for item in model.by_type("IfcBuildingStorey") if item.Name == sys.argv[2]]
inside = [item for relation in storey.ContainsElements for item in relation.RelatedElements]
inside += [item for relation in storey.IsDecomposedBy for item in relation.RelatedObjects]
settings = ifcopenshell.geom.settings()
settings.set("use-world-coords", True)
shapes = ifcopenshell.geom.iterator(settings, model, 1, include=inside)
count = 0
more = shapes.initialize()
while more:
    shapes.get()
    count += 1
    more = shapes.next()
seconds = time.perf_counter() - begin
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([seconds, peak / 1024, count]))
"""


def main() -> None:
    """Measure every model at hand and put the table into the README."""
    rows = [_row(name, storey) for name, storey in STOREYS.items() if (MODELS / name).exists()]
    head = ["model", "MB", "first s", "of them CPU", "peak MB", "again s", "rooms", "elements", "openings"]
    text = "\n\n".join(
        (
            versions("ifcopenshell", "shapely", "numpy"),
            table([*head, "iterator s", "its shapes"], rows),
            "First: read in a process of its own, all storeys at once, and kept; again: from what was kept. "
            "The iterator is IfcOpenShell's with its default kernel, over what the same storey contains: "
            "triangles only, no floor, rooms or doors.",
        )
    )
    put("models", text)
    print(text)


def _row(name: str, storey: str) -> list[object]:
    path = MODELS / name
    with tempfile.TemporaryDirectory() as cache:
        first, again = (_measured(READING, path, storey, cache) for _ in range(2))
        iterator = _measured(ITERATING, path, storey, cache)
    size = f"{path.stat().st_size / 1e6:.1f}"
    read = [first[0], first[1], round(first[2]), again[0], *(int(value) for value in first[3:])]
    return [f"{name}, {storey}", size, *read, iterator[0], int(iterator[2])]


def _measured(code: str, path: Path, storey: str, cache: str) -> list[float]:
    home = {**os.environ, "XDG_CACHE_HOME": cache}
    done = subprocess.run(
        [sys.executable, "-c", code, str(path), storey], capture_output=True, check=True, env=home
    )
    told: list[float] = json.loads(done.stdout)
    return told


if __name__ == "__main__":
    main()
