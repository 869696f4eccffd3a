"""Mission + floor's file -> verdict: clearances that are too small, and claims that are not met."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import Problem
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.coverage_json import Coverage
from stopgo.mission.files.plan_toml import recorded_settings
from stopgo.mission.floor import FloorPlan
from stopgo.planner.checking.claims import Recount, overclaims, recount
from stopgo.planner.checking.fit import misfits_on, other_machine
from stopgo.planner.checking.model_clearance import too_near
from stopgo.planner.checking.network_claims import network_overclaims
from stopgo.planner.checking.plan_identity import foreign_identity, unverified
from stopgo.planner.floors import options_of, read_floor, standing_bodies
from stopgo.planner.geometry.shapes import FARTHEST_STEPS, GRID, local_origin
from stopgo.planner.space.navigable import navigable


@dataclass(frozen=True, eq=False)
class Verdict:
    """Problems of a mission on a floor, and the recount of the units that its stops see there."""

    problems: tuple[Problem, ...]
    counted: Recount | None = None
    notes: tuple[str, ...] = ()
    """What the floor's file does not show, in words."""


def verdict(mission: Mission, path: Path, coverage: Coverage | None) -> Verdict:
    """Compare a mission, and its coverage.json if given, with the floor in a file.

    Raises
    ------
    InputError
        If the file cannot be read as a floor.
    """
    try:
        settings = recorded_settings(mission.origin.parameters)
    except InputError as error:
        return Verdict((Problem("$.origin.parameters", f"are not those of a plan: {error}"),))
    floor = read_floor(path, options_of(settings))
    misfits = (*other_machine(mission, settings), *misfits_on(floor, mission, settings))
    misfits = (*misfits, *too_near(mission, standing_bodies(path, options_of(settings)), settings))
    if not _is_countable(mission, floor):
        return Verdict(misfits)
    try:
        counted = recount(mission, navigable(floor, settings))
    except NegativeResult as error:
        claims = any(stop.sees.units for stop in mission.stops)
        return Verdict((*misfits, Problem("$.stops", f"see nothing: {error}")) if claims else misfits)
    space, is_own = counted.space, floor.digest == mission.origin.floor_digest
    foreign, notes = (foreign_identity(mission, space), unverified(mission, space)) if is_own else ((), ())
    overclaimed = (*overclaims(mission, counted, coverage), *network_overclaims(mission, space))
    return Verdict((*misfits, *foreign, *overclaimed), counted, tuple(notes))


def _is_countable(mission: Mission, floor: FloorPlan) -> bool:
    """True if there are stops, and all are near enough to the floor for exact lines of sight."""
    xy = np.array([(stop.x, stop.y) for stop in mission.stops]).reshape(-1, 2)
    return len(xy) > 0 and float(np.abs(xy - local_origin(floor)).max()) < GRID * FARTHEST_STEPS
