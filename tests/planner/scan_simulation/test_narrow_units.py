"""Units that fall between two columns of rays."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import msgspec
import pytest

from stopgo.mission.files.coverage_json import Coverage, coverage_json
from stopgo.mission.floor import Element
from stopgo.mission.geometry import Polygon
from stopgo.mission.plan import Plan
from stopgo.mission.proof.plan_proof import PlanProof, Simulation
from stopgo.mission.proof.proof_text import proof_text
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.scan_simulation.verification import NOT_AS_ASKED, verify
from tests.faults.sizes import some
from tests.planner.worlds import element, hall

pytestmark = pytest.mark.usefixtures("no_pairs")
COARSE = Simulation(range_m=6.0, step_deg=1.0)
SETTINGS = Settings(range=6.0, register=False, kind_coverage=0.95, coverage=0.95)


def round_column(x: float, y: float, radius: float = 0.3, sides: int = 90) -> Element:
    """A column with faces of 2 cm."""
    turns = [2 * math.pi * k / sides for k in range(sides)]
    ring = [(x + radius * math.cos(turn), y + radius * math.sin(turn)) for turn in turns]
    return element("column", "columns", Polygon.of(ring))


@cache
def planned(settings: Settings) -> Plan:
    return plan(hall(6, 4, round_column(3, 2)), settings)


def proved(settings: Settings, simulation: Simulation) -> PlanProof:
    made = planned(settings)
    told = msgspec.json.decode(coverage_json(made.route, made.mission, made.figures), type=Coverage)
    return verify(made.mission, made.space, simulation, told)


def test_without_an_angular_step_a_line_of_sight_is_what_was_promised() -> None:
    proof = proved(SETTINGS, COARSE)
    assert proof.met, proof.unmet
    assert not proof.missed
    assert proof.between_rays > 0.5
    assert f"{proof.between_rays:.1f} m lie between two rays 1° apart" in proof_text(proof)
    assert "rays every 1° (assumed)" in proof_text(proof)


def test_a_scanner_that_is_given_has_points_or_misses() -> None:
    """Between rays 1° apart, a face of 2 cm is shown by its neighbours' points only up to 3 m, square on."""
    given = proved(SETTINGS, replace(COARSE, step_known=True))
    assert not given.met
    assert set(given.missed) == {NOT_AS_ASKED}
    assert given.between_rays > 0.1


@pytest.mark.parametrize("step", some([0.6, 0.3], every=2))
def test_a_plan_that_knows_the_step_promises_points_on_every_unit(step: float) -> None:
    made = planned(replace(SETTINGS, angular_step=step))
    assert made.mission.limits.density_mm == 50.0
    proof = proved(replace(SETTINGS, angular_step=step), replace(COARSE, step_deg=step))
    assert proof.met, proof.unmet
    assert not proof.missed


def test_points_that_are_too_far_apart_stay_so_round_a_narrow_unit() -> None:
    settings = replace(SETTINGS, angular_step=0.5, density=20.0)
    assert proved(settings, replace(COARSE, step_deg=0.5)).met
    assert not proved(settings, COARSE).met
