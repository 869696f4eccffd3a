"""Floors turned to many angles, mirrored and shifted: the same floor, and never an error of geometry."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from tests.faults.sizes import FULL, size
from tests.planner.turning import Figures, MovableDrawing, Place, places
from tests.planner.worlds import FLOORS, SHARED

OFFICE = Path(__file__).parents[2] / "recordings" / "samples" / "office.dxf"
LARGE = ("office-l1", "case1")
"""Floors that take as long as all others together; only the long form turns them."""
DRAWINGS = {
    "office": OFFICE,
    **{Path(name).stem: SHARED / name for name in FLOORS if FULL or not any(map(name.count, LARGE))},
}
ANGLES = size(short=2, full=360)


@cache
def drawing(name: str) -> MovableDrawing:
    if not DRAWINGS[name].is_file():
        pytest.skip(f"{DRAWINGS[name]} is not there")
    return MovableDrawing(DRAWINGS[name])


AWKWARD = {"duplex-l1": [Place(269.8539871307857)]}
"""Where a union of GEOS loses a piece without an error."""


@cache
def anywhere(name: str) -> dict[Place, Figures]:
    some = places(ANGLES, seed=1)
    return {place: drawing(name).figures(place) for place in (*AWKWARD.get(name, ()), *some)}


@pytest.mark.parametrize("name", list(DRAWINGS)[:: 1 if FULL else 2])
def test_a_floor_is_the_same_wherever_it_lies(name: str) -> None:
    here = drawing(name).as_drawn
    unlike = {place: told for place, there in anywhere(name).items() if (told := there.unlike(here))}
    assert not unlike


@pytest.mark.parametrize("name", DRAWINGS)
def test_no_unit_is_lost_wherever_a_floor_lies(name: str) -> None:
    lost = {place: there.lost for place, there in anywhere(name).items() if there.lost}
    assert not lost
