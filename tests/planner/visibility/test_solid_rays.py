"""Heights at which the solids of a model have the faces of a plan's targets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from stopgo.mission.floor.model_solids import ModelSolids
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import Settings
from stopgo.planner.space.navigable import navigable
from stopgo.planner.visibility.solid_rays import SAMPLE_M, UnitCells, _samples
from tests.planner.worlds import hall


def cells_of(*triangles: list[tuple[float, float, float]]) -> tuple[UnitCells, np.ndarray]:
    """Cells of a hall of 6 × 4 m whose model has these triangles, and the units' midpoints."""
    floor = hall()
    elements = tuple(replace(item, heights=(0.0, 3.0)) for item in floor.elements)
    solids = ModelSolids(frozen(np.array(triangles, dtype=float)), 3.0)
    space = navigable(replace(floor, elements=elements, solids=solids), Settings())
    return UnitCells.of(space, solids), space.targets.unit_xy


def test_a_gable_has_the_heights_under_its_slope() -> None:
    cells, xy = cells_of([(0, 0, 0), (6, 0, 0), (3, 0, 2.5)])
    south = np.isclose(xy[:, 1], 0)
    height = np.minimum(xy[south, 0], 6 - xy[south, 0]) * 2.5 / 3
    assert np.array_equal(cells.there[south], cells.z[south] <= height[:, None] + 1e-6)
    assert cells.upright[south].all()


@pytest.mark.parametrize("x", [3.0, 3.01])
def test_the_end_of_a_wall_across_is_no_face_of_a_unit(x: float) -> None:
    across = [(x, -1.0, 1.0), (x, 0.01, 1.0), (x, 0.01, 2.0)]
    cells, xy = cells_of([(0, 0, 0), (6, 0, 0), (6, 0, 1)], [(0, 0, 0), (6, 0, 1), (0, 0, 1)], across)
    south = np.isclose(xy[:, 1], 0)
    assert np.array_equal(cells.there[south], cells.z[south] <= 1.0)


@pytest.mark.parametrize("seed", range(4))
def test_every_point_of_a_triangle_is_near_a_sample_and_slivers_have_few(seed: int) -> None:
    random = np.random.default_rng(seed)
    shapes = random.uniform(0, 0.8, (20, 3, 3))
    sliver = np.array([[0, 0, 0], [6.0, 0.1, 0], [2.0, 0.05, 0.02]]) + random.uniform(0, 1, 3)
    for triangle in (*shapes, sliver):
        samples = np.concatenate(list(_samples(triangle[None])))
        weights = random.dirichlet((1, 1, 1), 200)
        away = np.linalg.norm((weights @ triangle)[:, None] - samples, axis=2).min(axis=1)
        assert away.max() <= SAMPLE_M
    assert len(np.concatenate(list(_samples(sliver[None])))) < 2 * 6.1 / SAMPLE_M * 3


def test_no_triangles_have_no_samples() -> None:
    assert list(_samples(np.empty((0, 3, 3)))) == []
