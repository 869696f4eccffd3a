"""Times of paths in the table are those of the legs that are driven."""

from __future__ import annotations

import math
from itertools import pairwise, permutations

import numpy as np
import pytest

from stopgo.mission.console.plugins import Variant
from stopgo.mission.document.schedule import leg_times
from stopgo.mission.document.specs import robot_of
from stopgo.mission.geometry import FloatArray
from stopgo.mission.settings import Settings
from stopgo.planner.routing.leg_table import MICROSECONDS, leg_table
from stopgo.planner.routing.legs import Legs
from stopgo.planner.routing.paths import shortest_paths

ROBOT = robot_of(Settings())


def legs_over(xy: FloatArray, pieces: list[tuple[int, int]], points: int) -> Legs:
    paths = shortest_paths(xy, np.array(pieces), points)
    return Legs(Variant("graph = exact", "exact", None, ours=True), paths, xy[:points])


def assert_as_driven(legs: Legs) -> None:
    table = leg_table(legs, ROBOT)
    for a, b in permutations(range(len(legs.points)), 2):
        line = legs.path(a, b)
        step = line[1] - line[0]
        first = math.atan2(step[1], step[0])
        drive, turn, last = leg_times(line.tolist(), heading=first, robot=ROBOT)
        assert table.spent[a, b] / MICROSECONDS == pytest.approx(drive + turn, abs=1e-4)
        assert table.turns(table.leaving[a, b], np.int64(table.heading(first))) < 100
        assert table.turns(table.arriving[a, b], np.int64(table.heading(last))) < 100


def test_of_equally_short_paths_both_directions_have_one() -> None:
    """On a lattice, where most pairs have many, with more or fewer corners."""
    place = np.random.default_rng(2).permutation(49).reshape(7, 7)
    xy = np.empty((49, 2))
    xy[place] = np.stack(np.meshgrid(np.arange(7.0), np.arange(7.0), indexing="ij"), axis=-1)
    sides = [(place[:-1], place[1:]), (place[:, :-1], place[:, 1:])]
    pieces = [pair for a, b in sides for pair in zip(a.ravel().tolist(), b.ravel().tolist(), strict=True)]
    assert_as_driven(legs_over(xy, pieces, 12))


@pytest.mark.parametrize(
    "line",
    [
        [(0.0, 0.0), (0.046, 8e-7), (0.139, 0.0)],
        [(0.0, 0.0), (6.0, 0.0), (7.0, 0.0), (7.985, 6e-7), (8.0, 0.0)],
    ],
)
def test_bends_that_are_driven_straight_take_no_time(line: list[tuple[float, float]]) -> None:
    xy = np.array([line[0], line[-1], *line[1:-1]])
    nodes = [0, *range(2, len(line)), 1]
    assert_as_driven(legs_over(xy, list(pairwise(nodes)), 2))
