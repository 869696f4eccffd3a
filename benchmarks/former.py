"""Plans of a former version next to the present ones: `python -m benchmarks.former FORMER_TREE [NAME…]`.

A former tree is made by `git archive REVISION | tar x -C FOLDER`; both run with the present environment. Each
plan is made by the real command, once by either. The table says if their missions are the same, byte for byte.
"""

from __future__ import annotations

import filecmp
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.table import table, versions

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "data"
SAMPLE = "recordings/samples/office.dxf"
FLOORS = {
    "office (sample)": SAMPLE,
    "duplex-l1": "layered/duplex-l1.dxf",
    "fzk-haus-eg": "layered/fzk-haus-eg.dxf",
    "office-l1": "layered/office-l1.dxf",
    "case1_structural": "paper/synthetic_case1_structural.dxf",
    "case1_rooms": "paper/synthetic_case1_rooms.dxf",
    "case2_structural": "paper/synthetic_case2_structural.dxf",
    "case2_rooms": "paper/synthetic_case2_rooms.dxf",
}
PLANS: dict[str, tuple[str, ...]] = {
    **{name: (name,) for name in FLOORS},
    "overlap": ("office (sample)", "--overlap", "0.1"),
    "triangulation": ("office-l1", "--candidates", "triangulation"),
    "all parts": ("duplex-l1", "--all-parts"),
    "paper's way": (
        *("case1_rooms", "--doors", "closed", "--robot-radius", "0.34"),
        *("--visibility", "bresenham", "--router", "aco", "--graph", "grid"),
    ),
    "two views": ("office (sample)", "--views", "2", "--max-incidence", "70"),
    "least time": ("office (sample)", "--minimise", "time"),
    "all places": ("fzk-haus-eg", "--selector", "anywhere"),
}


@dataclass(frozen=True)
class Run:
    """One plan by the real command."""

    exit_code: int
    cpu_s: float
    megabytes: float
    stages: dict[str, float]


def planned(tree: Path, floor: Path, out: Path, options: tuple[str, ...]) -> Run:
    """Plan by the version in a tree; CPU seconds and memory are of the process and those that it waited for."""
    command = [sys.executable, "-m", "stopgo", "plan", str(floor), "-o", str(out), "--json", *options]
    with tempfile.TemporaryFile() as answer:
        process = subprocess.Popen(
            command,
            cwd=tree,
            env={**os.environ, "PYTHONPATH": str(tree)},
            stdout=answer,
            stderr=subprocess.DEVNULL,
        )
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        answer.seek(0)
        told = json.loads(answer.read() or b"{}")
    stages = told.get("times_s") or {}
    return Run(process.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3, stages)


def same(former: Path, present: Path) -> str:
    """`same` if both folders hold the same missions, else the names that differ."""
    names = sorted({path.name for folder in (former, present) for path in folder.glob("mission*.json")})
    _, differ, missing = filecmp.cmpfiles(former, present, names, shallow=False)
    return ", ".join([*differ, *missing]) or ("same" if names else "none")


def compared(former: Path, name: str, folder: Path) -> list[object] | None:
    """One row of the table; None where the floor is not there."""
    floor, *options = PLANS[name]
    path = (ROOT if FLOORS[floor] == SAMPLE else DATA) / FLOORS[floor]
    if not path.exists():
        return None
    runs = []
    for version, tree in (("former", former), ("present", ROOT)):
        runs.append(planned(tree, path, folder / version, tuple(options)))
        if runs[-1].exit_code != 0:
            raise SystemExit(f"{name}: {version} ended with {runs[-1].exit_code}")
    before, now = runs
    return [
        name,
        same(folder / "former", folder / "present"),
        before.cpu_s,
        now.cpu_s,
        now.cpu_s / before.cpu_s,
        round(before.megabytes),
        round(now.megabytes),
    ]


def main() -> None:
    """Measure and print; exit 1 where a mission differs."""
    former, names = Path(sys.argv[1]).resolve(), sys.argv[2:] or list(PLANS)
    rows = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            row = compared(former, name, Path(folder))
        if row is not None:
            rows.append(row)
            print(*row, flush=True)
    head = ["plan", "mission.json", "former CPU s", "CPU s", "ratio", "former MB", "MB"]
    print(f"{versions('numpy', 'scipy', 'shapely')}\n\n{table(head, rows)}")
    sys.exit(0 if all(row[1] == "same" for row in rows) else 1)


if __name__ == "__main__":
    main()
