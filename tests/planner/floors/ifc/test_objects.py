"""Furniture and equipment of a model: in the robot's way, hiding what is behind it, never a target."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import Element, FloorPlan
from stopgo.planner.floors import FloorOptions, survey_floor
from stopgo.planner.floors.rings import to_shapely
from tests.faults.sizes import some
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms


def furnished(
    kind: str = "IfcFurniture", *, height: float = 0.5, low: float = 0.0, schema: str = "IFC4"
) -> House:
    """Two rooms with a box of 1 × 2 m in the right one, `height` metres high."""
    house = two_rooms(schema)
    house.box(kind, "thing", (6, 2, low, 7, 4, low + height), house.model.by_type("IfcBuildingStorey")[0])
    return house


def things(floor: FloorPlan, house: House) -> list[Element]:
    return [item for item in floor.elements if item.global_id == house.things["thing"].GlobalId]


def areas(elements: list[Element]) -> Iterator[float]:
    yield from (sum(to_shapely(part).area for part in item.solids) for item in elements)


@pytest.mark.parametrize(
    "kind",
    some(
        [
            *("IfcFurniture", "IfcSystemFurnitureElement", "IfcFurnishingElement", "IfcSanitaryTerminal"),
            *("IfcFlowTerminal", "IfcBoiler", "IfcTransportElement", "IfcDiscreteAccessory"),
            *("IfcElementAssembly", "IfcBuildingElementProxy"),
        ],
        every=3,
    ),
)
def test_what_stands_on_the_floor_is_an_obstacle_and_no_target(kind: str, read: Read) -> None:
    house = furnished(kind)
    (bed,) = things(read(house), house)
    assert list(areas([bed])) == pytest.approx([2.0])
    assert (bed.kind, bed.obstacle, bed.occludes, bed.target) == ("other", True, False, False)


def test_what_reaches_the_scanner_hides_what_is_behind_it(read: Read) -> None:
    house = furnished(height=1.8)
    (cupboard,) = things(read(house), house)
    assert list(areas([cupboard])) == pytest.approx([2.0])
    assert (cupboard.kind, cupboard.obstacle, cupboard.occludes, cupboard.target) == (
        "objects",
        True,
        True,
        False,
    )


def test_a_tray_is_not_driven_over_and_a_lamp_overhead_is_no_obstacle(read: Read) -> None:
    tray, lamp = furnished(height=0.08), furnished(height=0.3, low=2.2)
    assert list(areas(things(read(tray), tray))) == pytest.approx([2.0])
    assert things(read(lamp), lamp) == []


def test_furniture_is_counted_and_can_be_ignored(read: Read) -> None:
    house = furnished()
    (said,) = [item.message for item in read(house).findings if item.code == "furniture"]
    assert said.startswith("1 objects of furniture and equipment are obstacles as modelled (1 IfcFurniture)")
    bare = read(house, furniture="ignore")
    assert things(bare, house) == []
    assert not [item for item in bare.findings if item.code == "furniture"]
    assert bare.source.options["furniture"] == "ignore"


def test_a_class_has_the_kind_that_the_user_gives_it(read: Read) -> None:
    house = furnished("IfcBuildingElementProxy", height=2.5)
    assert [
        item.kind for item in things(read(house, layers={"IFCBUILDINGELEMENTPROXY": "walls"}), house)
    ] == ["walls"]
    (clear,) = things(read(house, layers={"IFCBUILDINGELEMENTPROXY": "other"}), house)
    assert (clear.kind, clear.occludes) == ("other", False)
    assert things(read(house, layers={"IFCBUILDINGELEMENTPROXY": "ignore"}), house) == []


def test_a_predefined_type_can_be_given_a_kind_of_its_own(read: Read) -> None:
    house = furnished()
    house.things["thing"].PredefinedType = "BED"
    assert things(read(house, layers={"IFCFURNITURE.BED": "ignore"}), house) == []
    assert (
        len(things(read(house, layers={"IFCFURNITURE.BED": "objects", "IFCFURNITURE": "ignore"}), house)) == 1
    )


def test_the_survey_names_a_class_that_is_ignored(read: Read, tmp_path: Path) -> None:
    read(furnished())
    found = survey_floor(tmp_path / "house.ifc", FloorOptions(layers={"IFCFURNITURE": "ignore"}))
    assert [
        (item.role, item.taken, item.ignored) for item in found.layers if item.name == "IfcFurniture"
    ] == [("ignore", 0, 1)]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"IFCBED": "ignore"}, r"--layer IFCBED: no element of this class; classes: .*IfcFurniture"),
        (
            {"IFCFURNITURE": "doors"},
            "--layer IFCFURNITURE=doors: not a kind for a class of a model; known: walls",
        ),
    ],
)
def test_a_class_or_a_kind_that_is_none_is_refused(given: dict[str, str], said: str, read: Read) -> None:
    with pytest.raises(InputError, match=said):
        read(furnished(), layers=given)


def test_room_kept_free_for_openings_is_no_solid(read: Read) -> None:
    house = furnished("IfcBuildingElementProxy")
    house.things["thing"].PredefinedType = "PROVISIONFORVOID"
    assert things(read(house), house) == []


def test_a_solid_that_fills_a_room_is_no_outline_of_it(read: Read) -> None:
    house = two_rooms()
    house.box(
        "IfcFurniture", "thing", (4.2, 0.2, 0, 8.0, 4.2, 0.5), house.model.by_type("IfcBuildingStorey")[0]
    )
    (podium,) = things(read(house), house)
    assert list(areas([podium])) == pytest.approx([15.2])


def test_a_passage_with_furniture_in_it_is_still_one(read: Read) -> None:
    house = two_rooms()
    house.model.remove(house.things["door"])
    house.box(
        "IfcFurniture", "thing", (3.9, 1.2, 0, 4.3, 1.6, 0.5), house.model.by_type("IfcBuildingStorey")[0]
    )
    (passage,) = read(house).openings
    assert passage.line[:, 1] == pytest.approx([1.0, 1.9], abs=0.03)
