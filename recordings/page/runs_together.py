"""Runs of one mission together: their names, the coverage they acquired, and one follow-up mission."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from shlex import quote
from typing import Any

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.acquiring import acquired_together, scanned_positions
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.run_verdict import judge, named
from stopgo.mission.stages.figures import CoveragePair, percent
from stopgo.mission.stages.sight import Sight

FIRST_DATE_NS, LAST_DATE_NS = 10**18, 4 * 10**18
"""Times from 2001 to 2096: others are no dates."""


def when_and_who(run: Comparison) -> str:
    """Return date and robot of a run; a clock that was never set has no date."""
    began_ns = run.log.began_ns or 0
    when = "date unknown (its clock was not set)"
    if FIRST_DATE_NS <= began_ns < LAST_DATE_NS:
        when = f"{datetime.fromtimestamp(began_ns // 10**9, UTC):%Y-%m-%d %H:%M} UTC"
    return f"{when}, robot {run.log.robot or 'without a name'}"


def run_names(runs: Sequence[Comparison]) -> list[str]:
    """Return date and robot of each run; runs of one minute and robot are numbered."""
    names = [when_and_who(run) for run in runs]
    count, number = Counter(names), Counter[str]()
    for index, name in enumerate(names):
        number[name] += 1
        if count[name] > 1:
            names[index] = f"{name} (run {number[name]})"
    return names


@dataclass(frozen=True, eq=False)
class RunsTogether:
    """Several runs of one mission, and what they acquired together."""

    runs: tuple[Comparison, ...]
    """The earliest first."""
    acquired: Acquired | None
    """None without visibility data."""

    @property
    def left(self) -> tuple[str, ...]:
        """Stops of the newest revision that no run scanned within tolerance, in order of driving."""
        done = scanned_positions(self.runs)
        newest = max((run.mission for run in self.runs), key=lambda mission: mission.revision)
        return tuple(stop.id for stop in newest.stops if (stop.x, stop.y) not in done)

    @property
    def rooms(self) -> tuple[CoveragePair, ...]:
        """Rooms as planned and as acquired by all runs; empty without visibility data."""
        return () if self.acquired is None else self.acquired.rooms

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Name and verdict of each run, one line each."""
        names = run_names(self.runs)
        return tuple(f"{name}: {judge(run).headline}" for name, run in zip(names, self.runs, strict=True))

    @property
    def sentences(self) -> tuple[str, ...]:
        """Coverage together, and what is left."""
        count = f"Together, the {len(self.runs)} runs scanned"
        left = f"Not scanned by any run: {named(self.left)}." if self.left else "No stop is left."
        if self.acquired is None:
            return (f"{count} an unknown coverage; the plan's recording contains it.", left)
        whole = self.acquired.coverage.whole
        least = "at least " if self.acquired.answer == "unknown" else ""
        asked = "" if whole.required is None else f"; {percent(whole.required)} was required"
        short = [group for group in self.acquired.coverage.short if group is not whole]
        rooms = (f"Below the requirement: {named([group.name for group in short])}." for _ in short[:1])
        return (f"{count} {least}{percent(whole.coverage)} of what is visible{asked}.", *rooms, left)

    def what_next(self, paths: Iterable[Path]) -> tuple[str, ...]:
        """Return the command for one follow-up mission after all runs, if they acquired too little."""
        over = all(run.log.ended for run in self.runs)
        floor = self.runs[-1].mission.origin.floor
        if self.acquired is None or self.acquired.answer != "no" or not over or not floor:
            return ()
        return (follow_up_command(paths, floor),)

    def as_json(self) -> dict[str, Any]:
        """Return everything, for `--json`."""
        acquired = self.acquired
        return {
            "mission_id": self.runs[-1].mission.id,
            "runs": [run.run_id for run in self.runs],
            "names": run_names(self.runs),
            "coverage": None if acquired is None else acquired.coverage.whole.coverage,
            "required": None if acquired is None else acquired.coverage.whole.required,
            "answer": "unknown" if acquired is None else acquired.answer,
            "left": list(self.left),
            "rooms": [{"name": group.name, "acquired": group.coverage} for _, group in self.rooms],
        }


def together(runs: Sequence[Comparison], sights: Iterable[Sight]) -> RunsTogether:
    """Return runs of one mission together."""
    ordered = sorted(runs, key=lambda run: run.log.began_ns or 0)
    return RunsTogether(tuple(ordered), acquired_together(ordered, sights))


def follow_up_command(paths: Iterable[Path], floor: str) -> str:
    """Return the line that names the command for a follow-up mission after the runs in some files."""
    files = " ".join(dict.fromkeys(quote(str(path)) for path in paths))
    command = f"stopgo replay {files} --mission mission.json --floor FLOOR --top-up next.json"
    return f"For the missing coverage, plan a follow-up mission (FLOOR is the file of {floor}): {command}"
