"""Lengths are metres whatever the drawing unit; the header is doubted where the floor size is absurd."""

from __future__ import annotations

from pathlib import Path

import ezdxf
import numpy as np
import pytest
from ezdxf.layouts import Modelspace
from floor_drawings import Read, codes, new_drawing, rectangle
from unit_drawings import CODES, EVIDENCE, house, rescaled, verdict

from stopgo.mission.errors import InputError
from stopgo.planner.floors import read_floor, survey_floor
from stopgo.planner.floors.linework.swings import swings_of
from stopgo.planner.floors.room_words import names_a_room
from stopgo.planner.floors.units.known_sizes import going_of
from stopgo.planner.floors.written_measures import area_in, is_only_area, length_in
from tests.faults.sizes import size

DATA = Path(__file__).parents[4] / "shared" / "data"
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"the real inputs are not in {DATA}")
DECISIVE = ("header", "header and round wall", "dimensions", "areas")
TELLING = ("doors", "doors and round wall", "bare dimensions", "sides", "wrong header and dimensions")
UNITS = {1: 1 / 0.0254, 2: 1 / 0.3048, 4: 1000.0, 5: 100.0, 6: 1.0, 14: 10.0}


def nothing(model: Modelspace) -> None:
    """Only the floor of 10 by 8."""


@pytest.mark.parametrize("units", UNITS)
def test_every_unit_gives_the_same_floor(read: Read, units: int) -> None:
    plan = read(nothing, units=units, size=UNITS[units])
    assert plan.area == pytest.approx(80)
    assert plan.findings == ()


def test_a_missing_unit_is_read_from_the_floors_size(read: Read) -> None:
    """10 by 8 units are no building in any other unit that drawings have."""
    plan = read(nothing, units=0, size=1.0)
    assert plan.area == pytest.approx(80)
    assert codes(plan) == ["units_missing"]


@pytest.mark.parametrize(
    ("size", "says"),
    [
        (1000.0, r"--units mm \(10 x 8 m, \d+% probable\) or --units cm \(100 x 80 m"),
        (100.0, r"--units in \(25.4 x 20.3 m, \d+% probable\) or --units cm \(10 x 8 m"),
    ],
)
def test_a_missing_unit_that_the_size_leaves_open_is_asked_for(read: Read, size: float, says: str) -> None:
    with pytest.raises(InputError, match=f"the unit is not certain .the header names no unit.; give {says}"):
        read(nothing, units=0, size=size)


@pytest.mark.parametrize("size", [1000.0, 100.0, 1 / 0.0254])
def test_a_missing_unit_is_read_from_doors(read: Read, size: float) -> None:
    def draw(model: Modelspace) -> None:
        for k in (0, 2, 4):
            model.add_line((k * size, 0), ((k + 0.9) * size, 0), dxfattribs={"layer": "DOORS"})

    plan = read(draw, units=0, size=size)
    assert plan.area == pytest.approx(80)
    assert "units_missing" in codes(plan)


def test_a_header_of_miles_is_a_unit_and_doubted(read: Read) -> None:
    plan = read(nothing, units=3, size=1.0)
    assert plan.area == pytest.approx(80)
    assert codes(plan) == ["units_wrong"]
    assert "the header says mile, which makes the floor 1.609e+04 m across" in plan.findings[0].message


def test_a_header_of_millimetres_that_makes_a_house_4_cm_wide_is_doubted(read: Read) -> None:
    with pytest.raises(InputError, match=r"the header says millimetre.; give --units m \(40 x 32 m"):
        read(nothing, units=4, size=4.0)


@pytest.mark.parametrize("kind", EVIDENCE)
def test_no_unit_is_believed_that_is_wrong(tmp_path: Path, kind: str) -> None:
    """Six units; evidence that decides is believed, and only where too little is drawn the user is asked."""
    drawn = [
        verdict(house(seed, code, kind), code, tmp_path / "a.dxf")
        for seed in range(1, 1 + size(short=1, full=2))
        for code in CODES
    ]
    assert "wrong" not in drawn
    asked = drawn.count("asked")
    assert asked <= (0 if kind in DECISIVE else 3 if kind in TELLING else len(drawn))


@real
@pytest.mark.parametrize("kind", ["header", "bare", "no doors"])
@pytest.mark.parametrize("name", ["duplex-l1", "fzk-haus-eg"])
def test_no_unit_of_a_real_floor_is_believed_that_is_wrong(tmp_path: Path, name: str, kind: str) -> None:
    path = DATA / f"layered/{name}.dxf"
    drawn = [verdict(rescaled(path, code, kind), code, tmp_path / "a.dxf") for code in CODES]
    assert "wrong" not in drawn
    assert drawn.count("asked") <= {"header": 0, "bare": 1}.get(kind, len(drawn))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("12'-6 1/2\"", (150.5, "in", 0)),
        ("5' 3\"", (63.0, "in", 0)),
        ("7'", (7.0, "ft", 0)),
        ("450 cm", (450.0, "cm", 0)),
        ("4,50", (4.5, None, 2)),
        ("2700mm", (2700.0, "mm", 0)),
        ("R 30", None),
        ("", None),
    ],
)
def test_a_dimensions_text_is_a_number_and_its_unit(text: str, says: tuple | None) -> None:
    assert length_in(text) == says


def test_areas_written_in_rooms_are_read_in_square_metres_and_feet() -> None:
    assert area_in("Kitchen 30,5 m²") == 30.5
    assert area_in("100 sq ft") == pytest.approx(9.29, abs=0.01)
    assert area_in("Room 12") is None
    assert area_in("12 mm") is None


def test_the_sides_of_a_room_are_an_area_if_both_have_a_unit() -> None:
    assert area_in("Bed 3.2m x 4.0 m") == pytest.approx(12.8)
    assert area_in("14'2'' x 12'4''") == pytest.approx(16.23, abs=0.01)
    assert area_in("3.2 x 4.0") is None
    assert area_in("door 0.9m x 2.1m") is None
    assert is_only_area("30 m²")
    assert not is_only_area("30 m² Lager")


def test_texts_and_the_size_alone_do_not_overrule_a_header(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "A-WALL", 0, 0, 780, 600)
    for k, name in enumerate(("Bedroom", "Kitchen", "Bath", "Living")):
        model.add_text(name, height=8).set_placement((100 + 138 * k, 300))
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match="the unit is not certain"):
        survey_floor(tmp_path / "plan.dxf")


def test_written_areas_between_lines_show_the_unit(tmp_path: Path) -> None:
    drawing = ezdxf.new()
    model = drawing.modelspace()
    for x in (0, 400, 900, 1300):
        model.add_line((x, 0), (x, 500), dxfattribs={"layer": "WALLS"})
    for y in (0, 500):
        model.add_line((0, y), (1300, y), dxfattribs={"layer": "WALLS"})
    for x, said in ((100, "4m x 5m"), (500, "5 m x 5 m"), (1000, "20 m2")):
        model.add_text(said, height=20).set_placement((x, 100))
    drawing.saveas(tmp_path / "plan.dxf")
    assert survey_floor(tmp_path / "plan.dxf").units.startswith("centimetre")


def test_written_sides_of_rooms_with_a_gap_between_them_show_the_unit(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "WALLS", 0, 0, 50, 30)
    for x in (12.5, 25, 37.5):
        model.add_line((x, 15.5), (x, 29.5), dxfattribs={"layer": "WALLS"})
    model.add_line((0.5, 15), (49.5, 15), dxfattribs={"layer": "WALLS"})
    texts = [
        ("LIVING 50.0' x 15.0'", 20, 8),
        *((f"BEDROOM {k} 12.5' x 15.0'", 12.5 * k + 3, 22) for k in range(4)),
    ]
    for text, x, y in texts:
        model.add_text(text, height=1.0, dxfattribs={"layer": "ROOM_LABELS"}).set_placement((x, y))
    drawing.saveas(tmp_path / "plan.dxf")
    units = survey_floor(tmp_path / "plan.dxf").units
    assert units.startswith("foot") and "5 rooms with written sides" in units


def test_pieces_of_furniture_show_whether_leaves_of_60_are_centimetres_or_inches(tmp_path: Path) -> None:
    """Beds and toilets of known size weigh more than the usual width of a leaf."""

    def draw(*, furnished: bool) -> Path:
        drawing = new_drawing(4)
        model = drawing.modelspace()
        rectangle(model, "A-WALL", 0, 0, 1385, 950)
        for k in (1, 2, 3):
            model.add_line((300 * k, 0), (300 * k, 60), dxfattribs={"layer": "A-DOOR"})
            model.add_arc((300 * k, 0), 60, 0, 90, dxfattribs={"layer": "A-DOOR"})
        if furnished:
            for name, length in (("luzko", 200), ("kibel2", 65), ("pralka", 60)):
                block = drawing.blocks.new(name)
                block.add_line((0, 0), (length, length / 2))
                model.add_blockref(name, (100, 100), {"layer": "F"})
        path = tmp_path / f"{furnished}.dxf"
        drawing.saveas(path)
        return path

    with pytest.raises(InputError, match=r"the unit is not certain .*--units cm .*--units in"):
        survey_floor(draw(furnished=False))
    units = survey_floor(draw(furnished=True)).units
    assert units.startswith("centimetre") and "3 pieces of furniture" in units


def test_treads_are_lines_apart_by_one_distance() -> None:
    treads = [np.array([(0.0, 0.27 * k), (1.0, 0.27 * k)]) for k in range(10)]
    assert going_of([*treads, np.array([(0.0, 0.0), (0.0, 2.43)])]) == pytest.approx(0.27)
    assert going_of(treads[:4]) is None
    assert going_of([np.array([(0.0, k * k), (1.0, k * k)]) for k in range(10)]) is None


def test_a_size_and_texts_show_no_unit_of_a_drawing_made_from_a_page(tmp_path: Path) -> None:
    """Points of a page are no unit of length, though names and texts look as if they were inches."""
    drawing = new_drawing(0)
    model = drawing.modelspace()
    rectangle(model, "WALLS", 0, 0, 506, 400)
    for k, name in enumerate(("Bedroom", "Kitchen", "Bathroom", "Living")):
        model.add_text(name, height=9.9).set_placement((20 + 147 * (k % 3), 100 + 147 * (k // 3)))
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match="the unit is not certain"):
        survey_floor(tmp_path / "plan.dxf")


def test_treads_that_contradict_the_walls_leave_the_unit_open(tmp_path: Path) -> None:
    """Walls of 16 and a floor of 16 by 10 m would be centimetres, but treads 10 apart are inches."""
    drawing = new_drawing(0)
    model = drawing.modelspace()
    for x0, y0, x1, y1 in ((0, 0, 1600, 1000), (16, 16, 792, 984), (808, 16, 1584, 984)):
        rectangle(model, "A-WALL", x0, y0, x1, y1)
    for k in range(12):
        model.add_line((100, 100 + 9.8 * k), (140, 100 + 9.8 * k), dxfattribs={"layer": "A-FLOR-STRS"})
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match=r"the unit is not certain .*--units cm"):
        survey_floor(tmp_path / "plan.dxf")


def test_walls_as_thick_in_feet_as_in_metres_leave_the_unit_open(tmp_path: Path) -> None:
    """Walls of 0.33 are 10 or 33 cm thick: only the size tells feet from metres, and needs more."""
    drawing = new_drawing(0)
    model = drawing.modelspace()
    for x0, y0, x1, y1 in ((0, 0, 12.5, 10.2), (0.33, 0.33, 6, 9.87), (6.33, 0.33, 12.17, 9.87)):
        rectangle(model, "A-WALL", x0, y0, x1, y1)
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match=r"the unit is not certain .*--units m .*--units ft"):
        survey_floor(tmp_path / "plan.dxf")


def test_a_door_swing_has_a_leaf_or_ends_at_jambs_and_a_round_corner_has_neither() -> None:
    arc = np.array([(np.cos(t), np.sin(t)) for t in np.linspace(0, np.pi / 2, 13)])
    on = [np.array([(1.0, -3.0), (1.0, 0.0)]), np.array([(0.0, 1.0), (-3.0, 1.0)])]
    leaf = np.array([(0.0, 0.0), (1.0, 0.0)])
    assert len(swings_of([arc])) == 1
    assert swings_of([arc, *on]) == []
    assert len(swings_of([arc, *on, leaf])) == 1
    assert swings_of([np.vstack((on[0][:1], arc, on[1][1:]))]) == []
    assert swings_of([arc, arc * 1.2]) == []
    assert swings_of([arc], drawn_leaf=True) == []


def test_doors_distinguish_centimetres_from_millimetres(read: Read) -> None:
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


@pytest.mark.parametrize("apart", [33.0, 12.5])
def test_a_header_that_puts_kitchen_and_bath_far_apart_is_not_believed(tmp_path: Path, apart: float) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    for k, name in enumerate(("Bedroom", "Kitchen", "Bathroom", "Bedroom 2")):
        rectangle(model, "WALLS", k * apart, 0, (k + 1) * apart, apart * 1.2)
        model.add_text(name, height=1.0).set_placement(((k + 0.4) * apart, apart / 2))
    drawing.saveas(tmp_path / "plan.dxf")
    with pytest.raises(InputError, match="the unit is not certain"):
        read_floor(tmp_path / "plan.dxf")


def test_names_of_rooms_are_whole_words_in_any_case() -> None:
    assert names_a_room("KITCHEN 12 m2", at_home=True)
    assert names_a_room("Büro 1.02") and not names_a_room("Büro 1.02", at_home=True)
    assert not names_a_room("Badger") and not names_a_room("bedrock") and not names_a_room("")
