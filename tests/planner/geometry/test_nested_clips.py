"""Nested clips: the clip to a box is the same, whichever half it is cut from."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from stopgo.planner.geometry.nested_clips import FEW, NestedClips


def _combs(teeth: int) -> shapely.MultiPolygon:
    """Two shapes with many corners: a slab with holes, and a block apart from it."""
    holes = [shapely.box(k + 0.2, j + 0.3, k + 0.7, j + 0.6) for k in range(teeth) for j in range(4)]
    slab = shapely.difference(shapely.box(0, 0, teeth, 4), shapely.union_all(holes))
    return shapely.union(slab, shapely.box(0, 6, teeth, 7))


@pytest.mark.parametrize("side", [0.4, 3.0, 40.0])
def test_a_clip_is_the_part_of_the_shape_in_the_box(side: float) -> None:
    whole = _combs(60)
    assert shapely.get_num_coordinates(whole) > FEW
    clips = NestedClips(whole)
    random = np.random.Generator(np.random.PCG64(5))
    for x, y in random.uniform((-2, -2), (62, 9), (60, 2)):
        box = np.array([x, y, x + side, y + side])
        clip, exact = clips.within(box), shapely.intersection(whole, shapely.box(*box))
        assert clip.is_valid
        assert shapely.symmetric_difference(clip, exact).area < 1e-9


@pytest.mark.parametrize("box", [(100.0, 100.0, 101.0, 101.0), (60.0, 0.0, 61.0, 4.0)])
def test_outside_the_shape_a_clip_is_empty(box: tuple[float, ...]) -> None:
    assert NestedClips(_combs(60)).within(np.array(box)).is_empty


def test_the_clip_of_nothing_is_empty() -> None:
    assert NestedClips(shapely.MultiPolygon()).within(np.array([0.0, 0.0, 1.0, 1.0])).is_empty
