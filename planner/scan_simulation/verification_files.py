"""A mission's file and its floor's -> the proof: what is read, taken for granted, and where it is written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from stopgo.mission.document import Mission
from stopgo.mission.document.limits import scanner_height
from stopgo.mission.document.problems import problems_of
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import Coverage, read_coverage
from stopgo.mission.files.mission_json import read
from stopgo.mission.proof.plan_proof import PlanProof, Simulation
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, planned_floor
from stopgo.planner.scan_simulation.verification import prove

NAMES = {"recording": "proof.rrd", "page": "proof.html", "proof": "proof.json"}
"""A proof's files in the order in which they appear."""


def proof_files(folder: Path, mission: Path) -> dict[str, Path]:
    """Where the proof of a mission is written: of mission-2.json as proof-2.json and so on."""
    part = _part_of(mission)
    paths = {key: folder / name for key, name in NAMES.items()}
    return {key: path.with_name(f"{path.stem}{part}{path.suffix}") for key, path in paths.items()}


def _part_of(mission: Path) -> str:
    """What a mission's file adds to the name; of a file of another name, that name."""
    stem = mission.stem
    return stem.removeprefix("mission") if stem.startswith("mission") else f"-{stem}"


def prove_file(
    path: Path,
    floor: Path,
    coverage: Path | None,
    assumed: dict[str, Any],
    *,
    say: Callable[[str], None] = lambda line: None,
    warn: Callable[[str], None] = lambda line: None,
) -> tuple[PlanProof, PlannedFloor]:
    """The proof of a mission's file, and the floor it is about; `assumed` are fields of Simulation.

    `say` is told how far it is, `warn` what makes it prove less.

    Raises
    ------
    AnswerIsNo
        When the mission makes no sense, or has no stops.
    InputError
        When a file cannot be read, or the floor or coverage.json is another mission's.
    """
    mission = read(path)
    for problem in problems_of(mission)[:1]:
        raise NegativeResult(f"{path}: {problem} (stopgo check {path} lists all)")
    planned = planned_floor(floor, mission)
    simulation = Simulation(range_m=mission.scanner.range, fov_deg=mission.scanner.fov_deg)
    simulation = replace(_as_modelled(simulation, planned), **assumed)
    if "ceiling_m" in assumed:
        simulation = replace(simulation, ceiling_known=False)
    if simulation.height_m >= simulation.ceiling_m:
        raise InputError(
            f"--height {simulation.height_m:g}: the scanner must be below the ceiling at "
            f"{simulation.ceiling_m:g} m; give --ceiling"
        )
    return prove(mission, planned.space, simulation, _coverage(path, coverage, mission, warn), say), planned


def _as_modelled(simulation: Simulation, planned: PlannedFloor) -> Simulation:
    """With what the plan's settings tell of the scanner, and the floor's model of the ceiling."""
    settings, ceiling = planned.settings, planned.floor.ceiling_m
    known: dict[str, Any] = {
        "step_deg": settings.angular_step,
        "near_m": settings.near,
        "cone_deg": settings.blind_cone,
    }
    simulation = replace(
        simulation,
        height_m=scanner_height(settings),
        joining_m=max(settings.farthest_overlap, simulation.range_m),
        **{name: value for name, value in known.items() if value is not None},
    )
    return simulation if ceiling is None else replace(simulation, ceiling_m=ceiling, ceiling_known=True)


def _coverage(
    path: Path, given: Path | None, mission: Mission, warn: Callable[[str], None]
) -> Coverage | None:
    """The coverage.json that is given; else the one beside the mission, if it is the mission's and whole."""
    if given is not None:
        return read_coverage(given, mission)
    beside = path.with_name(f"coverage{_part_of(path)}.json")
    if not beside.is_file():
        return None
    try:
        return read_coverage(beside, mission)
    except InputError as error:
        warn(f"{error}; without it only the mission's counts are held against the scans")
        return None
