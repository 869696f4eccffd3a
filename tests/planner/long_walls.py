"""Floors kilometres across with walls in any direction, seen from places where the range just ends."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from stopgo.planner.geometry.shapes import GRID
from tests.planner.kernels import interpret
from tests.planner.visibility.sight.test_sight import World

RANGES = (2.5, 5.0, 10.0, 30.0, 60.0, 100.0)
BEYOND = 1.0
"""Metres beyond the range up to which a pair counts as looked at: the others are told at a glance."""


class Observed(NamedTuple):
    """Pairs of place and unit that were looked at, and how many of all pairs were wrong."""

    pairs: int
    by_compiled: int
    by_interpreted: int


def told(seed: int, *, reach: float, places: int, monkeypatch: pytest.MonkeyPatch) -> Observed:
    """Let both kernels compute what is seen on one floor, and hold them against exact sight lines."""
    world = long_walls(seed, reach=reach, places=places)
    truth = world.by_force(reach)
    wrong = [int((world.by_kernel(reach) != truth).sum())]
    with monkeypatch.context() as patch:
        interpret(patch)
        wrong.append(int((world.by_kernel(reach) != truth).sum()))
    return Observed(_looked_at(world, reach), *wrong)


def long_walls(seed: int, *, reach: float, places: int) -> World:
    """Four walls of 10 m to 1 km and some columns; each place is `reach` from some unit, to a grid step."""
    random = np.random.default_rng(seed)
    turn = random.uniform(0, math.tau)
    walls = [_wall(random, turn, across=150.0 * k) for k in range(4)]
    columns = [_beside(random, wall, random.uniform(1, 1.5 * reach)) for wall in walls for _ in range(2)]
    round_columns = [shapely.Point(xy).buffer(0.4, quad_segs=3) for xy in columns]
    beams = np.array([[_beside(random, wall, 3.0) for _ in range(2)] for wall in walls])
    world = World(
        [*(wall.buffer(0.15, cap_style="flat") for wall in walls), *round_columns],
        beams,
        np.empty((0, 2)),
        d_dis=0.05,
        frame=(-2000, -2000, 2000, 2000),
    )
    world.stand_at(np.array([_at_range(random, world, reach) for _ in range(places)]))
    return world


def _wall(random: np.random.Generator, turn: float, *, across: float) -> shapely.LineString:
    """A wall whose direction is `turn`, to within 1°; its middle lies `across` metres off the origin."""
    half = 10 ** random.uniform(1, 3) / 2
    angle = turn + random.uniform(-1, 1) * math.radians(1)
    along = np.array([math.cos(angle), math.sin(angle)])
    middle = across * np.array([-math.sin(turn), math.cos(turn)])
    return shapely.LineString([middle - half * along, middle + half * along])


def _beside(random: np.random.Generator, wall: shapely.LineString, away: float) -> np.ndarray:
    """A point `away` metres left or right of some point of a wall."""
    a, b = shapely.get_coordinates(wall)
    along = (b - a) / np.hypot(*(b - a))
    side = random.choice([-1.0, 1.0])
    return a + random.uniform() * (b - a) + side * away * np.array([-along[1], along[0]])


def _at_range(random: np.random.Generator, world: World, reach: float) -> np.ndarray:
    """A place `reach` from the midpoint of some unit, on the side it is seen from."""
    segment = int(random.integers(len(world.units)))
    a, b = world.a[segment], world.b[segment]
    middle = a + (random.integers(world.units[segment]) + 0.5) / world.units[segment] * (b - a)
    angle = math.atan2(*(b - a)[::-1]) + random.uniform(0.02, math.pi - 0.02)
    return middle + reach * np.array([math.cos(angle), math.sin(angle)])


def _looked_at(world: World, reach: float) -> int:
    segment = np.repeat(np.arange(len(world.units)), world.units)
    within = np.arange(len(segment)) - (np.cumsum(world.units) - world.units)[segment] + 0.5
    t = (within / world.units[segment])[:, None]
    middles = world.a[segment] + t * (world.b[segment] - world.a[segment])
    places = world.viewpoints * GRID
    return sum(int(np.sum(np.hypot(*(middles - place).T) <= reach + BEYOND)) for place in places)
