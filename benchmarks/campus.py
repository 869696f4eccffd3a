"""Measures batches: overhead over the plans alone, two workers against one, and the next batch after one change.

Run: python -m benchmarks.campus [--buildings 6] [--storeys 5] [--dates 1]; `--buildings 40 --dates 3` is a campus.
The storeys are sample offices of many sizes. Every floor is another one, so that nothing is found twice.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import resource
import shutil
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import ezdxf
import msgspec
from ezdxf.math import Matrix44

from benchmarks.table import put, table, versions
from stopgo.batches.record import BatchRecord
from stopgo.command_line import main as stopgo

CHILD_SUBREAPER = 36
"""prctl's option by which processes whose parent has ended become children of this one; Linux."""
SAMPLE = Path(__file__).parents[1] / "recordings" / "samples" / "office.dxf"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--buildings", type=int, default=6)
    options.add_argument("--storeys", type=int, default=5)
    options.add_argument("--dates", type=int, default=1)
    given = options.parse_args()
    ctypes.CDLL(None).prctl(CHILD_SUBREAPER, 1)
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
    head = ["run", "plans", "planned", "wall s", "CPU s", "memory MB", "store MB"]
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
    begin, cpu, memory = time.perf_counter(), children(), Memory()
    for floor in floors:
        child = os.fork()
        if child == 0:
            os._exit(stopgo(["plan", str(floor), "-o", str(site / "alone" / floor.stem)]))
        os.waitpid(child, 0)
    took = [*spent(begin, cpu), memory.end()]
    return ["plans alone, one after another", len(floors), len(floors), *took, "-"]


def batch(site: Path, name: str, workers: int, *, label: str = "") -> Sequence[object]:
    """A batch in a process of its own."""
    out = site / name
    begin, cpu, memory = time.perf_counter(), children(), Memory()
    child = os.fork()
    if child == 0:
        arguments = ["batch", str(site / "plans.toml"), "-o", str(out), "--workers", str(workers), "--json"]
        with open(os.devnull, "w") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        os._exit(stopgo(arguments))
    os.waitpid(child, 0)
    took = [*spent(begin, cpu), memory.end()]
    record = msgspec.json.decode((out / "batch.json").read_bytes(), type=BatchRecord)
    counts = record.counts()
    size = sum(path.stat().st_size for path in (out / ".store").rglob("*") if path.is_file())
    shutil.rmtree(site / "alone", ignore_errors=True)
    return [label or f"batch, {workers} workers", len(record.entries), counts["planned"], *took, size / 1e6]


def children() -> float:
    """CPU seconds of all processes that were started from here; waits for their ends."""
    with contextlib.suppress(ChildProcessError):
        while True:
            os.wait()
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def spent(begin: float, cpu: float) -> list[float]:
    """Wall and CPU seconds since then."""
    return [time.perf_counter() - begin, children() - cpu]


class Memory:
    """Most memory that all processes started from here have together (PSS, megabytes), looked at twice a second, as a look takes 10 ms of a core."""

    def __init__(self) -> None:
        self._most = 0.0
        self._ended = threading.Event()
        self._looking = threading.Thread(target=self._look)
        self._looking.start()

    def end(self) -> float:
        self._ended.set()
        self._looking.join()
        return self._most

    def _look(self) -> None:
        while not self._ended.wait(0.5):
            self._most = max(self._most, sum(memory_of(child) for child in below(os.getpid())) / 1024)


def below(process: int) -> Iterator[int]:
    """All processes that this one, or one that it started, has started."""
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            for child in map(int, task.read_text().split()):
                yield child
                yield from below(child)


def memory_of(process: int) -> int:
    """Memory of a process in kB, with its part of what it shares; 0 if it has ended."""
    with contextlib.suppress(OSError, StopIteration):
        lines = Path(f"/proc/{process}/smaps_rollup").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("Pss:"))
    return 0


if __name__ == "__main__":
    main()
