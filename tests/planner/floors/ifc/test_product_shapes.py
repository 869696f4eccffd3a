"""Shapes of elements: of their parts, counted once, and made in another way where the kernel fails."""

from __future__ import annotations

from typing import Any

import ifcopenshell.api.aggregate
import ifcopenshell.api.geometry
import ifcopenshell.api.type
import ifcopenshell.geom
import ifcopenshell.util.placement
import pytest
import shapely

from stopgo.planner.floors.ifc import product_shapes as shapes
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms
from tests.planner.floors.ifc.test_storey import area_of, named


def in_parts(*, with_body: bool = False) -> House:
    """Two rooms whose north wall is two layers of 0.1 m; the wall itself has a body only if asked."""
    house = two_rooms()
    wall = house.things["north"]
    ground = house.model.by_type("IfcBuildingStorey")[0]
    layers = [
        house.box(
            "IfcBuildingElementPart", f"layer {k}", (0, 4.2 + 0.1 * k, 0, 8.2, 4.3 + 0.1 * k, 2.8), ground
        )
        for k in (0, 1)
    ]
    ifcopenshell.api.aggregate.assign_object(house.model, relating_object=wall, products=layers)
    if not with_body:
        ifcopenshell.api.geometry.unassign_representation(
            house.model, product=wall, representation=wall.Representation.Representations[0]
        )
    return house


@pytest.mark.parametrize("with_body", [False, True])
def test_a_wall_in_parts_is_one_wall(with_body: bool, read: Read) -> None:
    whole, house = read(two_rooms()), in_parts(with_body=with_body)
    floor = read(house)
    assert named(floor, house, "north") == ["walls"]
    assert area_of(floor, "walls") == pytest.approx(area_of(whole, "walls"))
    assert {item.kind for item in floor.elements} == {item.kind for item in whole.elements}


def test_what_is_assembled_in_a_body_counts_once(read: Read) -> None:
    house = two_rooms()
    stud = house.box("IfcMember", "stud", (1, 4.25, 0, 1.1, 4.35, 2.8))
    ifcopenshell.api.aggregate.assign_object(
        house.model, relating_object=house.things["north"], products=[stud]
    )
    assert named(read(house), house, "stud") == []


def test_columns_of_one_type_stand_where_each_is_placed_and_turned(read: Read) -> None:
    """The kernel makes the shape of the type once, 0.4 x 0.1 m; it is placed afterwards."""
    house = two_rooms()
    kind = house.box("IfcColumnType", "kind", (0, 0, 0, 0.4, 0.1, 2.8))
    ground = house.model.by_type("IfcBuildingStorey")[0]
    for name, (x, y, degrees) in {
        "one": (5.0, 1.0, 0),
        "two": (6.0, 1.0, 90),
        "three": (7.0, 3.0, 30),
    }.items():
        column = house.box("IfcColumn", name, (x, y, 0, x + 1, y + 1, 1), ground)
        ifcopenshell.api.type.assign_type(house.model, related_objects=[column], relating_type=kind)
        turned = ifcopenshell.util.placement.rotation(degrees, "Z")
        turned[:3, 3] = (x, y, 0)
        ifcopenshell.api.geometry.edit_object_placement(house.model, product=column, matrix=turned)
    typed = [house.things[name] for name in ("one", "two", "three")]
    assert shapes._with_shared_shapes([*typed, house.things["column"]]) == typed
    floor = read(house)
    for thing, corner in zip(typed, ((5.4, 1.1), (5.9, 1.4), (7.2964, 3.2866)), strict=True):
        (element,) = [item for item in floor.elements if item.global_id == thing.GlobalId]
        (solid,) = element.solids
        assert abs(solid.exterior - corner).max(axis=1).min() < 2e-4
        assert shapely.Polygon(solid.exterior).area == pytest.approx(0.04, abs=1e-4)


def failing(monkeypatch: pytest.MonkeyPatch, *ways: str) -> None:
    """The kernel makes the column only in some ways."""
    create = ifcopenshell.geom.create_shape
    iterator = ifcopenshell.geom.iterator

    def without_column(settings: Any, model: Any, threads: int, *, include: list[Any], **said: Any) -> Any:
        return iterator(settings, model, threads, include=[e for e in include if e.Name != "column"], **said)

    def creating(settings: Any, entity: Any, geometry_library: str) -> Any:
        for way, (kernel, given) in shapes.WAYS.items():
            same = settings.get("disable-opening-subtractions") != given.get("with_openings", True)
            if way in ways and kernel == geometry_library and same:
                return create(settings, entity, geometry_library=shapes.KERNEL)
        raise RuntimeError("no shape")

    monkeypatch.setattr(ifcopenshell.geom, "iterator", without_column)
    monkeypatch.setattr(ifcopenshell.geom, "create_shape", creating)


def test_a_shape_that_one_kernel_cannot_make_is_made_by_the_other(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch, "other kernel")
    house = two_rooms()
    floor = read(house)
    assert area_of(floor, "columns") == pytest.approx(0.16)
    assert not {item.code for item in floor.findings} & {"no_geometry", "box_shape", "uncut_shape"}


def test_a_shape_without_its_openings_is_named(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    failing(monkeypatch, "no openings")
    house = two_rooms()
    (said,) = [item.message for item in read(house).findings if item.code == "uncut_shape"]
    guid = house.things["column"].GlobalId
    assert said == (f"1 element is shown without the openings cut out of them: IfcColumn {guid} 'column'")


def test_what_no_kernel_can_make_is_the_box_around_its_points(
    read: Read, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing(monkeypatch)
    house = two_rooms()
    floor = read(house)
    assert area_of(floor, "columns") == pytest.approx(0.16)
    (said,) = [item.message for item in floor.findings if item.code == "box_shape"]
    assert house.things["column"].GlobalId in said
    assert not [item for item in floor.findings if item.code == "no_geometry"]
