"""A storey of a model becomes a floor: its slab, rooms, doors, and what stands and hangs on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import ring_area
from stopgo.planner.floors import FloorOptions, read_floor, survey_floor
from tests.planner.floors.ifc.conftest import Read
from tests.planner.floors.ifc.house import House, two_rooms


def area_of(floor: FloorPlan, kind: str) -> float:
    found = [part for item in floor.elements if item.kind == kind for part in item.solids]
    return sum(abs(ring_area(part.exterior)) - sum(abs(ring_area(h)) for h in part.holes) for part in found)


def named(floor: FloorPlan, house: House, name: str) -> list[str]:
    return [item.kind for item in floor.elements if item.global_id == house.things[name].GlobalId]


def test_a_storey_has_its_slab_rooms_and_elements(read: Read) -> None:
    house = two_rooms()
    floor = read(house)
    assert floor.area == pytest.approx(8.2 * 4.4)
    assert [(room.name, round(room.area, 6)) for room in floor.rooms] == [("left", 15.2), ("right", 15.2)]
    walls = 2 * 8.2 * 0.2 + 3 * 4 * 0.2 - 2 * 0.2 - 0.9 * 0.2  # the window and the door are cut out
    assert area_of(floor, "walls") == pytest.approx(walls)
    assert area_of(floor, "columns") == pytest.approx(0.16)
    assert area_of(floor, "beams") == pytest.approx(3.8 * 0.3)
    assert area_of(floor, "windows") == pytest.approx(2 * 0.04)
    assert floor.source.storey == "EG"
    assert floor.level == "EG"


def test_every_element_room_and_door_keeps_its_global_id(read: Read) -> None:
    house = two_rooms()
    floor = read(house)
    assert {room.global_id for room in floor.rooms} == {
        house.things[name].GlobalId for name in ("left", "right")
    }
    assert named(floor, house, "column") == ["columns"]
    assert [item.global_id for item in floor.openings] == [house.things["door"].GlobalId]
    assert all(item.global_id for item in floor.elements)


def test_a_sill_below_the_scanner_is_in_the_robots_way_and_hides_nothing(read: Read) -> None:
    house = two_rooms()
    low = read(house)
    sill = [item for item in low.elements if item.kind == "railings"]
    assert {item.global_id for item in sill} == {house.things["south"].GlobalId}
    assert area_of(low, "railings") == pytest.approx(2 * 0.2 - 2 * 0.04, abs=1e-3)
    assert not any(item.occludes for item in sill)
    assert area_of(read(house, scan_height=0.6), "railings") == pytest.approx(0)


def test_a_door_lies_across_its_opening_in_the_middle_of_the_wall(read: Read) -> None:
    (door,) = read(two_rooms()).openings
    assert door.kind == "door"
    assert np.allclose(door.line, [[4.1, 1.0], [4.1, 1.9]], atol=1e-6)


def test_without_spaces_rooms_are_worked_out_from_walls_and_doors(read: Read) -> None:
    floor = read(two_rooms(spaces=False))
    areas = sorted(room.area for room in floor.rooms)
    assert areas == pytest.approx([15.2 - 0.16, 15.2], abs=0.02)
    assert "rooms_derived" in {item.code for item in floor.findings}


def test_without_a_slab_the_floor_is_taken_from_the_rooms_and_the_walls_between(read: Read) -> None:
    floor = read(two_rooms(slab=False))
    assert floor.area == pytest.approx(8.2 * 4.4)
    assert "floor_from_rooms" in {item.code for item in floor.findings}


def test_walls_alone_give_floor_and_rooms(read: Read) -> None:
    floor = read(two_rooms(slab=False, spaces=False))
    assert floor.area == pytest.approx(8.2 * 4.4, abs=0.1)
    assert len(floor.rooms) == 2
    assert "floor_from_walls" in {item.code for item in floor.findings}


def test_an_opening_without_a_door_is_a_passage(read: Read) -> None:
    house = two_rooms()
    house.model.remove(house.things["door"])
    (passage,) = read(house).openings
    assert passage.kind == "passage"
    assert np.allclose(passage.line, [[4.1, 1.0], [4.1, 1.9]], atol=0.03)


def test_rooms_that_share_a_border_are_joined_where_nothing_stands(read: Read) -> None:
    """Two spaces of 2 × 2 m in one hall: the border at x = 2 is open from y = 0 to 2."""
    house = House()
    ground = house.storey("EG", 0.0)
    house.box("IfcSlab", "slab", (0, 0, -0.2, 4, 2, 0), ground)
    house.box("IfcWall", "south", (0, -0.2, 0, 4, 0, 2.8), ground)
    house.box("IfcSpace", "a", (0, 0, 0, 2, 2, 2.8), ground)
    house.box("IfcSpace", "b", (2, 0, 0, 4, 2, 2.8), ground)
    (passage,) = read(house).openings
    assert passage.line[:, 0] == pytest.approx([2, 2])
    assert np.ptp(passage.line[:, 1]) == pytest.approx(2, abs=0.2)


def test_a_gross_area_over_all_rooms_is_no_room(read: Read) -> None:
    house = two_rooms()
    house.box("IfcSpace", "gross", (0, 0, 0, 8.2, 4.4, 2.8), house.model.by_type("IfcBuildingStorey")[0])
    floor = read(house)
    assert [room.name for room in floor.rooms] == ["left", "right"]
    assert "spaces_overlap" in {item.code for item in floor.findings}


def test_a_storey_on_another_level_than_its_slab_is_found_by_its_slab(read: Read) -> None:
    house = House()
    upper = house.storey("OG", 3.05)
    house.box("IfcSlab", "slab", (0, 0, 2.8, 6, 5, 3), upper)
    house.box("IfcWall", "wall", (0, 0, 3, 6, 0.2, 5.8), upper)
    floor = read(house, storey="OG")
    assert floor.area == pytest.approx(30)
    assert area_of(floor, "walls") == pytest.approx(1.2)


def test_the_floor_is_the_uppermost_layer_of_its_slab(read: Read) -> None:
    house = two_rooms()
    house.box("IfcSlab", "screed", (0, 0, 0, 8.2, 4.4, 0.08), house.storey("Screed", 0.0))
    house.box("IfcSlab", "blinding", (0, 0, -0.5, 8.2, 4.4, -0.3), house.storey("Blinding", 0.0))
    floor = read(house, storey="EG")
    assert floor.ceiling_m == pytest.approx(3.0 - 0.08)
    assert floor.area == pytest.approx(8.2 * 4.4, rel=1e-3)


def test_a_drawn_twice_wall_is_there_once(read: Read) -> None:
    house = two_rooms()
    house.box("IfcWall", "copy", (0, 4.2, 0, 8.2, 4.4, 2.8), house.model.by_type("IfcBuildingStorey")[0])
    floor = read(house)
    assert sum(item.code == "duplicate" for item in floor.findings) == 1


def test_a_model_without_storeys_is_read_at_a_level(read: Read) -> None:
    house = House()
    house.box("IfcSlab", "slab", (0, 0, 9.8, 6, 5, 10))
    house.box("IfcWall", "wall", (0, 0, 10, 6, 0.2, 13))
    with pytest.raises(
        InputError, match=r"no storeys; give the level of the floor with --level Z .*are at 10 m"
    ):
        read(house, storey=None)
    assert read(house, storey=None, level=10.0).area == pytest.approx(30)


def test_a_storey_that_is_not_there_names_those_that_are(read: Read) -> None:
    with pytest.raises(InputError, match=r"has no storey 'UG'; it has 'EG' \(\+0.00 m\), 'OG' \(\+3.00 m\)"):
        read(two_rooms(), storey="UG")


def test_a_storey_is_found_by_part_of_its_name_or_by_its_level(read: Read) -> None:
    house = two_rooms()
    assert read(house, storey="eg").source.storey == "EG"
    assert read(house, storey=None, level=0.1).source.storey == "EG"


def test_a_level_that_is_not_the_storeys_is_refused(read: Read) -> None:
    house = two_rooms()
    with pytest.raises(InputError, match=r"--storey EG lies at 0 m, not at --level 5; remove one of them"):
        read(house, level=5.0)
    assert read(house, level=0.1).source.storey == "EG"


def test_the_roof_is_no_floor_that_is_planned_without_a_request(read: Read, tmp_path: Path) -> None:
    house = two_rooms()
    assert read(house, storey=None).source.storey == "EG"
    found = survey_floor(tmp_path / "house.ifc")
    assert [(item.name, item.aside, item.chosen) for item in found.floors] == [
        ("EG", False, True),
        ("OG", True, False),
    ]
    assert found.floors[0].elements["rooms"] == 2


def test_ifc2x3_is_read_as_ifc4(read: Read) -> None:
    assert read(two_rooms("IFC2X3")).area == read(two_rooms()).area


def test_a_model_in_another_process_is_the_same_and_is_kept(models: Path, tmp_path: Path) -> None:
    path = two_rooms().write(tmp_path / "house.ifc")
    options = FloorOptions(storey="EG")
    first, kept = read_floor(path, options), sorted(models.iterdir())
    second = read_floor(path, options)
    assert sorted(models.iterdir()) == kept
    assert np.array_equal(first.rooms[0].polygons[0].exterior, second.rooms[0].polygons[0].exterior)
    assert kept[-1].stat().st_size > 0
