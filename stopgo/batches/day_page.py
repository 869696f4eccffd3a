"""Pages of a day: an overview, and for each robot its missions in order, with times and commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import msgspec

from stopgo.batches.day_plan import DayPlan, DayStep
from stopgo.mission.console.table import duration
from stopgo.mission.errors import InputError
from stopgo.mission.files.atomic import write_atomic
from stopgo.mission.files.file_name import file_name
from stopgo.recordings.page import whole_page
from stopgo.recordings.page.words import grid, row, section, shown, tag

COLUMNS = ("begins", "ends", "plan", "stops", "path before", "driving and scanning", "files")


@dataclass(frozen=True)
class Day:
    """A day's plan with what a person needs on the pages."""

    date: str
    begin_s: float
    """Begin of the shifts, seconds after midnight."""
    plan: DayPlan
    missions: Mapping[str, Sequence[str]]
    """Names of the mission files of each entry."""
    acquired: Sequence[str]
    """Entries that earlier runs acquired."""
    begun: Mapping[str, str]
    """Entries with a run that did not acquire all, and what to do."""


def begin_of(text: str) -> float:
    """Return seconds after midnight of a time such as `07:00`.

    Raises
    ------
    InputError
        When the text is no time of a day.
    """
    whole = text.removesuffix(":00") if text.count(":") == 2 else text  # TOML's times have seconds
    hours, _, minutes = whole.partition(":")
    if not (hours.isdecimal() and minutes.isdecimal() and int(hours) < 24 and int(minutes) < 60):
        raise InputError(f"[day]: begin = {text!r}: give a time such as 07:00")
    return 3600.0 * int(hours) + 60.0 * int(minutes)


def write_day(folder: Path, day: Day) -> Path:
    """Write the overview, a page for each robot and day.json; returns the overview."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, robot in enumerate(day.plan.robots):
        page = whole_page(f"{robot.name} {day.date}", _robot_page(day, number))
        write_atomic(folder / f"{file_name(robot.name)}.html", page)
    write_atomic(folder / "day.json", msgspec.json.format(msgspec.json.encode(_as_json(day)), indent=1))
    overview = folder / "index.html"
    write_atomic(overview, whole_page(f"Missions of {day.date}", _overview(day)))
    return overview


def _overview(day: Day) -> str:
    rows = []
    for robot, steps, back in zip(day.plan.robots, day.plan.steps, day.plan.returns_s, strict=True):
        link = tag("a", shown(robot.name), href=quote(f"{file_name(robot.name)}.html"))
        stops = sum(step.job.stops for step in steps)
        rows.append(
            row((link, str(len(steps)), str(stops), _clock(day, back), shown(duration(robot.shift_s))))
        )
    left = [f"{job.name}: {job.stops} stops, {duration(job.duration_s)}" for job in day.plan.left]
    begun = [f"{name}: {remedy}" for name, remedy in day.begun.items()]
    return "".join(
        (
            tag("h1", f"Missions of {shown(day.date)}"),
            grid(("robot", "missions", "stops", "back at", "shift"), rows),
            section("Fits into no shift", _listed(left)),
            section("Begun on an earlier day", _listed(begun)),
            section("Acquired by earlier runs", _listed(day.acquired)),
        )
    )


def _listed(lines: Sequence[str]) -> str:
    return tag("ul", *(tag("li", shown(line)) for line in lines)) if lines else ""


def _robot_page(day: Day, number: int) -> str:
    robot, steps = day.plan.robots[number], day.plan.steps[number]
    back = f"Back at {_clock(day, day.plan.returns_s[number])}; shift of {duration(robot.shift_s)}."
    commands = [
        f"stopgo push {path} --robot {robot.name}" for step in steps for path in day.missions[step.job.name]
    ]
    return "".join(
        (
            tag("h1", f"{shown(robot.name)} {tag('small', shown(day.date))}"),
            tag("p", shown(back if steps else "No mission on this day.")),
            tag("div", grid(COLUMNS, (row(_cells(day, step)) for step in steps)), class_="scroll"),
            section("Commands, in this order", *(tag("p", tag("code", shown(item))) for item in commands)),
        )
    )


def _cells(day: Day, step: DayStep) -> Iterator[str]:
    yield _clock(day, step.begin_s)
    yield _clock(day, step.end_s)
    yield shown(step.job.name)
    yield str(step.job.stops)
    yield shown(duration(step.transfer_s))
    yield shown(duration(step.job.duration_s))
    yield tag("a", "plan", href=quote(f"../../{step.job.name}/plan.svg"))


def _clock(day: Day, since_begin_s: float) -> str:
    """A time of the day; `+1` for the next day."""
    minutes = round((day.begin_s + since_begin_s) / 60)
    days, minutes = divmod(minutes, 24 * 60)
    return f"{minutes // 60:02}:{minutes % 60:02}{f' +{days}' if days else ''}"


def _as_json(day: Day) -> dict[str, object]:
    robots = [
        {
            "robot": robot.name,
            "back_s": back,
            "missions": [
                {"plan": step.job.name, "begin_s": step.begin_s, "end_s": step.end_s, "stops": step.job.stops}
                | {"files": list(day.missions[step.job.name])}
                for step in steps
            ],
        }
        for robot, steps, back in zip(day.plan.robots, day.plan.steps, day.plan.returns_s, strict=True)
    ]
    left = [job.name for job in day.plan.left]
    return {"date": day.date, "robots": robots, "left": left, "acquired": list(day.acquired)} | {
        "begun": dict(day.begun)
    }
