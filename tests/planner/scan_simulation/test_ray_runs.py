"""Runs of rays that meet the same surface: as if every ray had been cast."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stopgo.mission.floor import Element
from stopgo.mission.geometry import Polygon
from stopgo.mission.proof.plan_proof import Simulation
from stopgo.planner.scan_simulation.casting import RayFan, SolidScene
from stopgo.planner.scan_simulation.extrusion import NONE, ExtrudedFloor, extruded
from tests.faults.sizes import size
from tests.planner.worlds import column, element, hall

SIMULATION = Simulation(range_m=10.0, step_deg=0.5)
CEILING = 2.7


def furnished(seed: int) -> list[Element]:
    """Elements of many kinds at random angles, some through one another, one on another's surface."""
    random = np.random.default_rng(seed)
    found = [column("flush", 3.0, 0.2), column("doubled", 3.1, 0.2)]
    for number, kind in enumerate(("walls", "beams", "windows", "railings", "beams", "walls")):
        middle, half = random.uniform((1.0, 1.0), (5.0, 3.0)), random.uniform(0.02, 0.8, 2)
        turn = np.linalg.qr(random.normal(size=(2, 2)))[0]
        ring = middle + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half @ turn
        heights = tuple(np.sort(random.uniform(0, CEILING, 2))) if number % 2 else None
        found.append(replace(element(kind + str(number), kind, Polygon.of(ring)), heights=heights))
    return found


def kinds_of(solids: ExtrudedFloor, met: np.ndarray) -> np.ndarray:
    """Face, height and underside of the triangles met: what makes them different surfaces for a scan."""
    height = np.where(solids.face == NONE, solids.corners[:, 0, 2], np.nan)
    return np.stack([np.append(item, NONE)[met] for item in (solids.face, height, solids.under != NONE)])


@pytest.mark.parametrize("seed", range(size(short=2, full=4)))
@pytest.mark.parametrize("fov", [360.0, 100.0])
@pytest.mark.parametrize("see_through", [False, True])
def test_every_ray_of_a_run_meets_the_surface_of_the_one_that_is_cast(
    seed: int, fov: float, see_through: bool
) -> None:
    random = np.random.default_rng(seed)
    solids = extruded(hall(6, 4, *furnished(seed)), [np.array([(5.0, 0.0), (5.0, 4.0)])], CEILING)
    place = np.append(random.uniform((0.5, 0.5), (5.5, 3.5)) - solids.origin, 1.3)
    scene = SolidScene(solids, place, see_through=see_through, open_door=NONE)
    fan = RayFan.of(replace(SIMULATION, fov_deg=fov), random.uniform(0, 6.0))
    for block in fan.blocks():
        runs = scene.runs(fan, block)
        every = scene.cast(fan.directions(block)).ravel()
        np.testing.assert_array_equal(kinds_of(solids, runs.hits), kinds_of(solids, every))
        assert len(runs.start) < runs.rays / 5
