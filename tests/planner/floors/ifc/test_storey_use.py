"""Storeys are planned for the floor that people can stand on; each of the others has its reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from stopgo.mission.errors import InputError
from stopgo.planner.floors import survey_floor
from stopgo.planner.floors.survey import FloorChoice
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import Box, House, two_rooms


def floors_of(read: Read, house: House, folder: Path) -> list[FloorChoice]:
    """The floors of a house; the first storey is read so that the model is made in this process."""
    name = house.model.by_type("IfcBuildingStorey")[0].GlobalId
    read(house, storey=name)
    return list(survey_floor(folder / "house.ifc").floors)


def reasons(read: Read, house: House, folder: Path) -> dict[str, str]:
    return {item.name: item.reason for item in floors_of(read, house, folder)}


def walled(house: House, name: str, z: float, *, x: float = 0.0, height: float = 2.8) -> None:
    """A storey with a slab of 8 × 6 m and a wall of 0.2 m all around."""
    storey = house.storey(name, z)
    house.box("IfcSlab", f"slab {name}", (x, 0, z - 0.2, x + 8, 6, z), storey, PredefinedType="FLOOR")
    sides: tuple[Box, ...] = (
        (x, 0, z, x + 8, 0.2, z + height),
        (x, 5.8, z, x + 8, 6, z + height),
        (x, 0.2, z, x + 0.2, 5.8, z + height),
        (x + 7.8, 0.2, z, x + 8, 5.8, z + height),
    )
    for number, side in enumerate(sides):
        house.box("IfcWall", f"wall {number} {name}", side, storey)


def roofed(house: House, z: float, *, x: float = 0.0) -> None:
    house.box("IfcSlab", f"roof {x}", (x, 0, z, x + 8, 6, z + 0.2), None, PredefinedType="ROOF")


def test_half_levels_next_to_each_other_are_both_planned(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "low", 0.0)
    walled(house, "high", 1.26, x=8.0)
    roofed(house, 2.8)
    roofed(house, 4.06, x=8.0)
    assert reasons(read, house, tmp_path) == {"low": "", "high": ""}


def test_a_crawl_space_has_no_head_room(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "crawl", -1.26, height=1.06)
    walled(house, "EG", 0.0)
    roofed(house, 2.8)
    found = reasons(read, house, tmp_path)
    assert found == {"crawl": "head room of 1.9 m over 0 of its 48 m²: nobody walks there", "EG": ""}


def test_eaves_above_a_storey_do_not_make_it_a_crawl_space(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "EG", 0.0)
    walled(house, "attic", 3.0)
    house.storey("eaves", 4.26)
    roofed(house, 5.8)
    found = reasons(read, house, tmp_path)
    assert found["EG"] == found["attic"] == ""
    assert "nothing to stand on" in found["eaves"]


def test_the_upper_part_of_a_hall_is_no_floor(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "hall", 0.0, height=6.0)
    house.storey("gallery", 3.0)
    roofed(house, 6.0)
    assert "nothing to stand on" in reasons(read, house, tmp_path)["gallery"]


def test_a_storey_under_construction_is_no_roof(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "EG", 0.0)
    walled(house, "OG", 3.0)
    floors = floors_of(read, house, tmp_path)
    assert [item.aside for item in floors] == [False, False]
    assert "under construction" in floors[1].notes[0]


def test_a_roof_with_a_parapet_stays_a_roof(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "EG", 0.0)
    walled(house, "top", 3.0, height=1.1)
    assert "a roof" in reasons(read, house, tmp_path)["top"]


def test_an_only_storey_is_planned_though_nothing_is_above_it(read: Read) -> None:
    house = House()
    ground = house.storey("EG", 0.0)
    house.box("IfcSlab", "slab", (0, 0, -0.2, 8, 6, 0), ground)
    assert read(house, storey=None).area == pytest.approx(48)


def test_a_basement_that_a_stair_reaches_is_no_foundation(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "UG", -3.0)
    walled(house, "EG", 0.0)
    house.door("door", house.things["wall 0 EG"], (3, -0.1, 0, 4, 0.3, 2.1), None)
    roofed(house, 2.8)
    assert "a foundation" in reasons(read, house, tmp_path)["UG"]
    house.box("IfcStairFlight", "stair", (1, 1, -3, 2, 4, 0), None)
    assert reasons(read, house, tmp_path)["UG"] == ""


def test_a_floor_that_no_storey_names_is_listed_with_its_level(read: Read, tmp_path: Path) -> None:
    house = House()
    walled(house, "hall", 0.0, height=6.0)
    house.box("IfcSlab", "mezzanine", (0.2, 0.2, 2.8, 4.2, 5.8, 3.0), None, PredefinedType="FLOOR")
    roofed(house, 6.0)
    hall, mezzanine = floors_of(read, house, tmp_path)
    assert hall.reason == ""
    assert (mezzanine.option, mezzanine.reason) == ("--level 3", "no storey of the model names this floor")
    assert mezzanine.area_m2 == pytest.approx(4 * 5.6)


def test_storeys_of_equal_and_empty_names_can_be_chosen(read: Read, tmp_path: Path) -> None:
    house = House()
    for name, z in (("flat", 0.0), ("flat", 3.0), ("", 6.0)):
        walled(house, name, z)
    floors = floors_of(read, house, tmp_path)
    assert [item.name for item in floors] == ["flat (+0.00 m)", "flat (+3.00 m)", "storey (+6.00 m)"]
    assert [read(house, storey=item.name).level for item in floors] == [item.name for item in floors]
    last = house.model.by_type("IfcBuildingStorey")[2].GlobalId
    assert read(house, storey=last).level == "storey (+6.00 m)"
    with pytest.raises(InputError, match=r"several: 'flat \(\+0.00 m\)', 'flat \(\+3.00 m\)'; name one in"):
        read(house, storey="flat")


def test_a_merged_storey_has_the_name_of_the_one_with_rooms(read: Read) -> None:
    house = two_rooms()
    framing = house.storey("Framing", 0.0)
    for k in range(20):
        house.box("IfcMember", f"batten {k}", (0.3 + k / 5, 0.3, 2.5, 0.35 + k / 5, 4, 2.6), framing)
    assert read(house, storey="Framing").level == "EG"


def test_a_merged_storey_is_chosen_by_either_name(read: Read) -> None:
    house = two_rooms()
    house.storey("FFL", 0.01)
    assert read(house, storey="FFL").level == read(house, storey="EG").level == "EG"
