"""Drawings of random odd shapes: each is planned, or refused in one line."""

from __future__ import annotations

import random
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing

from stopgo.mission.errors import StopgoError
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.floors.dxf import floor_in
from tests.faults.sizes import size, some

LAYERS = ("FLOOR", "FLOOR", "ROOMS", "WALLS", "WALLS", "COLUMNS", "BEAMS", "STAIRS", "DOORS", "PASSAGES", "X")
HAIRS = (1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 0.01, 0.02, 0.05, 0.5)
IMPOSSIBLE = (1e9, -1e9, 1e12, 1e300, float("nan"), float("inf"), 5e-324)
BULGES = (0.0, 0.0, 1.0, -1.0, 0.5, 1e-12, 1e6)


def coordinate(rng: random.Random) -> float:
    """Mostly a whole number up to 12, so that shapes touch and repeat; sometimes a hair off one."""
    kind = rng.random()
    if kind < 0.03:
        return rng.choice(IMPOSSIBLE)
    beside = rng.choice((-1, 1)) * rng.choice(HAIRS) if kind < 0.25 else 0.0
    return rng.randint(0, 12) + beside


def point(rng: random.Random) -> tuple[float, float]:
    return (coordinate(rng), coordinate(rng))


def odd_drawing(rng: random.Random) -> Drawing:
    """A floor of 12 by 12 m, or none, and up to ten shapes on any layer."""
    drawing = ezdxf.new(units=6)
    model = drawing.modelspace()
    if rng.random() < 0.85:
        corners = [(0, 0), (12, 0), (12, 12), (0, 12)]
        model.add_lwpolyline(corners, close=True, dxfattribs={"layer": "FLOOR"})
    for _ in range(rng.randint(1, 10)):
        at = {"layer": rng.choice(LAYERS)}
        kind, closed = rng.random(), rng.random() < 0.7
        if kind < 0.6:
            points = [point(rng) for _ in range(rng.choice((1, 2, 2, 3, 4, 4, 5, 6, 8)))]
            model.add_lwpolyline([*points, rng.choice(points)], close=closed, dxfattribs=at)
        elif kind < 0.7:
            bulged = [(*point(rng), rng.choice(BULGES)) for _ in range(rng.choice((1, 2, 3, 5)))]
            model.add_lwpolyline(bulged, format="xyb", close=closed, dxfattribs=at)
        elif kind < 0.8:
            model.add_line(point(rng), point(rng), dxfattribs=at)
        elif kind < 0.88:
            model.add_circle(point(rng), rng.choice((0, 1e-9, 1e-3, 0.1, 0.3, 1, 3, -1)), dxfattribs=at)
        elif kind < 0.94:
            model.add_arc(point(rng), 2.0, rng.uniform(-400, 400), rng.uniform(-400, 400), dxfattribs=at)
        else:
            hatch = model.add_hatch(dxfattribs=at)
            hatch.paths.add_polyline_path([point(rng) for _ in range(rng.choice((2, 3, 4, 5)))])
    return drawing


@pytest.mark.parametrize("strategy", some(["grid", "triangulation"], every=2))
def test_an_anomalous_drawing_is_planned_or_refused_in_one_line(strategy: str) -> None:
    planned, trials = 0, size(short=10, full=5000)
    for seed in range(trials):
        drawing = odd_drawing(random.Random(seed))
        try:
            floor = floor_in(drawing, source=Path("odd.dxf"), digest="0" * 64, d_dis=0.05)
            plan(floor, Settings(candidates=strategy))
            planned += 1
        except StopgoError as error:
            assert "\n" not in str(error), seed
    assert planned > trials // 4
