"""Floors turned to many angles, mirrored and shifted: the same floor, and never an error of geometry."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from tests.faults.sizes import size
from tests.planner.turning import MovableDrawing, places
from tests.planner.worlds import FLOORS, SHARED

OFFICE = Path(__file__).parents[2] / "recordings" / "samples" / "office.dxf"
DRAWINGS = {"office": OFFICE, **{Path(name).stem: SHARED / name for name in FLOORS}}
ANGLES = size(short=36, full=360)


@cache
def drawing(name: str) -> MovableDrawing:
    if not DRAWINGS[name].is_file():
        pytest.skip(f"{DRAWINGS[name]} is not there")
    return MovableDrawing(DRAWINGS[name])


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_floor_is_the_same_wherever_it_lies(name: str) -> None:
    here = drawing(name)
    unlike = {
        place: told for place in places(ANGLES, seed=1) if (told := here.figures(place).unlike(here.as_drawn))
    }
    assert not unlike
