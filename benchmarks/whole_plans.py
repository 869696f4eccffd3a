"""Plans as whole processes, from a sample to an airport: `python -m benchmarks.whole_plans [FORMER_TREE]`.

Every plan is made by the real command, with all its files. A former tree is a checkout with its kernels built
(`python setup.py build_ext --inplace`); it plans the same floors in turn, in the present environment.
"""

from __future__ import annotations

import filecmp
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from math import log
from pathlib import Path
from statistics import median

from benchmarks.floors import copies, hall
from benchmarks.table import put, table, versions
from stopgo.mission.files.layered_dxf import layered_dxf
from stopgo.planner.floors import FloorOptions, read_floor

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "data"
FLOORS = {
    "office (sample)": ROOT / "recordings/samples/office.dxf",
    "case1_structural": DATA / "paper/synthetic_case1_structural.dxf",
    "case2_rooms": DATA / "paper/synthetic_case2_rooms.dxf",
    "house": DATA / "dxf/house.dxf",
    "office-l1": DATA / "layered/office-l1.dxf",
}
COPIES = (4, 16, 56)
"""Numbers of copies of office-l1 that are one floor."""
OFFICE_RANGE = 20
"""A second range in office-l1, m."""
HALL_RANGES = (5, 20)
"""Ranges in the hall, m."""
START = ("--start", "26.393253,-31.5609,50")
"""Where robots start in office-l1, also in the first of its copies."""
OPTIONS = (
    *(("--overlap", "0.1"), ("--min-views", "2"), ("--minimise", "time")),
    *(("--robots", "3"), ("--robots", "3", "--minimise", "time"), ("--shift", "30min")),
)
LARGEST_CHECKED = 50_000
"""Area in m² of the largest floor whose mission is checked: the time of all benchmarks is limited."""
WITH_OPTIONS = ("office-l1", "office-l1, 4 times")
STAGES = ("read", "navigable", "candidates", "visibility", "selection", "route", "figures", "files")


@dataclass(frozen=True)
class Plan:
    """A floor, and options of the command."""

    name: str
    floor: Path
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class Run:
    """One plan by the real command; CPU and memory are of the process and those that it waited for."""

    wall_s: float
    cpu_s: float
    megabytes: float
    answer: dict[str, object]

    @property
    def stages(self) -> list[float]:
        """Wall seconds of each stage."""
        times = self.answer["times_s"]
        assert isinstance(times, dict)
        return [float(times[name]) for name in STAGES]

    @property
    def stops(self) -> str:
        """Stops, and the fewest that are possible."""
        selection = self.answer["selection"]
        assert isinstance(selection, dict)
        return f"{selection['stops']} / {selection['bound']}"

    @property
    def area(self) -> int:
        """Area of the floor in m²."""
        floor = self.answer["floor"]
        assert isinstance(floor, dict)
        return round(floor["area_m2"])


MEASURED = """
import json, os, sys
process = os.posix_spawn(sys.executable, [sys.executable, *sys.argv[2:]], os.environ)
_, status, used = os.wait4(process, 0)
figures = os.waitstatus_to_exitcode(status), used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3
open(sys.argv[1], "w").write(json.dumps(figures))
"""
"""A small process that starts the command: the memory of the one that starts it counts as the command's."""


def planned(tree: Path, plan: Plan, out: Path, **environment: str) -> Run:
    """Plan by the version in a tree."""
    wall, cpu, megabytes, answer = measured(
        tree, "plan", str(plan.floor), "-o", str(out), "--json", *plan.options, **environment
    )
    return Run(wall, cpu, megabytes, json.loads(answer))


def checked(plan: Plan, out: Path) -> float:
    """CPU seconds of a check of the mission that was planned into a folder."""
    return measured(ROOT, "check", str(out / "mission.json"), "--floor", str(plan.floor))[1]


def measured(tree: Path, *command: str, **environment: str) -> tuple[float, float, float, bytes]:
    """Wall and CPU seconds, megabytes and output of a command by the version in a tree."""
    with tempfile.NamedTemporaryFile() as figures:
        begin = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-S", "-c", MEASURED, figures.name, "-m", "stopgo", *command],
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree), **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=True,
        )
        wall = time.monotonic() - begin
        code, cpu, megabytes = json.load(figures)
    if code:
        raise SystemExit(f"{' '.join(command)}: {tree} ended with {code}")
    return wall, cpu, megabytes, done.stdout


def same(former: Path, present: Path) -> str:
    """`same` if both folders hold the same missions, else the names that differ."""
    names = sorted({path.name for folder in (former, present) for path in folder.glob("mission*.json")})
    _, differ, missing = filecmp.cmpfiles(former, present, names, shallow=False)
    return ", ".join([*differ, *missing]) or ("same" if names else "none")


def plans(folder: Path, counts: tuple[int, ...] = COPIES) -> Iterator[Plan]:
    """Floors at hand, then so many copies of one, and a hall, that are drawn into a folder."""
    at_hand = {name: path for name, path in FLOORS.items() if path.exists()}
    yield from (Plan(name, path) for name, path in at_hand.items())
    if "office-l1" in at_hand:
        wide = ("--range", f"{OFFICE_RANGE}")
        yield Plan(f"office-l1, range {OFFICE_RANGE} m", at_hand["office-l1"], wide)
        floor = read_floor(at_hand["office-l1"], FloorOptions())
        for count in counts:
            path = folder / f"copies-{count}.dxf"
            path.write_bytes(layered_dxf(copies(floor, count)))
            yield Plan(f"office-l1, {count} times", path)
    path = folder / "hall.dxf"
    path.write_bytes(layered_dxf(hall()))
    yield from (
        Plan(f"hall of 289 columns, range {metres} m", path, ("--range", f"{metres}"))
        for metres in HALL_RANGES
    )


def head_and_rows(
    runs: list[tuple[Plan, Run]], checks: list[float | str]
) -> tuple[list[str], list[list[object]]]:
    """The table of whole plans, with the CPU seconds of the check of each."""
    head = ["plan", "m²", "stops / bound", "CPU s", "wall s", "MB", "`check --floor` CPU s"]
    return head, [
        [plan.name, run.area, run.stops, run.cpu_s, run.wall_s, round(run.megabytes), check]
        for (plan, run), check in zip(runs, checks, strict=True)
    ]


def stages_table(runs: list[tuple[Plan, Run]]) -> str:
    """Wall seconds of each stage."""
    return table(["plan", *STAGES], [[plan.name, *run.stages] for plan, run in runs])


def exponents(runs: list[tuple[Plan, Run]]) -> str:
    """Exponents of the area in each stage's time, between the fewest and the most copies, in one line."""
    of_copies = [run for plan, run in runs if plan.name.endswith("times")]
    if not of_copies:
        return ""
    small, large = of_copies[0], of_copies[-1]
    spent = zip((*STAGES, "CPU"), (*small.stages, small.cpu_s), (*large.stages, large.cpu_s), strict=True)
    each = [f"{name} {log(b / a) / log(large.area / small.area):.2f}" for name, a, b in spent]
    return f"Exponents of the area from {small.area} to {large.area} m²: {', '.join(each)}."


def options_table(runs: list[tuple[Plan, Run]], folder: Path) -> str:
    """What options cost: CPU of the plan with each, over that of the plain plans right before and after it."""
    rows = []
    for plain, first in runs:
        if plain.name in WITH_OPTIONS:
            before, ratios, alone = planned(ROOT, plain, folder), list[float](), [first.cpu_s]
            for option in OPTIONS:
                with_it = planned(ROOT, Plan(plain.name, plain.floor, (*START, *option)), folder)
                after = planned(ROOT, plain, folder)
                ratios.append(2.0 * with_it.cpu_s / (before.cpu_s + after.cpu_s))
                before = after
                alone.append(after.cpu_s)
            rows.append([plain.name, median(alone), *ratios])
    return table(["plan", "plain CPU s", *(f"`{' '.join(option)}`" for option in OPTIONS)], rows)


def former_table(former: Path, made: list[Plan], folder: Path) -> str:
    """Plans of a former version and of this one in turn, with the CPU seconds of both."""
    rows = []
    for plan in made:
        folders = (folder / "former", folder / "present")
        before, now = (planned(tree, plan, out) for tree, out in zip((former, ROOT), folders, strict=True))
        megabytes = [round(run.megabytes) for run in (before, now)]
        rows.append([plan.name, same(*folders), before.stops, now.stops, before.cpu_s, now.cpu_s])
        rows[-1] += [now.cpu_s / before.cpu_s, *megabytes]
        print(*rows[-1], flush=True)
    head = ["plan", "mission.json", "former stops / bound", "stops / bound", "former CPU s", "CPU s", "ratio"]
    return table([*head, "former MB", "MB"], rows)


def main() -> None:
    """Plan everything, print, and write the tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if len(sys.argv) > 1:
            few = list(plans(folder, COPIES[:1]))
            put("former", former_table(Path(sys.argv[1]).resolve(), few, folder))
            return
        made = list(plans(folder))
        runs, checks = [], list[float | str]()
        for plan in made:
            runs.append((plan, planned(ROOT, plan, folder / "out")))
            checks.append("" if runs[-1][1].area > LARGEST_CHECKED else checked(plan, folder / "out"))
            print(plan.name, runs[-1][1].cpu_s, checks[-1], flush=True)
        bytecode = str(folder / "bytecode")
        first = planned(ROOT, made[0], folder / "out", PYTHONPYCACHEPREFIX=bytecode)
        options = options_table(runs, folder / "out")
    text = "\n\n".join(
        (
            versions("numpy", "scipy", "shapely", "highspy", "rerun-sdk"),
            table(*head_and_rows(runs, checks)),
            f"The first plan after an installation, while Python compiles all modules that it loads: {first.cpu_s:.1f} s of CPU.",
            stages_table(runs),
            exponents(runs),
            options,
        )
    )
    print(text)
    put("whole-plans", text)


if __name__ == "__main__":
    main()
