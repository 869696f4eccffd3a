"""`stopgo plan`: a floor's file in, a mission with its picture, coverage and recording out; `stopgo demo`."""

from __future__ import annotations

import datetime
import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.commands.floor_commands import add_floor_commands
from stopgo.mission.errors import InputError, OutcomeUnknown, StopgoError

if TYPE_CHECKING:
    from stopgo.bridge.station.station import Station
    from stopgo.mission.comparing.comparison import Comparison
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.mission.document import Mission
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.plan import PartPlan, Plan
    from stopgo.mission.proof.plan_proof import PlanProof
    from stopgo.mission.settings import Settings
    from stopgo.planner.commands.plan_report import PlanReport
    from stopgo.recordings.plan import PlanRecording

EXAMPLE_PROOF = "Example: stopgo prove plan/mission.json --floor floor.dxf"
EXAMPLE = "Example: stopgo plan floor.dxf -o plan --range 8 --start 2.5,3.0,90"


def add_commands(app: typer.Typer) -> None:
    """Add this folder's verbs to the front door."""
    from stopgo.planner.commands.options import with_options

    app.command(name="plan", epilog=EXAMPLE)(with_options(plan_command))
    add_floor_commands(app)
    app.command(name="prove", epilog=EXAMPLE_PROOF)(prove_command)
    app.command(name="demo", epilog="Example: stopgo demo -o recordings/demo")(demo_command)


def plan_command(
    floor: Annotated[
        Path | None,
        typer.Argument(
            help="The floor: a .dxf, layered or as drawn; an .ifc or .ifczip; a map.yaml.", show_default=False
        ),
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(),
    parameters: Annotated[
        Path | None, typer.Option("-p", "--parameters", help="plan.toml; options override it.")
    ] = None,
    *,
    all_parts: Annotated[bool, typer.Option(help="Also plan parts not connected with the first.")] = False,
    all_storeys: Annotated[
        bool, typer.Option(help="Plan every storey of a model that people walk on, each into its folder.")
    ] = False,
    strict: Annotated[
        bool, typer.Option(help="Exit 1 if floor is left out or the plan is doubtful.")
    ] = False,
    sheets: Annotated[
        bool | None,
        typer.Option(
            "--sheets/--no-sheets",
            help="plan.pdf: sheets and lists to print; by default where 1:100 needs several sheets.",
        ),
    ] = None,
    rings: Annotated[bool, typer.Option(help="Draw the scanner's range round each stop.")] = False,
    print_config: Annotated[bool, typer.Option(help="Print plan.toml with these options and leave.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    **given: Any,
) -> int:
    """Plan where the scanner must stand on a floor, and the route that visits those stops.

    Exit code 1: no plan can be made, or the robot would drive over lines that were not read; with --strict
    also where floor is left out or the plan is doubtful.
    """
    from stopgo.mission.files.plan_toml import read_settings, settings_json, settings_toml
    from stopgo.planner.commands.options import values_of

    settings = read_settings(parameters, values_of(given))
    if print_config:
        typer.echo(json.dumps(settings_json(settings)) if as_json else settings_toml(settings))
        return 0
    if floor is None:
        raise InputError("no floor given; name a file, such as: stopgo plan floor.dxf -o plan")
    if all_storeys:
        from stopgo.planner.commands.storeys import plan_storeys

        one = partial(_plan_storey, all_parts=all_parts, strict=strict, printed=Printed(sheets, rings))
        return plan_storeys(floor, _folder(out), settings, one, as_json=as_json)
    reports = plan_files(floor, out, settings, all_parts=all_parts, printed=Printed(sheets, rings))
    _print(reports, as_json=as_json)
    return max(report.strict_answer if strict else report.answer for report in reports)


@dataclass(frozen=True)
class Printed:
    """What is drawn for the printer."""

    sheets: bool | None = None
    """A set of sheets; None: where one sheet cannot show the floor at a readable scale."""
    rings: bool = False


def _plan_storey(
    floor: Path, folder: Path, settings: Settings, *, all_parts: bool, strict: bool, printed: Printed
) -> tuple[int, str, list[dict[str, Any]]]:
    """Plan one storey, in whatever process: its exit code, what a person reads, and what `--json` tells."""
    try:
        reports = plan_files(floor, folder, settings, all_parts=all_parts, printed=printed)
    except StopgoError as error:
        return error.exit_code, str(error), []
    code = max(report.strict_answer if strict else report.answer for report in reports)
    return code, "\n".join(r.as_text() for r in reports), [r.as_json() for r in reports]


def _print(reports: list[PlanReport], *, as_json: bool) -> None:
    if not as_json:
        from stopgo.mission.console.table import printable_lines

        typer.echo(printable_lines("\n".join(report.as_text() for report in reports)))
        return
    told = reports[0].as_json()
    if len(reports) > 1:
        told["parts"] = [report.as_json() for report in reports[1:]]
    typer.echo(json.dumps(told, ensure_ascii=False))


def plan_files(
    floor: Path, out: Path, settings: Settings, *, all_parts: bool = False, printed: Printed | None = None
) -> list[PlanReport]:
    """Plan a floor's file into a folder; one report per part, the main part first."""
    from stopgo.mission.files.atomic import must_be_writable
    from stopgo.planner import plan
    from stopgo.planner.commands.outputs import names
    from stopgo.planner.floors import options_of, read_floor

    watch = Stopwatch()
    read = read_floor(floor, options_of(settings))
    folder = _folder(out)
    for path in names(folder, 0).values():
        must_be_writable(path)
    with _telling_findings(read):
        made = plan(read, settings, observe=watch.observe, all_parts=all_parts)
    parts = enumerate(made.parts)
    reports = [_write_part(part, folder, number, watch, printed or Printed(), made) for number, part in parts]
    _set_aside(folder, len(reports), read, settings)
    if made.divided is None:
        return reports
    from stopgo.planner.commands.shared_report import shared_report

    return [shared_report(made.divided, reports)]


@contextmanager
def _telling_findings(floor: FloorPlan) -> Iterator[None]:
    """Where no plan can be made, what was odd about the drawing may say why: told on stderr."""
    from stopgo.mission.floor import Rank
    from stopgo.planner.commands.plan_report import finding_lines

    try:
        yield
    except StopgoError:
        by_rank = sorted((item for item in floor.findings if item.rank != Rank.NOTE), key=lambda f: f.rank)
        for line in finding_lines(by_rank):
            typer.echo(line.strip(), err=True)
        raise


def _set_aside(folder: Path, parts: int, floor: FloorPlan, settings: Settings) -> None:
    from stopgo.planner.commands.outputs import set_aside

    moved = set_aside(folder, parts, floor.source, settings)
    if moved:
        told = f"{folder}: of another plan, renamed so that nobody drives it: "
        typer.echo(f"{told}{', '.join(path.name for path in moved)}", err=True)


def _folder(out: Path) -> Path:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{out}: cannot be made a folder ({error.strerror}); choose another with -o"
        ) from None
    return out


def _write_part(
    part: PartPlan, folder: Path, number: int, watch: Stopwatch, printed: Printed, plan: Plan
) -> PlanReport:
    """Write the plan of one part; its files appear together, mission.json last."""
    from dataclasses import replace

    from stopgo.mission.document.schedule import schedule
    from stopgo.mission.files.atomic import replacing
    from stopgo.mission.files.coverage_json import coverage_json
    from stopgo.mission.files.mission_json import encode
    from stopgo.mission.files.plan_svg import plan_svg
    from stopgo.mission.stages.sight import sight_of
    from stopgo.planner.commands.outputs import names, set_aside_file
    from stopgo.planner.commands.plan_report import PlanReport

    files = names(folder, number)
    mission = _revised(part.mission, files["mission"])
    recording = _recording(mission.id)
    if recording is None:
        del files["recording"]
    today = datetime.date.today().isoformat()
    sheets = _sheets(part, mission, printed, today, files["sheets"])
    unwanted = [files.pop("sheets")] if sheets is None else []
    unwanted += [files.pop("picture")] if plan.divided and number else []
    with replacing(*(files[key] for key in WRITTEN if key in files)) as (
        *others,
        document,
    ):
        written = dict(zip((key for key in WRITTEN if key in files), others, strict=False))
        if recording is not None:
            sight = sight_of(part.route, mission, part.figures)
            for noun in (*part.nouns(), mission, schedule(mission), sight):
                recording.observe(noun)
            recording.write(written["recording"])
        watch.lap("recording")
        if sheets is not None:
            written["sheets"].write_bytes(sheets)
        written["coverage"].write_bytes(coverage_json(part.route, mission, part.figures))
        if "picture" in written:
            shown = part if plan.divided is None else plan.divided.whole
            its = mission if plan.divided is None else shown.mission
            drawn = plan_svg(
                shown.route, its, shown.figures, plan.shared, date=today, with_range=printed.rings
            )
            written["picture"].write_bytes(drawn)
        document.write_bytes(encode(mission))
    for path in unwanted:
        set_aside_file(path)
    watch.lap("files")
    return PlanReport(part=replace(part, mission=mission), files=files, times_s=watch.times())


def _recording(recording_id: str) -> PlanRecording | None:
    """Takes the nouns of a plan; None, with a line that says so, where recordings are not installed."""
    try:
        from stopgo.recordings.plan import PlanRecording
    except ModuleNotFoundError as error:
        _told_without_rerun(error, "plan.rrd")
        return None
    return PlanRecording(recording_id)


def _sheets(part: PartPlan, mission: Mission, printed: Printed, date: str, path: Path) -> bytes | None:
    """The set of sheets, if it is wanted; None, with a line that says so, where PDFs are not installed."""
    from stopgo.mission.files.plan_sheets import needs_sheets, plan_pdf

    if printed.sheets is False or not (printed.sheets or needs_sheets(part.route, mission)):
        return None
    try:
        return plan_pdf(part.route, mission, part.figures, date=date, with_range=printed.rings)
    except ModuleNotFoundError as error:
        if printed.sheets or (error.name or "").partition(".")[0] != "reportlab":
            raise
        typer.echo(
            f'no {path.name}: reportlab is not installed; pip install "stopgo[plan]" brings it', err=True
        )
        return None


WRITTEN = ("recording", "sheets", "coverage", "picture", "mission")
"""A plan's files in the order in which they appear: the mission when all else is there."""


def _revised(mission: Mission, path: Path) -> Mission:
    """The mission with the revision that replaces what is at `path`."""
    from msgspec.structs import replace

    from stopgo.mission.document import sealed
    from stopgo.mission.files.mission_json import next_revision

    return sealed(replace(mission, revision=next_revision(path, mission)))


STAGES = {
    "FloorPlan": "read",
    "NavigableSpace": "navigable",
    "Candidates": "candidates",
    "Visibility": "visibility",
    "Selection": "selection",
    "Route": "route",
    "Figures": "figures",
    "Mission": "route",
}
"""The stage that ends with each noun."""


class Stopwatch:
    """Seconds per stage; tells on a terminal's stderr which stage has ended."""

    def __init__(self) -> None:
        self._laps: dict[str, float] = {}
        self._begin = self._last = time.perf_counter()

    def observe(self, noun: object) -> None:
        """Count the time since the last noun to the stage that ends with this one."""
        self.lap(STAGES.get(type(noun).__name__, "other"))

    def lap(self, stage: str) -> None:
        """Count the time since the last lap to a stage."""
        now = time.perf_counter()
        self._laps[stage] = self._laps.get(stage, 0.0) + now - self._last
        self._last = now
        if sys.stderr.isatty():
            typer.echo(f"\r\033[K{stage} done, {now - self._begin:.1f} s", err=True, nl=stage == "files")

    def times(self) -> dict[str, float]:
        """Seconds per stage and in all."""
        return {**self._laps, "total": time.perf_counter() - self._begin}


def prove_command(
    mission: Annotated[Path, typer.Argument(metavar="MISSION", help="A mission.json.")],
    floor: Annotated[Path, typer.Option(help="The floor that it was planned on.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for the results; else beside the mission.")
    ] = None,
    coverage: Annotated[
        Path | None, typer.Option(help="The mission's coverage.json; else the one beside it, if there is.")
    ] = None,
    *,
    step: Annotated[
        float | None,
        typer.Option(
            min=0.005,
            max=2.0,
            help="Between neighbouring rays, degrees.",
            show_default="the scanner's, else 0.1",
        ),
    ] = None,
    noise: Annotated[float, typer.Option(min=0.0, max=100.0, help="Of a distance, mm rms.")] = 2.0,
    height: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=10.0, help="Scanner above the floor, m.", show_default="the scanner's, else 1.3"
        ),
    ] = None,
    ceiling: Annotated[
        float | None,
        typer.Option(min=0.5, max=50.0, help="Height of the walls, m.", show_default="the model's, else 2.7"),
    ] = None,
    slant: Annotated[
        bool, typer.Option("--slant", help="The range counts along the rays, not along the floor.")
    ] = False,
    without_poses: Annotated[
        bool, typer.Option("--without-poses", help="Register without the robot's poses to start from.")
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of noise and pose errors.")] = 1,
    strict: Annotated[bool, typer.Option(help="Exit 1 also where the scans do not all join.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """Prove by simulation what a mission promises: scan the floor from its stops, measure, and register.

    Casts the scanner's rays at the floor raised to its walls' height, counts the points on every target, and
    registers the scans pair by pair. Writes proof.json, proof.rrd and proof.html.

    Exit code 1: the plan promises more than the simulated scans show; with --strict also where these do not
    all join.
    """
    from stopgo.mission.console.table import printable
    from stopgo.mission.files.atomic import must_be_writable
    from stopgo.mission.proof.proof_text import proof_json, proof_text
    from stopgo.planner.scan_simulation.verification_files import verification_files, verify_file

    folder = mission.parent if out is None else _folder(out)
    files = verification_files(folder, mission)
    for path in files.values():
        must_be_writable(path)
    assumed = {"noise_m": noise / 1000, "slant": slant}
    assumed |= {"poses": not without_poses, "seed": seed}
    given = {"step_deg": step, "height_m": height, "ceiling_m": ceiling}
    heights = {key: value for key, value in given.items() if value is not None}
    warnings: list[str] = []
    proof, planned = verify_file(
        mission, floor, coverage, {**assumed, **heights}, say=_progress, warn=warnings.append
    )
    _progress("")
    for warning in warnings:
        typer.echo(f"stopgo: {printable(warning)}", err=True)
    written = _write_proof(proof, planned.floor, files)
    if as_json:
        told = {**proof_json(proof), "files": {key: str(path) for key, path in written.items()}}
        typer.echo(json.dumps(told, ensure_ascii=False))
    else:
        typer.echo(proof_text(proof))
        for key, path in written.items():
            typer.echo(f"{key:12}{printable(str(path))}")
    return 0 if proof.met and (proof.network.closed or not strict) else 1


def _write_proof(proof: PlanProof, floor: FloorPlan, files: dict[str, Path]) -> dict[str, Path]:
    """Write a proof; its files appear together, proof.json last. Those that were written."""
    from stopgo.mission.files.atomic import replacing
    from stopgo.mission.files.mission_text import json_text
    from stopgo.mission.proof.proof_text import proof_json

    try:
        from stopgo.recordings.page.proof_page import proof_html
        from stopgo.recordings.plan.proof_recording import proof_recording
    except ModuleNotFoundError as error:
        _told_without_rerun(error, "proof.rrd and no proof.html")
        files = {"proof": files["proof"]}
    with replacing(*files.values()) as (*pictures, document):
        if pictures:
            pictures[0].write_bytes(proof_recording(proof, floor))
            pictures[1].write_bytes(proof_html(proof, floor))
        document.write_text(f"{json_text(proof_json(proof))}\n", encoding="utf-8")
    return files


def _told_without_rerun(error: ModuleNotFoundError, name: str) -> None:
    """Say that a recording is left out for want of Rerun; anything else that is missing is an error."""
    if (error.name or "").partition(".")[0] != "rerun":
        raise error
    typer.echo(f'no {name}: rerun is not installed; pip install "stopgo[record]" brings it', err=True)


def _progress(line: str) -> None:
    """One line that changes, on a terminal's stderr."""
    if sys.stderr.isatty():
        typer.echo(f"\r\033[K{line}", err=True, nl=False)


def demo_command(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results.")] = Path(
        "recordings/demo"
    ),
    speed_up: Annotated[
        float, typer.Option(min=0.01, max=1000, help="The simulated robot's time goes this much faster.")
    ] = 60.0,
) -> int:
    """Plan a sample office, send the mission to a simulated robot in its own process, and follow its run."""
    import tempfile
    from importlib.resources import as_file, files

    from stopgo.bridge.commands.spawn import robot_process
    from stopgo.bridge.station.station import connect
    from stopgo.mission.files.plan_toml import read_settings

    with as_file(files("stopgo.recordings") / "samples" / "office.dxf") as floor:
        report = plan_files(floor, out, read_settings(None, {}))[0]
    typer.echo(report.as_text())
    with (
        tempfile.TemporaryDirectory() as state,
        robot_process("demo", Path(state), speed_up=speed_up) as endpoint,
    ):
        typer.echo(
            f"\nrobot demo listens on {endpoint} in a process of its own, {speed_up:g} times faster than time"
        )
        with connect(endpoint, robot="demo") as station:
            station.push(report.mission)
            typer.echo(f"pushed mission {report.mission.id}, read back from the robot")
            station.command("start")
            heard, ended = _follow(station, report, out / "field.rrd")
    compared = heard.compared()
    if compared is None:
        raise OutcomeUnknown("demo: the run ended and told nothing")
    return _say_demo(compared, ended, out)


def _follow(station: Station, report: PlanReport, path: Path) -> tuple[RunCollector, str]:
    """Record the run to its end; what was told of it, and the state it ended in."""
    from stopgo.bridge.station.watch import watch_run
    from stopgo.mission.comparing.run_collector import RunCollector
    from stopgo.mission.stages.sight import sight_of
    from stopgo.recordings.embedded.reading import read_recording
    from stopgo.recordings.runs.field import FieldRecording

    plan = read_recording(report.files["recording"])
    with FieldRecording(
        path, report.mission, plan=plan, say=lambda line: typer.echo(line, err=True)
    ) as record:
        heard = RunCollector(record, [sight_of(report.part.route, report.mission, report.figures)])
        heard.mission(report.mission)
        last = watch_run(station, heard, say=lambda line: typer.echo(f"  {line}", err=True))
    return heard, last.state


def _say_demo(comparison: Comparison, ended: str, out: Path) -> int:
    from stopgo.mission.comparing.comparison_text import comparison_text
    from stopgo.mission.comparing.run_verdict import judge

    typer.echo(f"\n{comparison_text(comparison)}\n")
    typer.echo(f"run {comparison.run_id} {ended}")
    typer.echo(f"look at it: rerun {out / 'plan.rrd'} {out / 'field.rrd'}")
    return judge(comparison).exit_code if ended == "FINISHED" else 1
