"""Planning of a floor's file into a folder: mission, recording, coverage and picture of every part."""

from __future__ import annotations

import datetime
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stopgo.mission.console.running_step import RunningStep, running
from stopgo.mission.errors import StopgoError
from stopgo.mission.files.atomic import must_be_writable, replacing
from stopgo.planner import plan
from stopgo.result_files import is_missing, report_missing_rerun, result_folder

if TYPE_CHECKING:
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.plan import PartPlan, Plan
    from stopgo.mission.settings import Settings
    from stopgo.mission.stages.seen_area import SeenSurface
    from stopgo.planner.commands.plan_report import PlanReport
    from stopgo.planner.floors.standing_body import StandingBody
    from stopgo.recordings.plan import PlanRecording


@dataclass(frozen=True)
class PrintOptions:
    """Options of the files that are made for a printer."""

    sheets: bool | None = None
    """True: plan.pdf is written; None: only where one sheet cannot show the floor at a readable scale."""
    rings: bool = False
    """True: the scanner's range is drawn round each stop."""


def plan_files(
    floor: Path,
    out: Path,
    settings: Settings,
    *,
    all_parts: bool = False,
    print_options: PrintOptions | None = None,
) -> list[PlanReport]:
    """Plan a floor's file into a folder; one report per part, the main part first."""
    with running(f"reading {floor}") as step:
        return _planned(floor, out, settings, Stopwatch(step), all_parts, print_options or PrintOptions())


def _planned(
    floor: Path, out: Path, settings: Settings, watch: Stopwatch, all_parts: bool, options: PrintOptions
) -> list[PlanReport]:
    from stopgo.planner.commands.outputs import names
    from stopgo.planner.floors import options_of, read_floor, standing_bodies

    read = read_floor(floor, options_of(settings))
    folder = result_folder(out)
    for path in names(folder, 0).values():
        must_be_writable(path)
    with _print_findings_on_error(read):
        made = plan(read, settings, observe=watch.observe, all_parts=all_parts)
    bodies = standing_bodies(floor, options_of(settings))
    reports = [_write_part(made, number, folder, options, watch, bodies) for number in range(len(made.parts))]
    _set_aside_old(folder, len(reports), read, settings)
    if made.divided is None:
        return reports
    from stopgo.planner.commands.shared_report import shared_report

    return [shared_report(made.divided, reports)]


@contextmanager
def _print_findings_on_error(floor: FloorPlan) -> Iterator[None]:
    """Print the floor's findings on stderr if no plan can be made: they may contain the reason."""
    from stopgo.mission.floor import Rank
    from stopgo.planner.commands.plan_report import finding_lines

    try:
        yield
    except StopgoError:
        by_rank = sorted((item for item in floor.findings if item.rank != Rank.NOTE), key=lambda f: f.rank)
        for line in finding_lines(by_rank):
            typer.echo(line.strip(), err=True)
        raise


def _set_aside_old(folder: Path, parts: int, floor: FloorPlan, settings: Settings) -> None:
    """Rename the files of other plans in the folder, and print their new names."""
    from stopgo.planner.commands.outputs import set_aside

    moved = set_aside(folder, parts, floor.source, settings)
    if moved:
        new_names = ", ".join(path.name for path in moved)
        typer.echo(f"{folder}: renamed, of another plan and not to be driven: {new_names}", err=True)


WRITTEN = ("recording", "sheets", "coverage", "picture", "mission")
"""A plan's files in the order in which they appear: the mission when all else is there."""


def _write_part(
    plan: Plan,
    number: int,
    folder: Path,
    options: PrintOptions,
    watch: Stopwatch,
    bodies: Sequence[StandingBody],
) -> PlanReport:
    """Write the plan of one part; its files appear together, mission.json last."""
    from stopgo.planner.checking.model_clearance import too_near
    from stopgo.planner.commands.outputs import names, set_aside_file
    from stopgo.planner.commands.plan_report import PlanReport

    files = names(folder, number)
    part = _revised(plan.parts[number], files["mission"])
    recording = _recording(part.mission.id)
    if recording is None:
        del files["recording"]
    contents = _PartContents(part, plan, options, _today(), _seen_from(part, watch))
    sheets = contents.sheets(files["sheets"])
    unwanted = [files.pop("sheets")] if sheets is None else []
    unwanted += [files.pop("picture")] if plan.divided and number else []
    keys = [key for key in WRITTEN if key in files]
    with replacing(*(files[key] for key in keys)) as paths:
        written = dict(zip(keys, paths, strict=True))
        if recording is not None:
            contents.record(recording)
            recording.write(written["recording"])
        watch.lap("recording")
        if sheets is not None:
            written["sheets"].write_bytes(sheets)
        written["coverage"].write_bytes(contents.coverage())
        if "picture" in written:
            written["picture"].write_bytes(contents.picture())
        written["mission"].write_bytes(contents.mission())
    for path in unwanted:
        set_aside_file(path)
    watch.lap("files")
    near = tuple(too_near(part.mission, bodies, plan.settings))
    return PlanReport(part=part, files=files, times_s=watch.times(), too_near=near, surface=contents.surface)


def _today() -> str:
    return datetime.date.today().isoformat()


def _revised(part: PartPlan, path: Path) -> PartPlan:
    """The part's plan, its mission with the revision that replaces the file at `path`."""
    from msgspec.structs import replace as changed

    from stopgo.mission.document import sealed
    from stopgo.mission.files.mission_json import next_revision

    revision = next_revision(path, part.mission)
    return replace(part, mission=sealed(changed(part.mission, revision=revision)))


def _recording(recording_id: str) -> PlanRecording | None:
    """A new recording of a plan; None, and a line on stderr, if Rerun is not installed."""
    try:
        from stopgo.recordings.plan import PlanRecording
    except ModuleNotFoundError as error:
        report_missing_rerun(error, "plan.rrd")
        return None
    return PlanRecording(recording_id)


def _seen_from(part: PartPlan, watch: Stopwatch) -> SeenSurface | None:
    """Area that the stops of a part see; None for a floor whose heights are not known."""
    from stopgo.planner.checking.seen_surface import seen_surface

    found = seen_surface(part.route)
    watch.lap("surface")
    return found


@dataclass(frozen=True, eq=False)
class _PartContents:
    """Contents of the files of one part of a plan."""

    part: PartPlan
    plan: Plan
    options: PrintOptions
    date: str
    surface: SeenSurface | None = None

    def record(self, recording: PlanRecording) -> None:
        """Hand every stage result of the part to the recording."""
        from stopgo.mission.document.schedule import schedule
        from stopgo.mission.stages.sight import sight_of

        mission = self.part.mission
        sight = sight_of(self.part.route, mission, self.part.figures)
        for result in (*self.part.stage_results(), mission, schedule(mission), sight):
            recording.observe(result)

    def sheets(self, path: Path) -> bytes | None:
        """The set of sheets, if it is wanted; None, and a line on stderr, if reportlab is not installed."""
        from stopgo.mission.files.plan_sheets import needs_sheets, plan_pdf

        part, wanted = self.part, self.options.sheets
        if wanted is False or not (wanted or needs_sheets(part.route, part.mission)):
            return None
        try:
            return plan_pdf(
                part.route, part.mission, part.figures, date=self.date, with_range=self.options.rings
            )
        except ModuleNotFoundError as error:
            if wanted or not is_missing(error, "reportlab"):
                raise
            problem = "not written, reportlab is not installed"
            typer.echo(f'{path.name}: {problem}; pip install "stopgo[plan]"', err=True)
            return None

    def coverage(self) -> bytes:
        """The bytes of coverage.json."""
        from stopgo.mission.files.coverage_json import coverage_json

        return coverage_json(self.part.route, self.part.mission, self.part.figures, self.surface)

    def picture(self) -> bytes:
        """The bytes of plan.svg; it shows all stops where robots or tours divide them."""
        from stopgo.mission.files.plan_svg import plan_svg

        shown = self.part if self.plan.divided is None else self.plan.divided.whole
        return plan_svg(
            shown.route,
            shown.mission,
            shown.figures,
            self.plan.shared,
            date=self.date,
            with_range=self.options.rings,
        )

    def mission(self) -> bytes:
        """The bytes of mission.json."""
        from stopgo.mission.files.mission_json import encode

        return encode(self.part.mission)


STAGES = {
    "FloorPlan": ("read", "navigable space"),
    "NavigableSpace": ("navigable", "candidates"),
    "Candidates": ("candidates", "visibility"),
    "Visibility": ("visibility", "selection"),
    "Selection": ("selection", "route"),
    "Route": ("route", "figures"),
    "Figures": ("figures", "mission"),
    "Mission": ("route", "files"),
}
"""By the class name of each stage result: the stage that ends with it, and the step that begins."""


class Stopwatch:
    """Seconds per stage; names the running step."""

    def __init__(self, step: RunningStep) -> None:
        self._laps: dict[str, float] = {}
        self._begin = self._last = time.perf_counter()
        self._step = step

    def observe(self, result: object) -> None:
        """Count the time since the last result to the stage that ends with this one."""
        ended, begins = STAGES.get(type(result).__name__, ("other", "files"))
        self.lap(ended)
        self._step.begin(begins)

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self._laps[stage] = self._laps.get(stage, 0.0) + now - self._last
        self._last = now

    def times(self) -> dict[str, float]:
        """Seconds per stage and in total."""
        return {**self._laps, "total": time.perf_counter() - self._begin}
