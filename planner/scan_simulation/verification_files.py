"""Mission file + floor file -> verification result, with its assumptions and its output files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from stopgo.mission.document import Mission
from stopgo.mission.document.limits import blind_cone_deg, scanner_height
from stopgo.mission.document.problems import problems_of
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import Coverage, read_coverage
from stopgo.mission.files.mission_json import read
from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.proof.plan_proof import PlanProof, Simulation
from stopgo.planner.checking.claims import stated_fractions
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, planned_floor
from stopgo.planner.scan_simulation.verification import verify

NAMES = {"recording": "proof.rrd", "page": "proof.html", "proof": "proof.json"}
"""The result's files in the order in which they are written."""


def verification_files(folder: Path, mission: Path) -> dict[str, Path]:
    """Paths of a mission's verification files: proof-2.json for mission-2.json, and so on."""
    part = _part_of(mission)
    paths = {key: folder / name for key, name in NAMES.items()}
    return {key: path.with_name(f"{path.stem}{part}{path.suffix}") for key, path in paths.items()}


def _part_of(mission: Path) -> str:
    """Suffix of a mission's file name; for a file of another name, that whole name."""
    stem = mission.stem
    return stem.removeprefix("mission") if stem.startswith("mission") else f"-{stem}"


def verify_file(
    path: Path,
    floor: Path,
    coverage: Path | None,
    assumed: dict[str, Any],
    *,
    say: Callable[[str], None] = lambda line: None,
    warn: Callable[[str], None] = lambda line: None,
) -> tuple[PlanProof, PlannedFloor]:
    """Verify a mission's file by simulation; `assumed` are fields of Simulation.

    Returns the result and the floor. `say` receives progress, `warn` each reason for a weaker result.

    Raises
    ------
    NegativeResult
        If the mission is invalid or has no stops, or coverage.json has a fraction that they do not see.
    InputError
        If a file cannot be read, or the floor or coverage.json belongs to another mission.
    """
    mission = read(path)
    for problem in problems_of(mission)[:1]:
        raise NegativeResult(f"{path}: {problem} (stopgo check {path} lists all)")
    planned = planned_floor(floor, mission)
    simulation = Simulation(range_m=mission.scanner.range, fov_deg=mission.scanner.fov_deg)
    simulation = replace(_as_modelled(simulation, planned), **assumed)
    if "ceiling_m" in assumed:
        simulation = replace(simulation, ceiling_known=False)
    if "step_deg" in assumed:
        simulation = replace(simulation, step_known=True)
    if simulation.height_m >= simulation.ceiling_m:
        raise InputError(
            f"--scanner-height {simulation.height_m:g}: not below the ceiling at "
            f"{simulation.ceiling_m:g} m; lower the scanner or give --ceiling"
        )
    model = _model(planned, floor, simulation)
    found = _coverage(path, coverage, mission, warn)
    _check_fractions(mission, planned, found)
    return verify(mission, planned.space, simulation, found, say, model=model), planned


def _check_fractions(mission: Mission, planned: PlannedFloor, coverage: Coverage | None) -> None:
    """Refuse a coverage.json with a coverage that the stops do not have: it would count as simulated."""
    if coverage is not None and mission.stops:
        for problem in islice(stated_fractions(mission, planned.space, coverage), 1):
            raise NegativeResult(f"{problem} (stopgo check --floor --coverage-file lists all)")


def _model(planned: PlannedFloor, floor: Path, simulation: Simulation) -> ModelSolids | None:
    """The model's solids, if rays are to be cast at these."""
    if simulation.solids != "model":
        return None
    model = planned.floor.solids
    if model is None:
        way_out = "leave --solids model out, or plan a drawing with its --heights"
        raise InputError(f"{floor}: has no solids; {way_out}")
    return model


def _as_modelled(simulation: Simulation, planned: PlannedFloor) -> Simulation:
    """The simulation with the scanner of the plan's settings and the ceiling of the floor's model."""
    settings, ceiling = planned.settings, planned.floor.ceiling_m
    known: dict[str, Any] = {
        "step_deg": settings.angular_step,
        "near_m": settings.near,
        "noise_m": None if settings.range_noise is None else settings.range_noise / 1000,
    }
    simulation = replace(
        simulation,
        height_m=scanner_height(settings),
        cone_deg=blind_cone_deg(settings),
        joining_m=max(settings.farthest_overlap, simulation.range_m),
        step_known=settings.angular_step is not None,
        **{name: value for name, value in known.items() if value is not None},
    )
    return simulation if ceiling is None else replace(simulation, ceiling_m=ceiling, ceiling_known=True)


def _coverage(
    path: Path, given: Path | None, mission: Mission, warn: Callable[[str], None]
) -> Coverage | None:
    """The given coverage.json; else the one next to the mission, if it is valid and belongs to it."""
    if given is not None:
        return read_coverage(given, mission)
    found = path.with_name(f"coverage{_part_of(path)}.json")
    if not found.is_file():
        return None
    try:
        return read_coverage(found, mission)
    except InputError as error:
        warn(f"{error}; only the mission's counts are compared with the scans")
        return None
