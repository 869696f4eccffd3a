"""The outline of what a stop sees encloses what lies between it and the faces in sight, and no more."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from stopgo.recordings.drawing.fans import sight_outline

EYE = np.array([2.0, 1.0])
ROOM = [[(0, 0), (4, 0)], [(4, 0), (4, 3)], [(4, 3), (0, 3)], [(0, 3), (0, 0)]]


def area(*lines: list[tuple[float, float]]) -> float:
    return float(shapely.Polygon(sight_outline(EYE, np.array(lines, dtype=float))).area)


def test_a_room_is_seen_whole() -> None:
    assert area(*ROOM) == pytest.approx(12.0)


def test_without_a_wall_its_triangle_is_missing() -> None:
    assert area(*ROOM[1:]) == pytest.approx(12.0 - 4 * 1 / 2)


def test_of_a_wall_behind_a_beam_the_wall_counts() -> None:
    beam = [(1.0, 2.0), (3.0, 2.0)]
    assert area(*ROOM, beam) == pytest.approx(12.0)


@pytest.mark.parametrize("lines", [np.empty((0, 2, 2)), np.array([[(102, 1.00001), (102.05, 1.00001)]])])
def test_of_nothing_or_of_a_face_seen_edge_on_there_is_the_place_alone(lines: np.ndarray) -> None:
    assert sight_outline(EYE, lines).tolist() == [EYE.tolist()] * 2
