"""Unions of shapes: the same whether those that lie apart are united by themselves or all at once."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from stopgo.planner.geometry import shapes
from stopgo.planner.geometry.shapes import snapped_each, union, union_of_snapped


def walls(many: int) -> NDArray[np.object_]:
    """Crosses of two walls, some of which touch the next, and columns that lie apart."""
    crosses = [
        box
        for k in range(many)
        for box in (shapely.box(3 * k, 0, 3 * k + 2 + k % 2, 0.2), shapely.box(3 * k + 1, -1, 3 * k + 1.2, 1))
    ]
    return np.array([*crosses, *(shapely.Point(3 * k, 5).buffer(0.3) for k in range(many))], dtype=object)


@pytest.mark.parametrize("unite", [union, union_of_snapped])
def test_shapes_that_lie_apart_may_be_united_by_themselves(unite, monkeypatch: pytest.MonkeyPatch) -> None:
    found = snapped_each(walls(30))
    at_once = unite(found)
    monkeypatch.setattr(shapes, "FEW", 0)
    assert shapely.to_wkb(unite(found)) == shapely.to_wkb(at_once)
    assert unite(np.array([], dtype=object)).is_empty


def test_piled_shapes_are_not_compared_with_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of thousands that lie on one another all pairs would be, for nothing."""
    pile = np.array([shapely.Point(k / 100, 0).buffer(1.0) for k in range(50)], dtype=object)
    at_once = union(pile)
    monkeypatch.setattr(shapes, "FEW", 0)
    monkeypatch.setattr(shapes, "labels_of", None)
    assert shapely.to_wkb(union(pile)) == shapely.to_wkb(at_once)
