"""Faces that continue each other smoothly are one surface: scans register by round columns, not by edges."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from stopgo.mission.geometry import FloatArray, Polygon
from stopgo.planner.overlap import least_hold_m, links_by_kernel, overlaps_of
from stopgo.planner.overlap.boundary import EDGE_M, boundary_of
from stopgo.planner.overlap.pair_kernel import firm_pairs
from stopgo.planner.overlap.surfaces import LEAST_RADIUS_M, smooth_surfaces
from tests.planner.kernels import machine_code
from tests.planner.overlap.test_pairs import SETTINGS, standing
from tests.planner.worlds import box, element, floor_of


def ring_of(x: float, y: float, radius: float, sides: int) -> FloatArray:
    """Corners of a round or polygonal column, clockwise (sides, 2)."""
    turns = -2 * math.pi * np.arange(sides) / sides
    return np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)


def faces_of(*rings: FloatArray) -> FloatArray:
    """Faces of these outlines in canonical order (m, 2, 2)."""
    faces = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])
    return faces[np.lexsort(faces.reshape(-1, 4).T[::-1])]


def sizes_of(*rings: FloatArray) -> list[int]:
    """Number of faces of each surface, which are checked to follow each other and to be all."""
    faces = faces_of(*rings)
    order, first, _ = smooth_surfaces(faces)
    assert sorted(order.tolist()) == list(range(len(faces)))
    for one in np.split(faces[order], first[1:]):
        assert (one[:-1, 1] == one[1:, 0]).all()
    starts = order[first]
    assert (np.diff(starts) > 0).all()
    return sorted(np.diff(np.append(first, len(faces))).tolist())


@pytest.mark.parametrize(
    ("radius", "sides", "sizes"),
    [
        (0.4, 50, [50]),
        (0.4, 16, [16]),
        (0.15, 19, [19]),
        (0.1, 13, [1] * 13),
        (0.4, 8, [1] * 8),
        (0.3, 4, [1] * 4),
    ],
)
def test_a_round_column_is_one_surface_and_one_with_edges_is_not(
    radius: float, sides: int, sizes: list[int]
) -> None:
    assert sizes_of(ring_of(3, 4, radius, sides)) == sizes


def test_only_what_is_smooth_all_around_is_closed() -> None:
    """A round column, one with a flat side of 40 cm, and a square one."""
    whole, turns = ring_of(0, 0, 0.4, 50), -2 * math.pi * np.arange(50) / 50
    flat = whole[np.abs(np.cos(turns) - 1) > 0.15] + (5.0, 0.0)
    _, first, closed = smooth_surfaces(faces_of(whole, flat, ring_of(9, 0, 0.4, 4)))
    assert closed.sum() == 1 and len(first) == 1 + 2 + 4


def test_a_rounded_wall_is_a_surface_up_to_its_edges() -> None:
    """A quarter of a circle with a radius of 2 m, 20 cm thick: both curved sides, and two ends."""
    turns = np.linspace(math.pi / 2, 0, 31)
    outer, inner = (r * np.stack([np.cos(turns), np.sin(turns)], axis=1) for r in (2.2, 2.0))
    assert sizes_of(np.concatenate([outer, inner[::-1]])) == [1, 1, 30, 30]


def test_where_outlines_touch_no_face_continues_another() -> None:
    """Two round columns that touch in one corner of each: both surfaces begin and end there."""
    one = ring_of(0, 0, 0.4, 40)
    other = np.add(one, (0.8, 0.0))
    other[np.argmin(other[:, 0])] = one[0]
    assert sizes_of(one, other) == [40, 40]
    faces = faces_of(one, other)
    order, first, closed = smooth_surfaces(faces)
    assert not closed.any()
    assert all((faces[face, 0] == one[0]).all() for face in order[first])


def test_no_faces_are_no_surfaces() -> None:
    assert [len(found) for found in smooth_surfaces(np.empty((0, 2, 2)))] == [0, 0, 0]


@pytest.mark.parametrize(("radius", "registers"), [(0.4, True), (LEAST_RADIUS_M / 2, False)])
def test_scans_register_by_round_columns(radius: float, registers: bool) -> None:
    """In the open, among three columns. From 4 m off, two scans see nearly the same half of each."""
    places = ((4.0, 10.0), (12.0, 4.0), (12.0, 16.0))
    columns = [
        element(f"c{k}", "columns", Polygon.of(ring_of(x, y, radius, round(2 * math.pi * radius / 0.05))))
        for k, (x, y) in enumerate(places)
    ]
    floor = floor_of(box(0, 0, 20, 20), elements=tuple(columns))
    found = standing(floor, replace(SETTINGS, overlap=0.0, overlap_range=10.0), (8, 9.5), (8, 10.5))
    overlaps = overlaps_of(found)
    pairs = overlaps.of(0)
    assert (len(pairs.hold_m) > 0 and pairs.hold_m[0] > 10 * least_hold_m(found.settings)) == registers
    for kernel in (firm_pairs, machine_code(firm_pairs)):
        links = [row.tolist() for row, _ in links_by_kernel(kernel, overlaps, found.settings) if len(row)]
        assert links == ([[0]] if registers else [])


def test_what_both_see_of_a_column_counts_less_its_two_ends() -> None:
    """N of an arc is the integral of the normals over what both see, less 0.14 m at its ends only."""
    radius = 0.4
    column = element("c", "columns", Polygon.of(ring_of(10, 10, radius, 50)))
    floor = floor_of(box(0, 0, 20, 20), elements=(column,))
    overlaps = overlaps_of(standing(floor, replace(SETTINGS, overlap_range=10.0), (6, 9.5), (6, 10.5)))
    matrix, common = overlaps.normal_matrix(0, 1), float(overlaps.of(0).common_m[0])
    assert len(boundary_of(standing(floor, SETTINGS, (6, 9.5)).space).first) == 1
    half = (common - 2 * EDGE_M) / radius / 2
    assert matrix[0, 0] == pytest.approx(radius * (half + math.sin(2 * half) / 2), rel=0.02)
    assert matrix[1, 1] == pytest.approx(radius * (half - math.sin(2 * half) / 2), rel=0.02)
    assert np.hypot(*(overlaps.middle_of_common(0, 1) - overlaps.middle_of_common(1, 0))) < 1e-9
