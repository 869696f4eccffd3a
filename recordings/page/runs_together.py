"""Runs of one plan of a floor together: their names, acquired coverage, and one follow-up mission."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from shlex import quote
from typing import Any

from msgspec import UNSET

from stopgo.mission.comparing.acquired import Acquired
from stopgo.mission.comparing.acquiring import acquired_together, name_of, scanned_positions
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.comparing.run_verdict import judge, named
from stopgo.mission.document import Mission
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
    """Runs of one mission, or of missions that share a floor, and what they acquired together."""

    runs: tuple[Comparison, ...]
    """The earliest first."""
    missions: tuple[Mission, ...]
    """Newest revision of each mission, by their number."""
    acquired: Acquired | None
    """None without visibility data."""

    @property
    def left(self) -> tuple[str, ...]:
        """Stops that no run scanned within tolerance, in order of driving."""
        done = scanned_positions(self.runs)
        stops = ((mission, stop) for mission in self.missions for stop in mission.stops)
        return tuple(name_of(mission, stop.id) for mission, stop in stops if (stop.x, stop.y) not in done)

    @property
    def absent(self) -> tuple[int, ...]:
        """Numbers of the missions that share the floor and are not known."""
        share = self.missions[-1].share
        known = {mission.share.number for mission in self.missions if mission.share is not UNSET}
        return () if share is UNSET else tuple(set(range(1, share.of + 1)) - known)

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
        """Coverage together, what is left, and what else to give."""
        return tuple(self._sentences())

    def _sentences(self) -> Iterator[str]:
        count = f"Together, the {len(self.runs)} runs scanned" if len(self.runs) > 1 else "This run scanned"
        if self.acquired is None:
            yield f"{count} an unknown coverage; the plan's recording contains it."
        else:
            whole = self.acquired.coverage.whole
            least = "at least " if self.acquired.answer == "unknown" else ""
            asked = (
                "" if whole.required is None else f"; {percent(whole.required)} was required{self._of_all}"
            )
            yield f"{count} {least}{percent(whole.coverage)} of what is visible{asked}."
            short = [group.name for group in self.acquired.coverage.short if group is not whole]
            if short:
                yield f"Below the requirement: {named(short, 'rooms and kinds')}."
        if self.left:
            yield f"Not scanned by any run: {named(self.left)}."
        else:
            yield "No stop of these missions is left." if self.absent else "No stop is left."
        if self.absent:
            absent = named([f"mission {number}" for number in sorted(self.absent)], "missions")
            yield f"Give also the recordings of {absent}: they share the floor."

    @property
    def _of_all(self) -> str:
        share = self.missions[-1].share
        return "" if share is UNSET else f" of all {share.of} missions together"

    def what_next(self, paths: Iterable[Path]) -> tuple[str, ...]:
        """Return the command for one follow-up mission after all runs, if they acquired too little."""
        over = all(run.log.ended for run in self.runs) and not self.absent
        floor = self.missions[-1].origin.floor
        if self.acquired is None or self.acquired.answer != "no" or not over or not floor:
            return ()
        return (follow_up_command(paths, floor, len(self.missions)),)

    def as_json(self) -> dict[str, Any]:
        """Return everything, for `--json`."""
        acquired = self.acquired
        return {
            "mission_id": self.missions[-1].id,
            "missions": [mission.id for mission in self.missions],
            "runs": [run.run_id for run in self.runs],
            "names": run_names(self.runs),
            "coverage": None if acquired is None else acquired.coverage.whole.coverage,
            "required": None if acquired is None else acquired.coverage.whole.required,
            "answer": "unknown" if acquired is None else acquired.answer,
            "left": list(self.left),
            "rooms": [{"name": group.name, "acquired": group.coverage} for _, group in self.rooms],
        }


def together(
    runs: Sequence[Comparison], missions: Iterable[Mission], sights: Iterable[Sight]
) -> RunsTogether:
    """Return runs together that are of one mission, or of missions that share a floor."""
    ordered = tuple(sorted(runs, key=lambda run: run.log.began_ns or 0))
    newest = newest_of([*missions, *(run.mission for run in ordered)])
    return RunsTogether(ordered, newest, acquired_together(ordered, newest, sights))


def newest_of(missions: Iterable[Mission]) -> tuple[Mission, ...]:
    """Return the newest revision of each mission, by their number among those that share a floor."""
    newest = {mission.id: mission for mission in sorted(missions, key=lambda mission: mission.revision)}
    return tuple(sorted(newest.values(), key=number_of))


def number_of(mission: Mission) -> int:
    """Return the number of a mission among those that share its floor; 1 if it shares none."""
    return 1 if mission.share is UNSET else mission.share.number


def follow_up_command(paths: Iterable[Path], floor: str, missions: int = 1) -> str:
    """Return the line that names the command for a follow-up mission after the runs in some files."""
    files = " ".join(dict.fromkeys(quote(str(path)) for path in paths))
    names = ("mission.json", *(f"mission-{number}.json" for number in range(2, missions + 1)))
    given = " ".join(f"--mission {name}" for name in names)
    command = f"stopgo replay {files} {given} --floor FLOOR --top-up next.json"
    return f"For the missing coverage, plan a follow-up mission (FLOOR is the file of {floor}): {command}"
