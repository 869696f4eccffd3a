"""Openings cut by the fast kernel: the same body as by the usual one, or left to that."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from stopgo.planner.floors.ifc import opening_cuts
from stopgo.planner.floors.ifc.kernel_shapes import Made, iterated, settings_of
from stopgo.planner.floors.ifc.opening_cuts import cut_bodies
from tests.planner.floors.ifc.house import House, two_rooms


def volume(made: Made) -> float:
    a, b, c = np.moveaxis(made.points[made.corners], 1, 0)
    return float((a * np.cross(b, c)).sum()) / 6


def open_surface(house: House, name: str) -> None:
    """A wall's mesh becomes a surface of the same faces, without one of them."""
    for item in house.things[name].Representation.Representations[0].Items:
        item.Faces = item.Faces[1:]


def cut_walls(house: House) -> dict[str, Made]:
    """Bodies that the fast kernel cuts, by the names of their products."""
    walls = house.model.by_type("IfcWall")
    return {house.model.by_id(made.number).Name: made for made in cut_bodies(house.model, walls)}


def test_walls_are_cut_as_by_the_usual_kernel() -> None:
    """The window takes 2 x 1.2 m of the south wall, the door 0.9 x 2.1 m of the one in the middle."""
    house = two_rooms()
    found = cut_walls(house)
    assert {name: round(volume(made), 9) for name, made in found.items()} == {
        "south": round(0.2 * (8.2 * 2.8 - 2 * 1.2), 9),
        "middle": round(0.2 * (4.0 * 2.8 - 0.9 * 2.1), 9),
    }
    usual = iterated(house.model, [house.things[name] for name in found], settings_of())
    for made in usual:
        points = found[house.model.by_id(made.number).Name].points
        gaps = np.abs(made.points[:, None] - points).max(axis=2)
        assert gaps.min(axis=1).max() < 1e-9


def test_an_open_surface_is_left_to_the_usual_kernel() -> None:
    house = two_rooms()
    open_surface(house, "south")
    assert set(cut_walls(house)) == {"middle"}


def test_all_walls_are_left_to_the_usual_kernel_where_the_fast_one_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(opening_cuts, "CUTTER", "no such kernel")
    assert cut_walls(two_rooms()) == {}


@pytest.mark.parametrize("fault", ["another body", "beyond the body", "cut too much"])
def test_a_wrong_cut_is_left_to_the_usual_kernel(fault: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The fast kernel makes the south wall 1 mm longer, cut 1 cm too long, or cut 1 m too low."""
    house = two_rooms()
    moved = {"another body": (0.001, 0, 0), "beyond the body": (0.01, 0, 0), "cut too much": (0, 0, -1)}

    def wrong(made: Made) -> Made:
        far = (made.points == made.points.max(axis=0)) & (np.array(moved[fault]) != 0)
        return replace(made, points=made.points + far * np.array(moved[fault]))

    def iterating(model: Any, entities: Any, settings: Any, *kernel: Any) -> Any:
        whole = settings.get("disable-opening-subtractions")
        for made in iterated(model, entities, settings, *kernel):
            is_wrong = bool(kernel) and whole == (fault == "another body")
            yield wrong(made) if is_wrong and model.by_id(made.number).Name == "south" else made

    monkeypatch.setattr(opening_cuts, "iterated", iterating)
    assert set(cut_walls(house)) == {"middle"}
