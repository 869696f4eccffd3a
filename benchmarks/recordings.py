"""Size and time of recordings: `python -m benchmarks.recordings [--large] [CHECKOUT]`.

Plans of synthetic offices are drawn, a run of four hours is recorded, a folder of a thousand files is listed,
and a large plan is opened by a viewer. With the folder of an older checkout its figures are next to ours, from
the same plans in the same run.
"""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.table import put, table, versions

ROOT = Path(__file__).parents[1]
SIZES = ((50.0, 40.0), (200.0, 150.0))
LARGE = (350.0, 290.0)
"""Planned in some five minutes and 3 GB."""
LIMITS = {2000: "≤ 3 MB, ≤ 2 s", 30000: "≤ 10 MB, ≤ 5 s, svg ≤ 2 s", 101500: "opens, stays smooth"}
HOURS, HERTZ = 4, 10
FILES = 1000

DRAW = """
import json, os, pickle, sys, time
from pathlib import Path
from stopgo.recordings.plan import PlanRecording
from stopgo.mission.files.plan_svg import plan_svg
part, nouns = pickle.load(open(sys.argv[1], "rb"))
path = Path(sys.argv[2])
told, last = {}, [time.perf_counter(), time.process_time()]
def lap(name):
    for clock, (place, now) in zip(("wall", "cpu"), enumerate((time.perf_counter(), time.process_time()))):
        told[f"{name}_{clock}"], last[place] = now - last[place], now
recording = PlanRecording(part.mission.id)
for noun in (*nouns, part.mission):
    recording.observe(noun)
recording.write(path)
lap("rrd")
plan_svg(part.route, part.mission, part.figures, date="2026-01-01")
lap("svg")
told["mb"] = path.stat().st_size / 1e6
told["stops"] = len(part.mission.stops)
print(json.dumps(told))
"""
"""Draws a plan that another process made, with whatever version is on the path."""

PLAN = """
import copyreg, pickle, sys
from types import MappingProxyType
from benchmarks.floors import office
from stopgo.mission.document.schedule import schedule
from stopgo.mission.settings import Settings
from stopgo.mission.stages.sight import sight_of
from stopgo.planner import plan

copyreg.pickle(MappingProxyType, lambda m: (eval, (f"__import__('types').MappingProxyType({dict(m)!r})",)))
part = plan(office(float(sys.argv[1]), float(sys.argv[2]), seed=1), Settings()).parts[0]
nouns = [*part.stage_results(), schedule(part.mission), sight_of(part.route, part.mission, part.figures)]
with open(sys.argv[3], "wb") as file:
    pickle.dump((part, nouns), file)
"""
"""Plans an office and keeps every stage result."""


def sizes() -> tuple[tuple[float, float], ...]:
    return (*SIZES, LARGE) if "--large" in sys.argv else SIZES


def ran(checkout: Path, script: str, *arguments: object) -> str:
    """Output of a script that runs with the modules of a checkout."""
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        cwd=checkout,
        env={**os.environ, "PYTHONPATH": str(checkout)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def plans(folder: Path, former: Path | None) -> Iterator[list[object]]:
    """Rows of the plans' table; the recordings stay in the folder."""
    for width, height in sizes():
        area = round(width * height)
        for name, checkout in (("former", former), ("now", ROOT)):
            if checkout is not None:
                kept = folder / f"{area}-{name}.pickle"
                if not kept.exists():
                    ran(checkout, PLAN, width, height, kept)
                told = json.loads(ran(checkout, DRAW, kept, folder / f"{area}.rrd"))
                costs = [told[key] for key in ("mb", "rrd_wall", "rrd_cpu", "svg_wall", "svg_cpu")]
                yield [area, told["stops"], name, *costs, LIMITS[area] if name == "now" else ""]


def long_run(folder: Path) -> list[list[object]]:
    """Four hours at ten poses a second, a state each second and a scan at every stop."""
    from stopgo.recordings.runs.field import FieldRecording

    with (folder / "2000-now.pickle").open("rb") as file:
        mission = pickle.load(file)[0].mission
    path = folder / "field.rrd"
    begin = time.process_time()
    with FieldRecording(path, mission) as recording:
        for report in _reports(mission):
            kind = type(report).__name__
            told = {"StateReport": recording.state, "PoseReport": recording.pose}.get(kind, recording.event)
            told(report)
        recorded = time.process_time() - begin
    rows = HOURS * 3600 * HERTZ
    return [[rows, len(mission.stops), path.stat().st_size / 1e6, "≤ 20 MB", recorded]]


def _reports(mission: Any) -> Iterator[Any]:
    """The planned drive, stretched to the run's hours."""
    from stopgo.recordings.plan.drive import planned_drive
    from tests.recordings import run

    drive = planned_drive(mission)
    slower = HOURS * 3600 / drive.seconds[-1]
    seconds = np.arange(HOURS * 3600 * HERTZ) / HERTZ
    random = np.random.Generator(np.random.PCG64(1))
    noise = random.normal(0.0, 0.004, (len(seconds), 3))
    poses = np.stack([np.interp(seconds, drive.seconds * slower, column) for column in drive.poses.T], axis=1)
    told = [item for item in run.reports(mission) if type(item).__name__ != "PoseReport"]
    leaving = iter(told)
    teller = run._Teller(mission, run.RUN)
    waiting = next(leaving, None)
    for number, (second, (x, y, heading)) in enumerate(zip(seconds, poses + noise, strict=True)):
        while waiting is not None and (waiting.robot_ns - run.BEGAN_NS) / 1e9 * slower <= second:
            later = {"robot_ns": run.BEGAN_NS + int(second * 1e9)}
            later |= {"mission_time_s": float(second)} if hasattr(waiting, "mission_time_s") else {}
            yield _later(waiting, **later)
            waiting = next(leaving, None)
        if number % HERTZ == 0:
            yield _later(teller.state(float(second) / 20, "RUNNING"), robot_ns=run._ns(float(second)))
        yield teller.pose(float(second), float(x), float(y), float(heading))
    while waiting is not None:
        yield _later(waiting, robot_ns=run.BEGAN_NS + HOURS * 3600 * 10**9)
        waiting = next(leaving, None)


def _later(report: Any, **values: Any) -> Any:
    import msgspec

    return msgspec.structs.replace(report, **values)


def listed(folder: Path, source: Path) -> list[list[object]]:
    """A thousand copies of a plan, one of them damaged, listed twice."""
    place = folder / "runs"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    for number in range(FILES):
        shutil.copy(source, place / f"{number:04}.rrd")
    (place / "0500.rrd").write_bytes(source.read_bytes()[:5000])
    seconds = []
    for _ in range(2):
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "stopgo", "runs", str(place), "--json"],
            cwd=ROOT,
            capture_output=True,
            check=True,
        )
        seconds.append(time.perf_counter() - begin)
    shutil.rmtree(place)
    return [[FILES, source.stat().st_size / 1e6, *seconds, "≤ 2 s again"]]


def opened(folder: Path) -> list[list[object]]:
    """Seconds until a viewer without a graphics card shows a plan, and until it shows another moment of it."""
    from stopgo.recordings.viewing.headless import viewer

    rows = []
    for width, height in sizes():
        area = round(width * height)
        path = folder / f"{area}.rrd"
        begin = time.perf_counter()
        with viewer([path]) as client:
            view = next(v.view_id for v in client.get_state().views if v.name == "Plan and run")
            client.save_screenshot(str(folder / "view.png"), view)
            first = time.perf_counter() - begin
            laps = []
            for second in range(10):
                client.set_time("mission_time", duration=60.0 * second, play_state="paused")
                begin = time.perf_counter()
                client.save_screenshot(str(folder / "view.png"), view)
                laps.append(time.perf_counter() - begin)
        rows.append([area, first, float(np.median(laps))])
    return rows


def main() -> None:
    """Measure, print, and write the tables into the README; STOPGO_BENCH keeps the plans for the next run."""
    folders = [Path(item).resolve() for item in sys.argv[1:] if not item.startswith("-")]
    former = folders[0] if folders else None
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(os.environ.get("STOPGO_BENCH", temporary))
        drawings = list(plans(folder, former))
        head = ["m²", "stops", "version", "MB", "rrd s", "of CPU s", "svg s", "of CPU s", "asked"]
        small = folder / "2000.rrd"
        parts = [
            f"Offices of `benchmarks.growth`, every noun in memory. {versions('rerun-sdk', 'numpy')}",
            table(head, drawings),
            f"A run of {HOURS} h, {HERTZ} poses and a state each second, closed; CPU seconds while it was recorded:",
            table(["poses", "stops", "MB", "asked", "s"], long_run(folder)),
            "`stopgo runs`, one file of the folder damaged; the whole process:",
            table(["files", "MB each", "first s", "again s", "asked"], listed(folder, small)),
            "Opened by a viewer that draws in software, 1600 × 1000: until its first picture, and median time of one:",
            table(["m²", "first s", "picture s"], opened(folder)),
        ]
    text = "\n\n".join(parts)
    print(text)
    put("recordings", text)


if __name__ == "__main__":
    main()
