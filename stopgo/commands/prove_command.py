"""`stopgo prove`: verify a mission by simulation, and write the proof, its recording and its page."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from stopgo.mission.console.running_step import running
from stopgo.mission.console.table import printable
from stopgo.mission.files.atomic import must_be_writable, replacing
from stopgo.recording_process import leave_pandas_out
from stopgo.result_files import JsonOption, report_missing_rerun, result_folder

if TYPE_CHECKING:
    from stopgo.mission.floor import FloorPlan
    from stopgo.mission.proof.plan_proof import PlanProof


class SolidsOfProof(StrEnum):
    """Solids that the rays of a proof are cast at."""

    EXTRUDED = "extruded"
    MODEL = "model"


EXAMPLE = "Example: stopgo prove plan/mission.json --floor floor.dxf"

MissionArgument = Annotated[Path, typer.Argument(metavar="MISSION", help="A mission.json.")]
FloorOption = Annotated[Path, typer.Option(help="The floor that it was planned on.")]
ProofFolderOption = Annotated[
    Path | None, typer.Option("-o", "--out", help="Folder for the results; else the mission's folder.")
]
CoverageOption = Annotated[
    Path | None,
    typer.Option(
        "--coverage-file", help="The mission's coverage.json; else the one in the mission's folder."
    ),
]
StepOption = Annotated[
    float | None,
    typer.Option(
        "--angular-step",
        min=0.005,
        max=2.0,
        rich_help_panel="Simulation",
        help="Angle between neighbouring rays, degrees.",
        show_default="the scanner's, else 0.1",
    ),
]
NoiseOption = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        max=100.0,
        rich_help_panel="Simulation",
        help="Noise of a distance, mm rms.",
        show_default="the plan's range_noise, else 2",
    ),
]
HeightOption = Annotated[
    float | None,
    typer.Option(
        "--scanner-height",
        min=0.1,
        max=10.0,
        rich_help_panel="Simulation",
        help="Height of the scanner above the floor, m.",
        show_default="the scanner's, else 1.3",
    ),
]
BlindConeOption = Annotated[
    float | None,
    typer.Option(
        "--blind-cone",
        min=0.0,
        max=170.0,
        help="Apex angle of the blind cone under the scanner, degrees.",
        show_default="the plan's, else 0",
    ),
]
CeilingOption = Annotated[
    float | None,
    typer.Option(
        min=0.5,
        max=50.0,
        rich_help_panel="Simulation",
        help="Height of the walls, m.",
        show_default="the model's, else 2.7",
    ),
]
SlantOption = Annotated[
    bool,
    typer.Option(
        "--slant", rich_help_panel="Simulation", help="The range counts along the rays, not along the floor."
    ),
]
WithoutPosesOption = Annotated[
    bool,
    typer.Option(
        "--without-poses",
        rich_help_panel="Simulation",
        help="Register without the robot's poses to start from.",
    ),
]
SeedOption = Annotated[
    int, typer.Option(min=0, rich_help_panel="Simulation", help="Seed of noise and pose errors.")
]
SolidsOption = Annotated[
    SolidsOfProof,
    typer.Option(
        rich_help_panel="Simulation",
        help="Solids that rays are cast at: the floor raised to its walls' height, or those of its model.",
    ),
]
ProofStrictOption = Annotated[bool, typer.Option(help="Exit 1 also if the scans are not all connected.")]


def add_commands(app: typer.Typer) -> None:
    """Add `prove` to the app."""
    app.command(name="prove", epilog=EXAMPLE)(prove_command)


def prove_command(
    mission: MissionArgument,
    floor: FloorOption,
    out: ProofFolderOption = None,
    coverage: CoverageOption = None,
    *,
    step: StepOption = None,
    noise: NoiseOption = None,
    height: HeightOption = None,
    blind_cone: BlindConeOption = None,
    ceiling: CeilingOption = None,
    solids: SolidsOption = SolidsOfProof.EXTRUDED,
    slant: SlantOption = False,
    without_poses: WithoutPosesOption = False,
    seed: SeedOption = 1,
    strict: ProofStrictOption = False,
    as_json: JsonOption = False,
) -> int:
    """Verify by simulation what a mission promises: scan the floor from its stops, measure, and register.

    Casts the scanner's rays at the floor raised to its walls' height, or with --solids model at the solids of
    its building model. Counts the points on every target, and registers the scans pair by pair. Writes
    proof.json, proof.rrd and proof.html.

    Exit code 1: the plan promises more than the simulated scans show; with --strict also if these are not
    all connected.
    """
    from stopgo.planner.scan_simulation.verification_files import verification_files

    files = verification_files(mission.parent if out is None else result_folder(out), mission)
    for path in files.values():
        must_be_writable(path)
    given = {"step_deg": step, "height_m": height, "cone_deg": blind_cone, "ceiling_m": ceiling}
    given |= {"noise_m": noise and noise / 1000, "slant": slant, "seed": seed, "poses": not without_poses}
    assumed = {key: value for key, value in {**given, "solids": solids.value}.items() if value is not None}
    proof, on_floor = _simulated(mission, floor, coverage, assumed)
    with running("writing the proof"):
        written = _write_proof(proof, on_floor, files)
    _print_proof(proof, written, as_json=as_json)
    return 0 if proof.met and (proof.network.closed or not strict) else 1


def _simulated(
    mission: Path, floor: Path, coverage: Path | None, assumed: dict[str, Any]
) -> tuple[PlanProof, FloorPlan]:
    """Simulate the mission's scans; returns the proof and the floor, and prints progress and warnings."""
    from stopgo.planner.scan_simulation.verification_files import verify_file

    warnings: list[str] = []
    with running(f"reading {floor}") as step:
        proof, planned = verify_file(mission, floor, coverage, assumed, say=step.begin, warn=warnings.append)
    for warning in warnings:
        typer.echo(f"stopgo: {printable(warning)}", err=True)
    return proof, planned.floor


def _write_proof(proof: PlanProof, floor: FloorPlan, files: dict[str, Path]) -> dict[str, Path]:
    """Write a proof and return the files written; they appear together, proof.json last."""
    from stopgo.mission.files.mission_text import json_text
    from stopgo.mission.proof.proof_text import proof_json

    leave_pandas_out()
    try:
        from stopgo.recordings.page.proof_page import proof_html
        from stopgo.recordings.plan.proof_recording import proof_recording
    except ModuleNotFoundError as error:
        report_missing_rerun(error, "proof.rrd, proof.html")
        files = {"proof": files["proof"]}
    with replacing(*files.values()) as (*pictures, document):
        if pictures:
            pictures[0].write_bytes(proof_recording(proof, floor))
            pictures[1].write_bytes(proof_html(proof, floor))
        document.write_text(f"{json_text(proof_json(proof))}\n", encoding="utf-8")
    return files


def _print_proof(proof: PlanProof, written: dict[str, Path], *, as_json: bool) -> None:
    from stopgo.mission.proof.proof_text import proof_json, proof_text

    if as_json:
        result = {**proof_json(proof), "files": {key: str(path) for key, path in written.items()}}
        typer.echo(json.dumps(result, ensure_ascii=False))
        return
    typer.echo(proof_text(proof))
    for key, path in written.items():
        typer.echo(f"{key:12}{printable(str(path))}")
