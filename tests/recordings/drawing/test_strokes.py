"""Polygons drawn as strokes and triangles keep their area."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stopgo.mission.document.schedule import schedule
from stopgo.mission.geometry import Polygon, ring_area
from stopgo.recordings.drawing import strokes
from stopgo.recordings.plan.drive import planned_drive
from tests.recordings import world

SQUARE = Polygon.of([(0, 0), (4, 0), (4, 4), (0, 4)], [[(1, 1), (3, 1), (3, 3), (1, 3)]])
"""16 m² with a hole of 4 m²."""
HOOK = Polygon.of([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)])
"""An L of 5 m²."""
TILTED = Polygon.of([(0, 0), (3, 4), (-1, 7), (-4, 3)])
"""A square of 25 m², turned."""


@pytest.mark.parametrize(("polygon", "area"), [(SQUARE, 12.0), (HOOK, 5.0), (TILTED, 25.0)])
def test_triangles_cover_the_polygon(polygon: Polygon, area: float) -> None:
    faces = strokes.triangles([polygon])
    assert sum(abs(ring_area(face)) for face in faces) == pytest.approx(area)


@pytest.mark.parametrize(("polygon", "area"), [(SQUARE, 12.0), (HOOK, 5.0), (TILTED, 25.0)])
def test_a_fill_covers_the_polygon_and_no_more(polygon: Polygon, area: float) -> None:
    filled = strokes.fill([polygon], spacing=0.05)
    lengths = np.hypot(*(filled.lines[:, 1] - filled.lines[:, 0]).T)
    # Each stroke has a half disc at both ends, which the shortening makes up for.
    covered = (2 * filled.radii * (lengths + 2 * filled.radii)).sum()
    assert covered == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize("angle", [0.0, math.pi / 4, -math.pi / 4])
def test_a_hatch_has_the_length_of_the_area_over_its_spacing(angle: float) -> None:
    lines = strokes.hatch([SQUARE], spacing=0.01, angle=angle)
    lengths = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    assert lengths.sum() * 0.01 == pytest.approx(12.0, rel=1e-2)


def test_a_name_stands_where_the_room_is_wide() -> None:
    # Chords lie at thirds of a metre; the wide part of the L is its lowest metre.
    assert tuple(strokes.name_point(HOOK)) == pytest.approx((1.5, 5 / 6))


def test_units_with_one_value_are_drawn_as_one_piece() -> None:
    targets = world.space_of(world.floor_at()).targets
    value = np.repeat([1, 2], [6, 26])
    lines, values = strokes.lines_by_value(targets, value)
    # The first face has one value, the second is cut in its middle, six faces are whole.
    assert len(lines) == 1 + 2 + 6
    assert list(values[:3]) == [1, 1, 2]
    assert np.allclose(lines[1], [(2.4, 2.0), (2.4, 2.2)])


def test_the_planned_drive_keeps_the_schedule() -> None:
    mission = world.nouns_at()[-1]
    drive = planned_drive(mission)
    stay = np.array([stop.settle_s + stop.scan.duration_s for stop in mission.stops])
    assert np.allclose(drive.leaving_s - stay, schedule(mission).arrival_s)
    assert drive.seconds[-1] == pytest.approx(schedule(mission).total_s)
