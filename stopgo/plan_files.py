"""Planning of a floor's file into a folder: mission, recording, coverage and picture of every part."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from stopgo.mission.console.freed_memory import give_back, looking_seldom
from stopgo.mission.console.running_step import RunningStep, running
from stopgo.mission.errors import StopgoError
from stopgo.mission.files.atomic import Replacement, alone_in, must_be_writable, replacement
from stopgo.planner import plan
from stopgo.planner.geometry.instance_cache import forget_all
from stopgo.planner.geometry.side_work import SideWork
from stopgo.recording_process import recording_process
from stopgo.result_files import is_missing, report_missing_rerun, result_folder
from stopgo.spared_modules import load_when_used

if TYPE_CHECKING:
    from stopgo.mission.files.plan_svg import FloorsOnPaper
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.plan import PartPlan, Plan
    from stopgo.mission.settings import Settings
    from stopgo.mission.stages.seen_area import SeenSurface
    from stopgo.planner.commands.plan_report import PlanReport
    from stopgo.planner.floors.standing_body import StandingBody
    from stopgo.recording_process import PlanDrawing, RecordingProcess


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
    beside: bool = False,
    observe: Callable[[object], None] = lambda result: None,
) -> list[PlanReport]:
    """Plan a floor's file into a folder; one report per part, the main part first.

    With `beside` the recordings are drawn in a process of their own, which loads Rerun during planning.
    `observe` is called with the result of each stage as soon as it is there.
    """
    with running(f"reading {floor}") as step, recording_process() as recorder, looking_seldom():
        watch = Stopwatch(step, observe)
        writing = _Writing(out, print_options or PrintOptions(), watch, recorder, beside)
        return _planned(floor, settings, writing, all_parts)


@dataclass(frozen=True, eq=False)
class _Writing:
    """Folder of a plan's files, and the means to write them."""

    out: Path
    options: PrintOptions
    watch: Stopwatch
    recorder: RecordingProcess
    beside: bool


def _planned(floor: Path, settings: Settings, writing: _Writing, all_parts: bool) -> list[PlanReport]:
    from stopgo.planner.commands.outputs import names, set_aside_file

    load_when_used()
    from stopgo.planner.floors import options_of, read_floor, standing_bodies

    if writing.beside:
        import stopgo.mission.plan  # noqa: F401  the other process has it then

        writing.recorder.start()
    read = read_floor(floor, options_of(settings))
    folder = result_folder(writing.out)
    for path in names(folder, 0).values():
        must_be_writable(path)
    with _print_findings_on_error(read):
        made = plan(read, settings, observe=writing.watch.observe, all_parts=all_parts)
    from stopgo.mission.files.plan_svg import FloorsOnPaper

    bodies = standing_bodies(floor, options_of(settings))
    common = None if made.divided is None else FloorsOnPaper(several=True)
    floors, unwanted = common or FloorsOnPaper(several=False), list[Path]()
    with replacement() as files:
        reports = [
            _write_part(made, number, _PlaceOfPart(folder, files, unwanted), writing, bodies, floors)
            for number in range(len(made.parts))
        ]
        with alone_in(folder):
            files.replace()
            for path in unwanted:
                set_aside_file(path)
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
"""The files of a part in the order in which they appear: its mission when all else is there."""


MANY = 200
"""Stops from which a process of its own draws the set of sheets, or the picture if one draws the recording.

The sheets of 99 780 m² would take 300 MB there.
"""


@dataclass(frozen=True)
class _PlaceOfPart:
    """Place of the files of a part: they appear together with those of all parts."""

    folder: Path
    files: Replacement
    unwanted: list[Path]
    """Files of an earlier plan that this one does not have; parts add theirs."""


def _write_part(
    plan: Plan,
    number: int,
    place: _PlaceOfPart,
    writing: _Writing,
    bodies: Sequence[StandingBody],
    floors: FloorsOnPaper,
) -> PlanReport:
    """Write the plan of one part next to the files that it will replace."""
    from stopgo.planner.checking.model_clearance import too_near
    from stopgo.planner.commands.outputs import names
    from stopgo.planner.commands.plan_report import PlanReport

    files = names(place.folder, number)
    part, is_last = _revised(plan.parts[number], files["mission"]), number == len(plan.parts) - 1
    recording = _recording(part, plan, writing.recorder, more=plan.divided is not None and not is_last)
    if recording is None:
        del files["recording"]
    watch = writing.watch
    contents = _PartContents(part, plan, writing.options, _today(), floors, _seen_from(part, watch))
    if is_last:
        _forget_derived(part)
    unwanted = [files.pop("picture")] if plan.divided and number else []
    beside = "picture" if writing.recorder.is_running else "sheets"
    data = contents.made(files, beside=beside if len(part.mission.stops) >= MANY else None)
    unwanted += [] if "sheets" in data else [files.pop("sheets")]
    keys = [key for key in WRITTEN if key in files]
    with place.files.filled(*(files[key] for key in keys)) as paths:
        written = dict(zip(keys, paths, strict=True))
        for key, content in data.items():
            written[key].write_bytes(content)
        watch.lap("files")
        if recording is not None:
            recording.write(written["recording"])
        watch.lap("recording")
    place.unwanted.extend(unwanted)
    near = tuple(too_near(part.mission, bodies, plan.settings))
    return PlanReport(part=part, files=files, times_s=watch.times(), too_near=near, surface=contents.surface)


def _today() -> str:
    return datetime.date.today().isoformat()


def _revised(part: PartPlan, path: Path) -> PartPlan:
    """The part's plan, its mission with the revision that replaces the file at `path`."""
    from msgspec.structs import replace as changed

    from stopgo.mission.document import with_digest
    from stopgo.mission.files.mission_json import next_revision

    revision = next_revision(path, part.mission)
    return replace(part, mission=with_digest(changed(part.mission, revision=revision)))


def _recording(part: PartPlan, plan: Plan, recorder: RecordingProcess, *, more: bool) -> PlanDrawing | None:
    """The recording of a part, while it is drawn; None, and a line on stderr, if Rerun is not installed."""
    if not recorder.is_running:
        try:
            import stopgo.recordings.plan  # noqa: F401  refused now, not when all else is written
        except ModuleNotFoundError as error:
            report_missing_rerun(error, "plan.rrd")
            return None
    from stopgo.mission.document.schedule import schedule
    from stopgo.mission.stages.sight import sight_of

    mission = part.mission
    totals = None if plan.divided is None else plan.whole.totals
    sight = sight_of(part.route, mission, part.figures, totals)
    return recorder.draw(mission.id, (*part.stage_results(), mission, schedule(mission), sight), more=more)


def _seen_from(part: PartPlan, watch: Stopwatch) -> SeenSurface | None:
    """Area that the stops of a part see; None for a floor whose heights are not known."""
    from stopgo.planner.checking.seen_surface import seen_surface

    found = seen_surface(part.route)
    watch.lap("surface")
    return found


def _forget_derived(part: PartPlan) -> None:
    """Forget what the stages derived from one another, which no file needs: half of the memory."""
    for result in (part.visibility, part.candidates, part.space):
        forget_all(result)
    give_back()


@dataclass(frozen=True, eq=False)
class _PartContents:
    """Contents of the files of one part of a plan."""

    part: PartPlan
    plan: Plan
    options: PrintOptions
    date: str
    floors: FloorsOnPaper
    surface: SeenSurface | None = None

    def made(self, files: Mapping[str, Path], *, beside: str | None) -> dict[str, bytes]:
        """The contents of these files; those of the one `beside` are made in a process of its own.

        They are made from many short words, whose memory is given back.
        """
        found = {}
        with (
            SideWork(self.printed, forked=beside == "sheets") as printing,
            SideWork(self.picture, forked=beside == "picture" and "picture" in files) as drawing,
        ):
            for key in ("coverage", "mission"):
                found[key] = getattr(self, key)()
                give_back()
            found |= self.sheets(files["sheets"], printing)
            if "picture" in files:
                found["picture"] = drawing.result()
                give_back()
        return found

    def printed(self) -> bytes | None:
        """The set of sheets, if it is wanted."""
        from stopgo.mission.files.plan_sheets import needs_sheets, plan_pdf

        part, wanted, rings = self.part, self.options.sheets, self.options.rings
        if wanted is False or not (wanted or needs_sheets(part.route, part.mission)):
            return None
        return plan_pdf(
            part.route, part.mission, part.figures, date=self.date, with_range=rings, floors=self.floors
        )

    def sheets(self, path: Path, printing: SideWork[bytes | None]) -> dict[str, bytes]:
        """The set of sheets; without one nothing, and a line on stderr if reportlab is not installed."""
        try:
            found = printing.result()
        except ModuleNotFoundError as error:
            if self.options.sheets or not is_missing(error, "reportlab"):
                raise
            problem = "not written, reportlab is not installed"
            typer.echo(f'{path.name}: {problem}; pip install "stopgo[plan]"', err=True)
            return {}
        return {} if found is None else {"sheets": found}

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
            floors=self.floors,
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

    def __init__(self, step: RunningStep, also: Callable[[object], None]) -> None:
        self._laps: dict[str, float] = {}
        self._begin = self._last = time.perf_counter()
        self._step = step
        self._also = also

    def observe(self, result: object) -> None:
        """Count the time since the last result to the stage that ends with this one."""
        give_back()
        ended, begins = STAGES.get(type(result).__name__, ("other", "files"))
        self.lap(ended)
        self._step.begin(begins)
        self._also(result)

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self._laps[stage] = self._laps.get(stage, 0.0) + now - self._last
        self._last = now

    def times(self) -> dict[str, float]:
        """Seconds per stage and in total."""
        return {**self._laps, "total": time.perf_counter() - self._begin}
