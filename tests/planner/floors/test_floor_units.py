"""Lengths are metres whatever the drawing unit; the header is doubted where the floor size is absurd."""

from __future__ import annotations

import pytest
from ezdxf.layouts import Modelspace
from floor_drawings import Read, codes, rectangle

UNITS = {1: 1 / 0.0254, 2: 1 / 0.3048, 4: 1000.0, 5: 100.0, 6: 1.0, 14: 10.0}


def nothing(model: Modelspace) -> None:
    """Only the floor of 10 by 8."""


@pytest.mark.parametrize("units", UNITS)
def test_every_unit_gives_the_same_floor(read: Read, units: int) -> None:
    plan = read(nothing, units=units, size=UNITS[units])
    assert plan.area == pytest.approx(80)
    assert plan.findings == ()


@pytest.mark.parametrize(("size", "name"), [(1.0, "metre"), (1000.0, "millimetre"), (100.0, "centimetre")])
def test_a_missing_unit_is_read_from_the_floors_size(read: Read, size: float, name: str) -> None:
    plan = read(nothing, units=0, size=size)
    assert plan.area == pytest.approx(80) or name == "centimetre"
    assert codes(plan) == ["units_missing"]


def test_doors_tell_centimetres_from_millimetres(read: Read) -> None:
    """3500 units are 3.5 m or 35 m; a door of 90 units is 0.9 m only in centimetres."""

    def draw(model: Modelspace) -> None:
        model.add_line((0, 0), (90, 0), dxfattribs={"layer": "DOORS"})

    assert read(draw, units=0, size=350.0).area == pytest.approx(80 * 3.5**2)


def test_a_header_that_contradicts_the_size_is_overruled(read: Read) -> None:
    plan = read(nothing, units=4, size=1.0)
    assert plan.area == pytest.approx(80)
    assert codes(plan) == ["units_wrong"]
    assert "millimetre" in plan.findings[0].message


def test_a_small_floor_with_a_sound_door_keeps_its_unit(read: Read) -> None:
    """A lift lobby of 2.0 by 1.6 m in millimetres is not 20 by 16 m in centimetres."""

    def draw(model: Modelspace) -> None:
        model.add_line((0, 0), (900, 0), dxfattribs={"layer": "DOORS"})

    plan = read(draw, units=4, size=200.0)
    assert plan.area == pytest.approx(2.0 * 1.6)
    assert plan.findings == ()


def test_a_size_that_no_unit_explains_keeps_the_header_with_a_finding(read: Read) -> None:
    plan = read(nothing, units=6, size=0.1)
    assert plan.area == pytest.approx(0.8)
    assert codes(plan) == ["units_doubtful"]


def test_coordinates_far_away_keep_their_place(read: Read) -> None:
    x, y = 691_000.0, 5_334_000.0

    def draw(model: Modelspace) -> None:
        rectangle(model, "FLOOR", x, y, x + 10, y + 8)
        rectangle(model, "WALLS", x + 1, y + 1, x + 3, y + 1.25)

    plan = read(draw, floor=False)
    assert plan.outline[0].exterior[0].tolist() == [x, y]
    assert plan.elements[0].solids[0].area == pytest.approx(0.5, abs=1e-8)
