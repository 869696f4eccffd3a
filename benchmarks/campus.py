"""Measures batches: overhead over the plans alone, two workers against one, and the next batch after one change.

Run: python -m benchmarks.campus [--buildings 6] [--storeys 5] [--dates 1]; `--buildings 40 --dates 3` is a campus.
The storeys are sample offices of many sizes. Every floor is another one, so that nothing is found twice.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import ezdxf
import msgspec
from ezdxf.math import Matrix44

from benchmarks.table import put, table, versions
from stopgo.batches.record import BatchRecord
from stopgo.command_line import main as stopgo

SAMPLE = Path(__file__).parents[1] / "recordings" / "samples" / "office.dxf"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--buildings", type=int, default=6)
    options.add_argument("--storeys", type=int, default=5)
    options.add_argument("--dates", type=int, default=1)
    given = options.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        site = Path(folder)
        count = given.buildings * given.storeys
        draw(site / "floors", count)
        variants = [round(5.0 + 0.01 * k, 2) for k in range(given.dates)]
        (site / "plans.toml").write_text(
            f'[[floors]]\nfiles = "floors/*.dxf"\nmatrix = {{ range = {variants} }}\n'
        )
        rows = [alone(site), *(batch(site, name, workers) for name, workers in (("one", 1), ("two", 2)))]
        rows.append(batch(site, "two", 2, label="again, nothing changed"))
        draw(site / "floors", 1, seed=1)
        rows.append(batch(site, "two", 2, label="again, one floor changed"))
    head = ["run", "plans", "planned", "wall s", "CPU s", "largest process MB", "store MB"]
    text = f"{versions('numpy', 'shapely', 'highspy')}\n\n{table(head, rows)}"
    print(text)
    put("campus", text)


def draw(folder: Path, count: int, *, seed: int = 0) -> None:
    """Draw sample offices, each enlarged by a little more."""
    folder.mkdir(exist_ok=True)
    for number in range(count):
        drawing = ezdxf.readfile(SAMPLE)
        factor = 1.0 + 0.002 * (number + 1 + 100 * seed) / 2
        for entity in drawing.modelspace():
            entity.transform(Matrix44.scale(factor))
        drawing.saveas(folder / f"storey-{number:03}.dxf")


def alone(site: Path) -> Sequence[object]:
    """The plan of each floor by a command of its own, in a process of its own."""
    floors = sorted((site / "floors").glob("*.dxf"))
    begin, cpu = time.perf_counter(), children()
    for floor in floors:
        child = os.fork()
        if child == 0:
            os._exit(stopgo(["plan", str(floor), "-o", str(site / "alone" / floor.stem)]))
        os.waitpid(child, 0)
    return ["plans alone, one after another", len(floors), len(floors), *spent(begin, cpu), "-"]


def batch(site: Path, name: str, workers: int, *, label: str = "") -> Sequence[object]:
    """A batch in a process of its own."""
    out = site / name
    begin, cpu = time.perf_counter(), children()
    child = os.fork()
    if child == 0:
        arguments = ["batch", str(site / "plans.toml"), "-o", str(out), "--workers", str(workers), "--json"]
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        os._exit(stopgo(arguments))
    os.waitpid(child, 0)
    took = spent(begin, cpu)
    record = msgspec.json.decode((out / "batch.json").read_bytes(), type=BatchRecord)
    counts = record.counts()
    size = sum(path.stat().st_size for path in (out / ".store").rglob("*") if path.is_file())
    shutil.rmtree(site / "alone", ignore_errors=True)
    return [label or f"batch, {workers} workers", len(record.entries), counts["planned"], *took, size / 1e6]


def children() -> float:
    """CPU seconds of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def spent(begin: float, cpu: float) -> list[float]:
    """Wall and CPU seconds, and the largest process so far."""
    largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    return [time.perf_counter() - begin, children() - cpu, largest]


if __name__ == "__main__":
    main()
