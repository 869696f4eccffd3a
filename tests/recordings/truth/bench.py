"""The truth bench: logs with a known truth, and whether a replay answers yes, no, or undecided.

An oracle that knows the error of each pose says what a log can decide. A false yes or no is a defect, and so
is every log that can decide and is said not to.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stopgo.command_line import main
from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import write
from tests.recordings.truth import disturbances, drives
from tests.recordings.truth.disturbances import SENSES, SLOW, Sense, Sensed
from tests.recordings.truth.drives import MISHAPS, STOPS, Mishap, Tour, mission_with_return
from tests.recordings.truth.formats import (
    BAGS,
    FIRST,
    FITTED,
    MAP,
    TABLES,
    VEHICLES,
    WRITERS,
    Writer,
    write_log,
)

AWAY = (drives.mirrored, drives.another_mission)
"""Drives of another mission: their logs may be refused, and no fit to the stops tells anything."""
WRONG_MAPS = (drives.all_off_alike, drives.turned_map, drives.stretched_map)
"""Drives that look the same as those of a robot that was right, by poses of a map that lies wrong."""
WORDS = {0: "yes", 1: "no", 2: "refused", 3: "unknown"}


@dataclass(frozen=True)
class Case:
    """One log: what happened, what the log kept of it, and its format."""

    seed: int
    mishap: Mishap
    sense: Sense
    writer: Writer
    placing: str

    @property
    def name(self) -> str:
        where = "" if self.writer in VEHICLES else f" {self.placing.partition('=')[0].removeprefix('--')}"
        if self.placing in (FIRST, FITTED) and where:
            where = f" {self.placing.rpartition('=')[2]}"
        words = (self.mishap.__name__, self.sense.__name__, self.writer.__name__)
        return " / ".join(words) + where + f" #{self.seed}"


@dataclass(frozen=True)
class Answer:
    """Answer to a case, next to its truth."""

    case: Case
    truth: str
    could: bool
    """True if an oracle could tell the truth from the log."""
    answer: str
    text: str

    @property
    def kind(self) -> str:
        """`right`, `false yes`, `false no`, `untold` (it can be decided), or `open` (it cannot)."""
        if self.answer == "yes":
            return "right" if self.truth == "yes" else "false yes"
        if self.answer == "no":
            return "right" if self.truth == "no" else "false no"
        if self.answer == "refused" and self.case.mishap in AWAY:
            return "right"
        return "untold" if self.could else "open"


def cases(seeds: int = 1) -> Iterator[Case]:
    """Yield every mishap with every disturbance, and formats and placings in turn."""
    number = 0
    for seed in range(1, seeds + 1):
        for k, mishap in enumerate(MISHAPS):
            for n, sense in enumerate(SENSES):
                number += 1
                writer = WRITERS[(number + k + 3 * seed) % len(WRITERS)]
                if sense in SLOW and writer in BAGS:
                    writer = VEHICLES[k % len(VEHICLES)]
                if sense is disturbances.clock_ahead_in_a_halt and writer in VEHICLES:
                    writer = TABLES[k % len(TABLES)]  # nobody sets a vehicle's time since boot
                if sense is disturbances.without_headings:
                    writer = WRITERS[0]
                placing = (MAP, FIRST, FITTED, MAP)[(n + 2 * k + seed) % 4]
                yield Case(1000 * seed + number, mishap, sense, writer, placing)


def answered(case: Case, folder: Path) -> Answer:
    """Write the log of a case, and replay it."""
    chance = np.random.default_rng(case.seed)
    mission = mission_with_return(case.seed)
    tour = case.mishap(mission, chance)
    poses = case.sense(tour, chance)
    log = write_log(case.writer, folder, mission, poses, case.placing)
    write(mission, folder / "mission.json")
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        mission_file = str(folder / "mission.json")
        code = main(["replay", str(log.path), "--mission", mission_file, *log.options, "--json"])
    told = json.loads(out.getvalue()) if out.getvalue() else {}
    text = told.get("verdict") or err.getvalue().strip()
    return Answer(case, tour.answer, could_tell(case, tour, poses), WORDS[code], text)


def could_tell(case: Case, tour: Tour, poses: Sensed) -> bool:
    """True if the poses alone, with their errors known, show that all was scanned, or that a stop was not.

    Heights of robots have errors of metres. A shift or turn of all stops looks like that of a map. A log that
    is fitted to its stops must begin at the start, and one that places itself must have headings.
    """
    if case.mishap in (drives.another_storey, drives.climbs, *WRONG_MAPS):
        return False
    own = case.writer not in VEHICLES
    if own and (case.placing == FITTED and not _begins(tour, poses)):
        return False
    if own and poses.headless and case.placing != MAP:
        return False
    if case.placing == FITTED and case.writer not in VEHICLES and case.mishap in AWAY:
        return False
    shown = [_shown(tour, poses, k, good=good, gaps=not own) for k, good in enumerate(tour.good)]
    if tour.answer == "yes":
        return all(shown)
    return any(shows for shows, good in zip(shown, tour.good, strict=True) if not good)


def _shown(tour: Tour, poses: Sensed, number: int, *, good: bool, gaps: bool) -> bool:
    """True if the poses show that a stop was scanned, or that it was not.

    `gaps`: a time without poses is one, and no clock that was set forward.
    """
    stop: Mission = tour.mission
    plan, halts = stop.stops[number], tour.drive.halts
    least_s = 0.9 * (plan.settle_s + plan.scan.duration_s) - 1.0
    if good:
        return any(
            _covered(poses, halt.begin_s, halt.end_s, least_s, gaps=gaps)
            for halt in halts
            if halt.stop == number
        )
    there = [halt for halt in halts if halt.stop == number]
    if there:
        return all(_covered(poses, halt.begin_s - 2, halt.end_s + 2, 1.0) for halt in there) and _whole(
            poses, tour, least_s
        )
    return _whole(poses, tour, least_s)


def _begins(tour: Tour, poses: Sensed) -> bool:
    """True if the poses begin where the drive does."""
    first = poses.ns.argmin()
    return bool(poses.true_s[first] < 3.0)


def _whole(poses: Sensed, tour: Tour, least_s: float) -> bool:
    """True if no part of the whole run is missing that is as long as a scan, and its poses are good."""
    if _steps_ahead_at_a_halt(poses, least_s):
        return False
    times = np.concatenate([[0.0], np.sort(poses.true_s), [tour.drive.seconds]])
    return bool(np.diff(times).max() < least_s and np.nanmedian(poses.error_m) < 0.05)


def _steps_ahead_at_a_halt(poses: Sensed, least_s: float) -> bool:
    """True if the clock steps forward while the robot is stationary: it looks like a gap."""
    ahead = np.diff(poses.ns) / 1e9 - np.diff(poses.true_s)
    moved = np.hypot(*np.diff(poses.xy, axis=0).T)
    return bool((ahead[moved < 0.02] > least_s).any()) if (ahead > least_s).sum() == 1 else False


def _covered(poses: Sensed, begin_s: float, end_s: float, least_s: float, *, gaps: bool = True) -> bool:
    """True if poses within 30 mm of the truth show a time of at least `least_s`, with or without gaps."""
    inside = (poses.true_s >= begin_s - 1e-6) & (poses.true_s <= end_s + 1e-6) & np.isfinite(poses.xy[:, 0])
    times = np.sort(poses.true_s[inside])
    if len(times) < 2 or np.median(poses.error_m[inside]) > 0.03:
        return False
    steps = np.diff(times)
    usual_s = float(np.median(np.abs(np.diff(poses.ns)))) / 1e9
    return float(steps[gaps | (steps <= max(1.0, 10 * usual_s))].sum()) >= least_s


__all__ = ["STOPS", "Answer", "Case", "answered", "cases", "could_tell"]
