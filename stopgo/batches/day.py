"""A day's missions from a batch: what is planned for it, less what earlier runs acquired."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from stopgo.batches.batch_file import read_day
from stopgo.batches.batch_run import Batch
from stopgo.batches.day_page import Day, begin_of, write_day
from stopgo.batches.day_plan import DayJob, DayPlan, DayRobot, plan_day, read_transfers, robots_of, span
from stopgo.batches.record import BatchRecord, EntryRecord
from stopgo.batches.visits import Visits
from stopgo.mission.console.table import counted
from stopgo.mission.errors import InputError

MOST_NAMES = 12
"""Floors and plans named in a note."""


@dataclass(frozen=True)
class DayTeam:
    """Robots of a day, the times between floors, and the set-up before each mission, in seconds."""

    robots: tuple[DayRobot, ...]
    transfers: Mapping[tuple[str, str], float]
    default_s: float
    setup_s: float
    begin_s: float


def read_team(file: Path) -> DayTeam:
    """Return the robots and times of a batch's file.

    Raises
    ------
    InputError
        When the file has no robots, a time is none, or the transfers cannot be read.
    """
    table = read_day(file)
    return DayTeam(
        robots=robots_of(table),
        transfers=read_transfers(None if table.transfers is None else file.parent / table.transfers),
        default_s=span(table.transfer, "transfer"),
        setup_s=span(table.setup, "setup"),
        begin_s=begin_of(table.begin),
    )


def write_day_of(
    team: DayTeam, out: Path, date: str, batch: Batch, record: BatchRecord, visits: Visits
) -> tuple[Path, list[str]]:
    """Allocate the missions of a day to the robots of a batch's file; returns the overview's path and notes.

    They are those of the entries with this date, and of those without a date.

    Raises
    ------
    InputError
        When two variants of a floor are planned.
    """
    dates = {entry.name: entry.settings.date for entry in batch.entries}
    sites = {entry.name: entry.site for entry in batch.entries}
    due = [item for item in record.entries if item.stops and dates[item.name] in (date, None)]
    _one_variant([sites[item.name] for item in due], date)
    acquired = [item.name for item in due if visits.acquired(item.missions)]
    plan = plan_day(
        [_job(item, sites[item.name]) for item in due if item.name not in acquired],
        team.robots,
        team.transfers,
        default_s=team.default_s,
        setup_s=team.setup_s,
    )
    day = Day(
        date=date,
        begin_s=team.begin_s,
        plan=plan,
        missions={item.name: _files(out, item.name) for item in due},
        acquired=acquired,
        begun={item.name: text for item in due if (text := _begun(item, visits))},
    )
    return write_day(out / "days" / date, day), [*_unknown_places(team, sites.values()), *_left(plan)]


def _unknown_places(team: DayTeam, sites: Iterable[str]) -> Iterator[str]:
    """Notes on robots that begin at a floor that neither the batch nor the transfers have."""
    known = {*sites, *(end for pair in team.transfers for end in pair)}
    for robot in team.robots:
        if robot.at and robot.at not in known:
            floors = ", ".join(sorted(known)[:MOST_NAMES])
            yield f"[day]: {robot.name} is at {robot.at}, which is no floor here; known: {floors}"


def _left(plan: DayPlan) -> list[str]:
    """A note on the plans that fit into no shift."""
    if not plan.left:
        return []
    names = ", ".join(job.name for job in plan.left[:MOST_NAMES])
    more = f" and {len(plan.left) - MOST_NAMES} more" if len(plan.left) > MOST_NAMES else ""
    return [f"{counted(len(plan.left), 'plan fits', 'plans fit')} into no shift: {names}{more}"]


def _one_variant(sites: list[str], date: str) -> None:
    twice = sorted({site for site in sites if sites.count(site) > 1})
    if twice:
        raise InputError(
            f"--day {date}: {twice[0]} is planned in several variants; leave one, with exclude or no matrix"
        )


def _job(item: EntryRecord, site: str) -> DayJob:
    return DayJob(item.name, site, item.time_s or 0.0, item.stops or 0)


def _files(out: Path, name: str) -> list[str]:
    """Mission files of an entry, the main part first."""
    return sorted(
        (str(path) for path in (out / name).glob("mission*.json")), key=lambda path: (len(path), path)
    )


def _begun(item: EntryRecord, visits: Visits) -> str:
    """Remedy for an entry with a run that did not acquire all; empty without one."""
    runs = visits.begun(item.missions)
    done = ", ".join(f"{run.scanned} of {run.asked} stops by {run.robot}, run {run.run_id}" for run in runs)
    return f"{done}; stopgo review proposes a follow-up mission" if runs else ""
