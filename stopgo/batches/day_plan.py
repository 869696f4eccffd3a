"""One day's missions: which robot drives which plans, in which order, within its shift.

The order and the allocation are by PyVRP's iterated local search. Plans that fit into no shift stay out, the
shortest first. The search is seeded and ends by a count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stopgo.batches.batch_file import DayTable
from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import bytes_of, rows_of
from stopgo.mission.settings.parameter import seconds

ITERATIONS = 400
PER_PLAN = 20
"""Iterations of the search, and further ones for each plan."""


@dataclass(frozen=True)
class DayRobot:
    """A robot with its shift."""

    name: str
    shift_s: float
    at: str
    """Floor where its day begins and ends; empty if that costs no time."""


@dataclass(frozen=True)
class DayJob:
    """The missions of one entry, to be driven by one robot one after another."""

    name: str
    site: str
    """Its floor."""
    duration_s: float
    stops: int


@dataclass(frozen=True)
class DayStep:
    """A job in a robot's day."""

    job: DayJob
    transfer_s: float
    """Time to bring the robot to it."""
    begin_s: float
    """Time since the begin of the shift."""
    end_s: float


@dataclass(frozen=True)
class DayPlan:
    """The day of each robot, and the jobs that fit into no shift."""

    robots: tuple[DayRobot, ...]
    steps: tuple[tuple[DayStep, ...], ...]
    """For each robot, in order."""
    returns_s: tuple[float, ...]
    """For each robot: time since the begin of its shift at which it is back."""
    left: tuple[DayJob, ...]


def robots_of(table: DayTable) -> tuple[DayRobot, ...]:
    """Return the robots of a day's table.

    Raises
    ------
    InputError
        When there is none, two have one name, or a shift is no duration.
    """
    robots = tuple(DayRobot(item.name, span(item.shift, "shift"), item.at) for item in table.robots)
    names = [robot.name for robot in robots]
    if not all(names) or not names or len(set(names)) < len(names):
        raise InputError(f"[day]: robots are {', '.join(names) or 'none'}; give each a name of its own")
    return robots


def span(text: str, key: str) -> float:
    """Return a duration in seconds.

    Raises
    ------
    InputError
        When the text is no duration.
    """
    try:
        value = seconds(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 7 * 86400:
        raise InputError(f"[day]: {key} = {text!r}: give a duration such as 8h, 45min or 1h30min")
    return value


def read_transfers(path: Path | None) -> dict[tuple[str, str], float]:
    """Return the times between floors, in both directions, in seconds, from a CSV of from, to, minutes.

    Raises
    ------
    InputError
        Naming the file and the line.
    """
    transfers: dict[tuple[str, str], float] = {}
    for number, cells in () if path is None else rows_of(_text(path), str(path)):
        if number == 1 and cells[-1].strip() == "minutes":
            continue
        try:
            one, other, minutes = (cell.strip() for cell in cells)
            value = 60 * float(minutes)
        except ValueError:
            raise InputError(f"{path}: line {number}: give from, to and minutes") from None
        if not 0 <= value <= 86400:
            raise InputError(f"{path}: line {number}: {minutes} minutes; give 0 to 1440")
        transfers[one, other] = transfers[other, one] = value
    return transfers


def _text(path: Path) -> str:
    return bytes_of(path, "give the paths as CSV: from, to, minutes").decode("utf-8-sig", errors="replace")


def plan_day(
    jobs: Sequence[DayJob], robots: Sequence[DayRobot], transfers: Mapping[tuple[str, str], float],
    *, default_s: float, setup_s: float, seed: int = 1,
) -> DayPlan:  # fmt: skip
    """Allocate jobs to robots; the same input gives the same plan."""

    def transfer_s(one: str, other: str) -> float:
        return 0.0 if one == other or "" in (one, other) else transfers.get((one, other), default_s)

    fitting = [
        job
        for job in jobs
        if any(_alone(job, robot, transfer_s) + setup_s <= robot.shift_s for robot in robots)
    ]
    orders = _orders(fitting, robots, transfer_s, setup_s, seed) if fitting else [() for _ in robots]
    days = [_day(order, robot, transfer_s, setup_s) for order, robot in zip(orders, robots, strict=True)]
    taken = {job.name for order in orders for job in order}
    return DayPlan(
        robots=tuple(robots),
        steps=tuple(steps for steps, _ in days),
        returns_s=tuple(back for _, back in days),
        left=tuple(job for job in jobs if job.name not in taken),
    )


def _alone(job: DayJob, robot: DayRobot, transfer_s: Any) -> float:
    """Duration of a day with this job only, without set-up."""
    return float(transfer_s(robot.at, job.site) + job.duration_s + transfer_s(job.site, robot.at))


def _day(
    order: Sequence[DayJob], robot: DayRobot, transfer_s: Any, setup_s: float
) -> tuple[tuple[DayStep, ...], float]:
    """A robot's steps, and when it is back."""
    now, here, steps = 0.0, robot.at, []
    for job in order:
        needed = transfer_s(here, job.site)
        begin = now + needed + setup_s
        now, here = begin + job.duration_s, job.site
        steps.append(DayStep(job, needed, begin, now))
    return tuple(steps), now + transfer_s(here, robot.at)


def _orders(
    jobs: Sequence[DayJob], robots: Sequence[DayRobot], transfer_s: Any, setup_s: float, seed: int
) -> list[tuple[DayJob, ...]]:
    """The jobs of each robot, in order."""
    import pyvrp
    from pyvrp.stop import MaxIterations

    count, sites = len(jobs), [*(job.site for job in jobs), *(robot.at for robot in robots)]
    times: Any = np.array([[np.ceil(transfer_s(a, b)) for b in sites] for a in sites], dtype=np.int64)
    prize = int(times.sum()) + 1  # more than any round trip: a job is left out only if it does not fit
    data = pyvrp.ProblemData(
        locations=[pyvrp.Location(0, 0) for _ in sites],
        clients=[
            pyvrp.Client(
                location=k,
                service_duration=int(np.ceil(job.duration_s + setup_s)),
                required=False,
                prize=prize + int(job.duration_s),
            )
            for k, job in enumerate(jobs)
        ],
        depots=[pyvrp.Depot(location=count + k) for k in range(len(robots))],
        vehicle_types=[
            pyvrp.VehicleType(
                start_depot=k, end_depot=k, shift_duration=int(robot.shift_s), unit_distance_cost=1
            )
            for k, robot in enumerate(robots)
        ],
        distance_matrices=[times],
        duration_matrices=[times],
    )
    stop = MaxIterations(ITERATIONS + PER_PLAN * count)
    found = pyvrp.solve(data, stop, seed=seed, collect_stats=False, display=False)
    orders: list[tuple[DayJob, ...]] = [() for _ in robots]
    for route in found.best.routes() if found.is_feasible() else ():
        orders[route.start_depot()] = tuple(jobs[item.idx] for item in route if item.is_client())
    return orders
