"""Straight pieces between convex holes of a region: the tangents that they have in common, and no others."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.planner.geometry.shapes import snapped, whole_steps
from stopgo.planner.routing.tangents import straight_pieces
from stopgo.planner.visibility.sight.mesh import mesh_of


def hexagon(x: float, y: float, size: float = 1.0) -> FloatArray:
    """Corners of a hole, counter-clockwise."""
    ring = np.array([(1.0, 0.0), (0.5, 0.8), (-0.4, 0.9), (-1.0, 0.1), (-0.6, -0.8), (0.6, -0.9)])
    return (size * ring + np.array((x, y))).round(5)


def found(points: list[tuple[float, float]], *holes: FloatArray) -> tuple[set[tuple[int, int]], IntArray]:
    """Pieces in a hall of 20 × 10 m, over the points and the corners of its holes; the hole of each node."""
    region = snapped(shapely.Polygon([(0, 0), (20, 0), (20, 10), (0, 10)], holes))
    nodes = np.concatenate([np.array(points).reshape(-1, 2), *holes])
    corners = np.arange(len(points), len(nodes))
    sides = np.concatenate([[np.roll(hole, k, axis=0) - hole for k in (-1, 1)] for hole in holes], axis=1)
    pairs = straight_pieces(mesh_of(whole_steps(region)), nodes, corners, sides.transpose(1, 0, 2))
    hole = np.concatenate([np.full(len(points), -1), np.repeat(np.arange(len(holes)), len(holes[0]))])
    return {(min(a, b), max(a, b)) for a, b in pairs.tolist() if a != b}, hole


def between(pieces: set[tuple[int, int]], hole: IntArray, *wanted: int) -> int:
    """Number of pieces between two holes, or from points (-1) to one."""
    return sum(sorted(hole[list(pair)].tolist()) == sorted(wanted) for pair in pieces)


def test_two_convex_holes_have_four_tangents_in_common() -> None:
    pieces, hole = found([], hexagon(4, 5), hexagon(14, 6.3))
    assert between(pieces, hole, 0, 1) == 4


@pytest.mark.parametrize(("y", "seen"), [(5.0, 0), (1.9, 4)])
def test_a_large_hole_hides_what_is_behind_it(y: float, seen: int) -> None:
    pieces, hole = found([], hexagon(4, 5.2), hexagon(10, y, 1.8), hexagon(16, 5.1))
    assert between(pieces, hole, 0, 1) == between(pieces, hole, 1, 2) == 4
    assert between(pieces, hole, 0, 2) == seen


def test_a_point_has_two_tangents_to_a_hole_and_sees_other_points() -> None:
    pieces, hole = found([(1.0, 2.0), (3.0, 9.0)], hexagon(10, 5))
    assert between(pieces, hole, -1, 0) == 4
    assert (0, 1) in pieces


def test_the_sides_of_a_hole_are_pieces() -> None:
    pieces, hole = found([], hexagon(10, 5))
    assert between(pieces, hole, 0, 0) == 6
