"""Walls of drawings whose layers mean nothing: read where geometry and texts show them, else requested."""

from __future__ import annotations

import math
import re
import shlex
from pathlib import Path

import pytest
from ezdxf.layouts import Modelspace
from floor_drawings import new_drawing, rectangle

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.planner.floors import FloorOptions, drawn_shapes, read_floor, survey_floor


def text(model: Modelspace, words: str, x: float, y: float, layer: str = "0") -> None:
    model.add_text(words, height=0.2, dxfattribs={"layer": layer}).set_placement((x, y))


def cells(model: Modelspace, layer: str = "0") -> None:
    """Two rooms of 5 by 6 m (30 m²) and 4 by 6 m (24 m²), drawn as closed single lines."""
    rectangle(model, layer, 0, 0, 5, 6)
    rectangle(model, layer, 5, 0, 9, 6)


def double_walls(model: Modelspace, layer: str = "0") -> None:
    """Rooms of 4 by 5 m and 5 by 5 m between walls of two lines, 0.2 m thick, a gap of 0.9 m between."""
    rectangle(model, layer, -0.2, -0.2, 9.4, 5.2)
    rings = [(0, 0), (4, 0), (4, 2), (4.2, 2), (4.2, 0), (9.2, 0), (9.2, 5), (4.2, 5), (4.2, 2.9), (4, 2.9)]
    model.add_lwpolyline([*rings, (4, 5), (0, 5)], close=True, dxfattribs={"layer": layer})


def read(draw: list[object], folder: Path, **options: object) -> FloorPlan:
    return read_floor(_saved(draw, folder), FloorOptions(**options))  # type: ignore[arg-type]


def _saved(draw: list[object], folder: Path) -> Path:
    drawing = new_drawing()
    for step in draw:
        step(drawing.modelspace())  # type: ignore[operator]
    drawing.saveas(folder / "plan.dxf")
    return folder / "plan.dxf"


def swing(model: Modelspace) -> None:
    """The leaf and the swing of a door in the gap of `double_walls`."""
    model.add_line((4.2, 2), (5.1, 2))
    model.add_arc((4.2, 2), 0.9, 0, 90)


def names(model: Modelspace) -> None:
    text(model, "Office", 1, 1)
    text(model, "Kitchen", 6, 1)


def told(floor: FloorPlan) -> list[str]:
    return [item.message for item in floor.findings if item.code == "walls_by_geometry"]


def test_walls_of_two_lines_with_a_door_swing_on_layer_0_are_walls(tmp_path: Path) -> None:
    floor = read([double_walls, swing], tmp_path)
    assert sorted(round(room.area, 1) for room in floor.rooms) == [20.0, 25.0]
    assert [item.kind for item in floor.openings] == ["door"]
    assert "1 door swing in gaps" in told(floor)[0]
    assert "100% of the lines are walls of two lines" in told(floor)[0]


def test_names_on_layer_0_are_evidence_and_name_the_rooms(tmp_path: Path) -> None:
    floor = read([double_walls, names], tmp_path)
    assert {room.name for room in floor.rooms} == {"Office", "Kitchen"}
    assert "2 rooms have a name in them" in told(floor)[0]


def test_written_areas_that_are_true_show_rooms_of_single_lines(tmp_path: Path) -> None:
    areas = [lambda model: text(model, "30 m²", 1, 1), lambda model: text(model, "24 m2", 6, 1)]
    floor = read([cells, *areas], tmp_path)
    assert sorted(round(room.area) for room in floor.rooms) == [24, 30]
    assert "2 written areas are true of the rooms" in told(floor)[0]


def test_written_areas_that_are_false_speak_against_walls(tmp_path: Path) -> None:
    areas = [lambda model: text(model, "12 m²", 1, 1), lambda model: text(model, "11 m2", 6, 1)]
    with pytest.raises(InputError, match="not enough to show that they are walls"):
        read([double_walls, names, *areas], tmp_path)


def test_rooms_drawn_as_closed_lines_on_their_layer_are_walled(tmp_path: Path) -> None:
    areas = [lambda model: text(model, "30 m²", 1, 1), lambda model: text(model, "24 m2", 6, 1)]
    floor = read([lambda model: cells(model, "room"), *areas], tmp_path)
    assert floor.area == pytest.approx(54, abs=0.2)


@pytest.mark.parametrize("title", ["FRONT ELEVATION", "Section A-A", "Ansicht Nord", "Site plan 1:500"])
def test_a_title_of_another_view_speaks_against_walls(title: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="not enough to show"):
        read([double_walls, swing, names, lambda model: text(model, title, 2, -1)], tmp_path)


def test_rows_of_tables_are_no_walls_with_passages(tmp_path: Path) -> None:
    def hall(model: Modelspace) -> None:
        rectangle(model, "Tent", 0, 0, 20, 12)
        for k in range(9):
            rectangle(model, "Tent", 1 + 2 * k, 0.5, 1.5 + 2 * k, 5.3)
            rectangle(model, "Tent", 1 + 2 * k, 6.7, 1.5 + 2 * k, 11.5)

    with pytest.raises(InputError, match="no layer that shows walls"):
        read([hall], tmp_path)


def test_lines_that_lie_about_speak_against_walls(tmp_path: Path) -> None:
    def strays(model: Modelspace) -> None:
        for k in range(9):
            model.add_line((k, -30), (k, 30))

    with pytest.raises(InputError, match="no layer that shows walls"):
        read([double_walls, swing, strays], tmp_path)


@pytest.mark.parametrize("draw", [[cells], [lambda model: rectangle(model, "0", 0, 0, 20, 30)]])
def test_one_kind_of_evidence_is_not_enough_and_one_option_accepts(draw: list, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="enough to show") as refused:
        read(draw, tmp_path)
    option = re.search(r"; (--layer .*) accepts them", str(refused.value))
    assert option is not None
    name, _, kind = shlex.split(option[1])[1].partition("=")
    assert read(draw, tmp_path, layers={name.upper(): kind}).area > 50


def test_walls_that_were_drawn_on_the_columns_layer_are_found(tmp_path: Path) -> None:
    floor = read([lambda model: double_walls(model, "COLUMNS"), swing], tmp_path)
    assert sorted(round(room.area, 1) for room in floor.rooms) == [20.0, 25.0]


def test_a_corner_between_walls_is_not_the_floor(tmp_path: Path) -> None:
    def few(model: Modelspace) -> None:
        rectangle(model, "WALLS", 1, 4, 2.5, 5)
        rectangle(model, "WALLS", 4, 0, 4.2, 2)
        model.add_line((-0.2, -0.2), (9.4, -0.2), dxfattribs={"layer": "WALLS"})

    floor = read([few, lambda model: double_walls(model, "CONCRETE-COLUMN"), swing, names], tmp_path)
    assert floor.area > 40
    with pytest.raises(InputError, match="the walls on WALLS enclose no floor"):
        read([few], tmp_path)


def test_the_option_of_a_layer_with_spaces_can_be_pasted(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--layer 'My lines=walls' accepts them"):
        read([lambda model: cells(model, "My lines")], tmp_path)


def test_one_option_gives_layers_and_unit_where_both_are_missing(tmp_path: Path) -> None:
    def far(model: Modelspace) -> None:
        model.doc.header["$INSUNITS"] = 0
        for k, x in enumerate((0, 25, 50, 75)):
            rectangle(model, f"Room_{k}", x, 0, x + 25, 30)

    with pytest.raises(InputError, match="and the unit is not certain; give ") as refused:
        read([far], tmp_path)
    first = str(refused.value).partition("; give ")[2].partition(" (")[0]
    pasted = shlex.split(first)
    assert pasted[:8:2] == ["--layer"] * 4
    assert pasted[1:8:2] == [f"Room_{k}=walls" for k in range(4)]
    assert pasted[8] == "--units"
    layers = {f"ROOM_{k}": "walls" for k in range(4)}
    assert read([far], tmp_path, layers=layers, units=pasted[9]).area > 5


def test_no_command_is_offered_that_gives_no_floor(tmp_path: Path) -> None:
    def open_lines(model: Modelspace) -> None:
        model.doc.header["$INSUNITS"] = 0
        for k in range(3):
            model.add_line((0, 40 * k), (100, 40 * k), dxfattribs={"layer": "L"})

    with pytest.raises(InputError, match="say which one holds the walls"):
        read([open_lines], tmp_path)


def test_walls_are_found_among_layers_of_other_lines(tmp_path: Path) -> None:
    def frame(model: Modelspace) -> None:
        rectangle(model, "SHEET", -3, -3, 13, 9)
        for k in range(6):
            model.add_line((-3, -3 + k / 5), (13, -3 + k / 5), dxfattribs={"layer": "SHEET"})

    floor = read([lambda model: double_walls(model, "L1"), swing, names, frame], tmp_path)
    assert sorted(round(room.area, 1) for room in floor.rooms) == [20.0, 25.0]


def test_walls_that_were_drawn_on_the_doors_layer_are_found(tmp_path: Path) -> None:
    def stub(model: Modelspace) -> None:
        rectangle(model, "WALLS-NEW", 2, -0.2, 2.2, 0)

    steps = [stub, lambda model: double_walls(model, "DOORS-X"), swing, names]
    floor = read(steps, tmp_path)
    assert sorted(round(room.area, 1) for room in floor.rooms) == [20.0, 25.0]


def test_the_survey_of_doubtful_walls_keeps_the_lines_and_the_remedy(tmp_path: Path) -> None:
    found = survey_floor(_saved([cells], tmp_path), FloorOptions())
    assert found.refusal is not None
    assert "--layer 0=walls accepts them" in found.refusal
    assert len(found.lines) == 2


def test_the_unit_of_a_drawing_without_walls_is_not_asked_for(tmp_path: Path) -> None:
    drawing = new_drawing(units=0)
    drawing.modelspace().add_circle((0, 0), 4)
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match="no layer that shows walls"):
        read_floor(tmp_path / "plan.dxf", FloorOptions())


def test_areas_in_rings_of_different_numbers_of_points_are_compared(tmp_path: Path) -> None:
    def rings(model: Modelspace) -> None:
        rectangle(model, "A-WALL", 0, 0, 5, 6)
        corners = [(5, 0), (9, 0), (9, 6), (7, 6), (5, 6)]
        model.add_lwpolyline(corners, close=True, dxfattribs={"layer": "A-WALL"})
        text(model, "30 m²", 1, 1)

    assert read([rings], tmp_path).area == pytest.approx(54, abs=0.2)


def test_rooms_with_rooms_names_and_a_door_are_walls_though_written_as_one_line(tmp_path: Path) -> None:
    floor = read([three_rooms, three_names], tmp_path)
    assert "3 rooms have the name of a room in them" in told(floor)[0]
    assert {room.name for room in floor.rooms} == {"Kitchen", "Bad", "Salon"}


def test_names_of_rooms_without_any_door_are_not_enough(tmp_path: Path) -> None:
    closed = [cells, lambda model: rectangle(model, "0", 9, 0, 13, 6)]
    labels = [lambda model, at=at, name=name: text(model, name, *at) for at, name in NAMED]
    with pytest.raises(InputError, match="not enough to show that they are walls"):
        read([*closed, *labels], tmp_path)


NAMED = [((1.0, 1.0), "Kitchen"), ((6.0, 1.0), "Bad"), ((10.5, 1.0), "Salon")]


def three_names(model: Modelspace) -> None:
    for at, name in NAMED:
        text(model, name, *at)


def three_rooms(model: Modelspace) -> None:
    """Three rooms of 5, 4 and 4.5 m between single lines; each wall has a door of 0.9 m, 15 degrees open."""
    rectangle(model, "0", 0, 0, 13.5, 6)
    for x in (5, 9):
        model.add_line((x, 0), (x, 2))
        model.add_line((x, 2.9), (x, 6))
        ajar(model, x, 2)


def ajar(model: Modelspace, x: float, y: float, radius: float = 0.9) -> None:
    """A leaf from the hinge at x, y, 15 degrees off the wall upward, and its short arc."""
    model.add_line((x, y), (x + radius * math.sin(math.radians(15)), y + radius * math.cos(math.radians(15))))
    model.add_arc((x, y), radius, 75, 90)


def test_a_door_drawn_ajar_is_a_door(tmp_path: Path) -> None:
    floor = read([double_walls, lambda model: ajar(model, 4.2, 2)], tmp_path)
    assert [item.kind for item in floor.openings] == ["door"]
    assert "1 door swing in gaps" in told(floor)[0]


def test_a_short_arc_without_a_leaf_is_no_door(tmp_path: Path) -> None:
    floor = read([double_walls, names, lambda model: model.add_arc((4.2, 2), 0.9, 75, 90)], tmp_path)
    assert [item.kind for item in floor.openings] == ["passage"]


def test_the_survey_says_that_layers_were_found_by_the_line_work(tmp_path: Path) -> None:
    found = survey_floor(_saved([double_walls, swing], tmp_path))
    assert [item.why for item in found.layers] == ["by the line work: no name shows it"]
    given = survey_floor(_saved([double_walls, swing], tmp_path), FloorOptions(layers={"0": "walls"}))
    assert [item.why for item in given.layers] == ["as given"]


def test_a_drawing_is_walked_once_however_many_layers_are_tried(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walks = []
    walk = drawn_shapes._OutlineWalk
    monkeypatch.setattr(drawn_shapes, "_OutlineWalk", lambda drawing: walks.append(1) or walk(drawing))
    layers = [lambda model, name=name: rectangle(model, name, 0, 0, 8, 8) for name in ("P", "Q", "R")]
    survey_floor(_saved([*layers, lambda model: double_walls(model, "K7")], tmp_path))
    assert walks == [1]
