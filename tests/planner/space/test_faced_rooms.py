"""Faced rooms: a row of points is asked for at once, and every point gets the room that it gets alone."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from stopgo.planner.space.faced_rooms import RoomEdges

ROOMS = [
    shapely.box(0, 0, 4, 4),
    shapely.box(4.2, 0, 8, 4),
    shapely.difference(shapely.box(0, 4, 8, 9), shapely.box(3, 5, 5, 8)),
    shapely.box(3.5, 5.5, 4.5, 7.5),
]


@pytest.mark.parametrize("distance", [0.0, 0.3])
def test_a_row_gives_each_point_the_room_that_it_gets_alone(distance: float) -> None:
    ends = np.random.Generator(np.random.PCG64(7)).uniform((-1, -1), (9, 10), (300, 2, 2))
    ends[:60, 1] = ends[:60, 0] + (0.0, 0.5)
    ends[60:80, :, 1] = 4.0  # along the edge of three rooms
    counts = np.arange(300) % 9 + 1
    t = np.concatenate([(np.arange(n) + 0.5) / n for n in counts])
    row = np.repeat(np.arange(300), counts)
    points = ends[row, 0] + t[:, None] * (ends[row, 1] - ends[row, 0])
    rooms = RoomEdges(ROOMS)
    alone = rooms.nearest(points, distance)
    assert set(alone.tolist()) == {-1, 0, 1, 2, 3}
    assert np.array_equal(rooms.nearest_to_rows(points, row, distance), alone)


def test_no_point_faces_no_room() -> None:
    nothing = RoomEdges(ROOMS).nearest_to_rows(np.empty((0, 2)), np.empty(0, dtype=np.int64), 0.0)
    assert not len(nothing)
