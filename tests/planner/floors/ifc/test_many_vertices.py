"""Outlines and faces by the hundred thousand: counted before they are triangulated, or clipped together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.ifc import outlines, standing
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms

MANY = 500


def ring(house: House) -> list[tuple[float, float]]:
    angles = np.linspace(0, 2 * np.pi, MANY, endpoint=False)
    return [(2 + 0.2 * x, 2 + 0.2 * y) for x, y in zip(np.cos(angles), np.sin(angles), strict=True)]


def polyline(house: House) -> Any:
    points = [house.model.create_entity("IfcCartesianPoint", point) for point in ring(house)]
    return house.model.create_entity("IfcPolyline", [*points, points[0]])


def indexed(house: House) -> Any:
    points = ring(house)
    listed = house.model.create_entity("IfcCartesianPointList2D", [*points, points[0]])
    return house.model.create_entity("IfcIndexedPolyCurve", listed)


@pytest.mark.parametrize("curve", [polyline, indexed])
def test_a_profile_of_very_many_vertices_is_refused(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, curve: Any
) -> None:
    """200 000 took more than 100 s of CPU time in the geometry kernel."""
    house = two_rooms()
    make = house.model.create_entity
    profile = make("IfcArbitraryClosedProfileDef", "AREA", None, curve(house))
    axis = make("IfcAxis2Placement3D", make("IfcCartesianPoint", (0.0, 0.0, 0.0)))
    body = house.things["column"].Representation.Representations[0]
    body.Items = [
        make("IfcExtrudedAreaSolid", profile, axis, make("IfcDirection", (0.0, 0.0, 1.0)), 2.5),
    ]
    house.write(tmp_path / "columns.ifc")
    read_floor(tmp_path / "columns.ifc", FloorOptions(storey="EG"))
    monkeypatch.setattr(outlines, "MOST_VERTICES", MANY)
    house.write(tmp_path / "column.ifc")
    with (tmp_path / "column.ifc").open("a") as file:
        file.write("\n")  # it is read, as another file
    refused = rf"has an outline of {MANY + 1} vertices, more than {MANY}, in IfcColumn \S+; simplify it"
    with pytest.raises(InputError, match=refused):
        read_floor(tmp_path / "column.ifc", FloorOptions(storey="EG"))


def test_a_line_of_very_many_vertices_in_no_body_is_read(
    read: Read, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outlines, "MOST_VERTICES", MANY)
    house = two_rooms()
    polyline(house)
    house.write(tmp_path / "house.ifc")
    assert list(outlines._long_outlines((tmp_path / "house.ifc").read_bytes()))
    read_floor(tmp_path / "house.ifc", FloorOptions(storey="EG"))


def test_faces_are_clipped_together_as_each_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    triangles = np.random.default_rng(7).normal(size=(400, 3, 3))
    triangles[:100] = triangles[:100].round()
    alone = [face for one in triangles for face in standing._faces(one[None], -0.3, 0.4)]
    calls = []
    above = standing._above

    def counted(*given: Any) -> Any:
        calls.append(given)
        return above(*given)

    monkeypatch.setattr(standing, "_above", counted)
    together = standing._faces(triangles, -0.3, 0.4)
    assert shapely.to_wkb(together).tolist() == shapely.to_wkb(alone).tolist()
    assert len(together) > 100
    assert len(calls) <= 9, "one by each pattern of corners above the lower height, and all of them once"
    assert standing._faces(triangles, 50.0, 51.0) == []
