"""Ring index: a cut of the rings around a box is the same, to the last bit, as a cut of the whole shape."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import shapely

from stopgo.planner.geometry import ring_index
from stopgo.planner.geometry.ring_index import FEW, RingIndex, areas_within, parts_within, triangles_of
from stopgo.planner.geometry.shapes import polygon_parts


@cache
def _slabs(side: int, *, angle: float) -> shapely.Geometry:
    """A slab with many holes, in some of them a block, turned."""
    holes = [shapely.box(k + 0.2, j + 0.3, k + 0.7, j + 0.6) for k in range(side) for j in range(4)]
    blocks = [shapely.box(k + 0.3, 0.4, k + 0.5, 0.5) for k in range(0, side, 3)]
    slab = shapely.difference(shapely.box(0, 0, side, 4), shapely.union_all(holes))
    whole = shapely.union_all([slab, *blocks, shapely.box(0, 6, side, 7)])
    return shapely.affinity.rotate(whole, angle, origin=(0, 0))


def _boxes(side: float) -> list[tuple[float, float, float, float]]:
    random = np.random.Generator(np.random.PCG64(5))
    return [(x, y, x + side, y + side) for x, y in random.uniform((-2, -2), (62, 30), (60, 2)).tolist()]


@pytest.mark.parametrize("angle", [0.0, 24.7])
@pytest.mark.parametrize("side", [0.4, 3.0, 40.0])
def test_a_cut_is_the_same_as_that_of_the_whole_shape(side: float, angle: float) -> None:
    whole = _slabs(60, angle=angle)
    assert shapely.get_num_coordinates(whole) > FEW
    index = RingIndex(whole)
    for bounds in _boxes(side):
        exact = shapely.MultiPolygon(polygon_parts(whole.intersection(shapely.box(*bounds))))
        assert shapely.to_wkb(index.within(bounds)) == shapely.to_wkb(exact)


def test_few_rings_are_around_a_box() -> None:
    around = RingIndex(_slabs(200, angle=0.0)).around((3.0, 1.0, 4.0, 2.0))
    assert 0 < shapely.get_num_coordinates(around) < 100


@pytest.mark.parametrize("shape", [shapely.MultiPolygon(), shapely.Polygon()])
def test_of_nothing_there_is_nothing(shape: shapely.Geometry) -> None:
    assert RingIndex(shape).within((0.0, 0.0, 1.0, 1.0)).is_empty


def test_areas_of_many_small_shapes_in_a_large_one() -> None:
    whole, cells = _slabs(60, angle=24.7), np.array([shapely.box(*bounds) for bounds in _boxes(0.9)])
    exact = shapely.area(shapely.intersection(cells, whole))
    assert exact.max() > 0.1
    assert np.allclose(areas_within(cells, whole), exact, rtol=0.0, atol=1e-12)
    assert not len(areas_within(np.empty(0, dtype=object), whole))


@pytest.mark.parametrize("angle", [0.0, 24.7])
def test_triangles_cover_a_large_polygon_once(angle: float, monkeypatch: pytest.MonkeyPatch) -> None:
    slab = max(polygon_parts(_slabs(60, angle=angle)), key=lambda part: part.area)
    monkeypatch.setattr(ring_index, "LONG", 3)
    triangles = triangles_of(slab)
    assert shapely.area(triangles).sum() == pytest.approx(slab.area)
    assert shapely.area(shapely.symmetric_difference(shapely.union_all(triangles), slab)) < 1e-9
    monkeypatch.undo()
    assert len(triangles_of(slab)) < len(triangles)


def test_parts_of_shapes_in_a_large_one_are_cut_from_its_pieces() -> None:
    whole = _slabs(60, angle=24.7)
    cells = np.array([*(shapely.box(*bounds) for bounds in _boxes(3.0)), shapely.Polygon()], dtype=object)
    parts = parts_within(cells, whole)
    assert all(part.is_empty for part in parts_within(cells[-1:], whole))
    assert shapely.area(parts) == pytest.approx(shapely.area(shapely.intersection(cells, whole)), abs=1e-9)
    assert shapely.area(parts) == pytest.approx(areas_within(cells, whole), abs=1e-9)
