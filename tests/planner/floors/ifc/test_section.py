"""Cuts and projections of meshes, against areas that can be computed on paper."""

from __future__ import annotations

import numpy as np
import pytest

from stopgo.planner.floors.ifc.model import Surface
from stopgo.planner.floors.ifc.section import cut, footprint, union_of, upward

FACES = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4)]
FACES += [(2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5)]


def box(x0: float, y0: float, z0: float, x1: float, y1: float, z1: float) -> Surface:
    corners = [(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)]
    return Surface(np.array(corners, float), np.array(FACES))


def together(*meshes: Surface) -> Surface:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]
    return Surface(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def turned_inside_out(mesh: Surface) -> Surface:
    return Surface(mesh.vertices, mesh.faces[:, ::-1])


def test_a_box_is_cut_to_its_plan() -> None:
    assert cut(box(0, 0, 0, 3, 2, 1), 0.5).area == pytest.approx(6)
    assert cut(box(0, 0, 0, 3, 2, 1), 1.5).is_empty


@pytest.mark.parametrize("prepare", [lambda mesh: mesh, turned_inside_out])
def test_overlapping_bodies_are_cut_as_one(prepare) -> None:
    both = together(prepare(box(0, 0, 0, 2, 1, 1)), prepare(box(1, 0, 0, 3, 1, 1)))
    assert cut(both, 0.5).area == pytest.approx(3)


def test_a_body_in_a_hollow_one_is_solid_again() -> None:
    """Outer 4 × 4, a void of 2 × 2 drawn inside out, and a core of 1 × 1 in it."""
    hollow = together(
        box(0, 0, 0, 4, 4, 1), turned_inside_out(box(1, 1, 0, 3, 3, 1)), box(1.5, 1.5, 0, 2.5, 2.5, 1)
    )
    assert cut(hollow, 0.5).area == pytest.approx(16 - 4 + 1)


def test_the_shadow_of_a_band_holds_what_a_cut_at_its_middle_misses() -> None:
    table = together(box(0, 0, 0.7, 2, 1, 0.8), box(0.9, 0.4, 0, 1.1, 0.6, 0.7))
    assert cut(table, 0.4).area == pytest.approx(0.04)
    assert footprint(table, 0.1, 1.0).area == pytest.approx(2)
    assert footprint(table, 0.1, 0.6).area == pytest.approx(0.04)
    assert footprint(turned_inside_out(table), 0.1, 1.0).area == pytest.approx(2)


def test_a_ramp_throws_the_shadow_of_what_lies_in_the_band() -> None:
    """It rises 1 m over 4 m: between 0.25 and 0.75 m lie 2 m of it; above that stands the body."""
    corners = [(0, 0, 0), (4, 0, 0), (4, 0, 1), (0, 2, 0), (4, 2, 0), (4, 2, 1)]
    faces = [(0, 1, 2), (3, 5, 4), (0, 2, 5), (0, 5, 3), (0, 3, 4), (0, 4, 1), (1, 4, 5), (1, 5, 2)]
    ramp = Surface(np.array(corners, float), np.array(faces))
    assert footprint(ramp, 0.25, 2.0).area == pytest.approx(3 * 2)
    assert footprint(ramp, 0.25, 0.75).area == pytest.approx(3 * 2)


def test_only_what_looks_up_is_floor() -> None:
    triangles, heights, areas = upward(box(0, 0, -0.2, 3, 2, 0))
    assert areas.sum() == pytest.approx(6)
    assert set(heights.tolist()) == {0.0}
    assert union_of(triangles).area == pytest.approx(6)
