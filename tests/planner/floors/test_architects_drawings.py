"""Drawings as an architect makes them: what no layer of our names shows is worked out, and reported."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing
from ezdxf.layouts import Modelspace
from floor_drawings import codes, new_drawing, rectangle

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings.layer_kinds import entries_in, kinds_by_name
from stopgo.planner.floors import FloorOptions, read_floor, survey_floor
from stopgo.planner.floors.layer_map import layer_map
from stopgo.planner.floors.layer_names import reading_of


def flat(
    model: Modelspace,
    *,
    walls: str = "A-WALL",
    doors: str = "A-DOOR",
    unit: float = 1.0,
    x: float = 0.0,
    y: float = 0.0,
) -> None:
    """Two rooms of 4 by 5 m and 5 by 5 m in double lines of walls, 0.2 m thick, a door of 0.9 m between."""

    def draw(layer: str, *points: tuple[float, float]) -> None:
        moved = [((x + px) * unit, (y + py) * unit) for px, py in points]
        for a, b in pairwise(moved):
            model.add_line(a, b, dxfattribs={"layer": layer})

    draw(walls, (-0.2, -0.2), (9.4, -0.2), (9.4, 5.2), (-0.2, 5.2), (-0.2, -0.2))
    draw(walls, (0, 0), (4, 0), (4, 2))
    draw(walls, (4, 2.9), (4, 5), (0, 5), (0, 0))
    draw(walls, (9.2, 0), (9.2, 5), (4.2, 5), (4.2, 2.9))
    draw(walls, (4.2, 2), (4.2, 0), (9.2, 0))
    draw(doors, (4.2, 2), (5.1, 2))
    hinge = ((x + 4.2) * unit, (y + 2) * unit)
    model.add_arc(hinge, 0.9 * unit, 0, 90, dxfattribs={"layer": doors})


def saved(drawing: Drawing, folder: Path, name: str = "plan.dxf") -> Path:
    drawing.saveas(folder / name)
    return folder / name


def read(drawn: Drawing, folder: Path, **options: object) -> FloorPlan:
    return read_floor(saved(drawn, folder), FloorOptions(**options))  # type: ignore[arg-type]


def is_the_flat(floor: FloorPlan, *, x: float = 0.0, y: float = 0.0) -> None:
    """Rooms, door, walls and floor of `flat`, in metres."""
    assert sorted(round(room.area, 2) for room in floor.rooms) == [20.0, 25.0]
    (door,) = floor.openings
    assert door.kind == "door"
    assert door.line.tolist() == [pytest.approx([x + 4.1, y + 2]), pytest.approx([x + 4.1, y + 2.9])]
    assert floor.area == pytest.approx(9.6 * 5.4, abs=1e-3)
    walls = sum(solid.area for item in floor.elements if item.kind == "walls" for solid in item.solids)
    assert walls == pytest.approx(9.6 * 5.4 - 20 - 25 - 0.9 * 0.2, abs=1e-3)


def test_walls_as_open_double_lines_with_a_swing_become_rooms_with_a_door(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace())
    floor = read(drawing, tmp_path)
    is_the_flat(floor)
    told = Counter(codes(floor))
    assert {"inferred_floor", "inferred_rooms", "inferred_doors", "layer_by_name"} <= set(told)


@pytest.mark.parametrize(
    ("walls", "doors"),
    [
        ("xref-BLDG$0$A-WALL-FULL", "xref-BLDG$0$A-DOOR"),
        ("A-210-M_Wall", "A-325-M"),
        ("A-21----E-", "A-32----E-"),
        ("Innenwände", "Türen"),
        ("Murs", "Portes"),
        ("MUROS", "PUERTAS"),
        ("Muri", "Porte"),
        ("wanden", "deuren"),
        ("PAREDES", "PORTAS"),
        ("СТЕНЫ", "ДВЕРИ"),
        ("壁", "ドア"),
        ("墙体", "门"),
        ("A-内墙线", "门窗"),
    ],
)
def test_layers_are_known_by_standards_and_in_many_languages(tmp_path: Path, walls: str, doors: str) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace(), walls=walls, doors=doors)
    is_the_flat(read(drawing, tmp_path))


@pytest.mark.parametrize("version", ["R2000", "R2010"])
def test_names_of_layers_are_read_with_either_end_of_line(tmp_path: Path, version: str) -> None:
    drawing = ezdxf.new(version)
    drawing.header["$INSUNITS"] = 6
    drawing.encoding = "cp936"
    flat(drawing.modelspace(), walls="墙体", doors="门")
    path = saved(drawing, tmp_path)
    lines = path.read_bytes().replace(b"\r\n", b"\n")
    for end in (b"\n", b"\r\n"):
        path.write_bytes(lines.replace(b"\n", end))
        is_the_flat(read_floor(path))


@pytest.mark.parametrize("version", ["R12", "R2000"])
@pytest.mark.parametrize(
    ("walls", "doors", "encoding", "codepage"),
    [
        ("WÄNDE", "TÜREN", "cp1252", "ANSI_1252"),
        ("WÄNDE", "TÜREN", "cp1252", None),
        ("СТЕНА", "ДВЕРЬ", "cp1251", "ANSI_1251"),
        ("ŚCIANA", "DRZWI", "cp1250", "ANSI_1250"),
        ("墙体", "门", "gbk", "ANSI_936"),
        ("壁", "ドア", "cp932", "ANSI_932"),
        ("壁", "ドア", "cp932", None),
        ("СТЕНА", "ДВЕРЬ", "utf-8", None),
        ("壁", "ドア", "utf-8", "ANSI_1252"),
    ],
)
def test_names_are_read_in_the_encoding_of_the_file(
    tmp_path: Path, version: str, walls: str, doors: str, encoding: str, codepage: str | None
) -> None:
    """Before R2007 a header names the codepage; scripts write UTF-8 all the same, and some name none."""
    drawing = ezdxf.new(version)
    drawing.header["$INSUNITS"] = 6
    flat(drawing.modelspace(), walls="WALLNAME", doors="DOORNAME")
    path = saved(drawing, tmp_path)
    text = path.read_text("cp1252").replace("WALLNAME", walls).replace("DOORNAME", doors)
    named = "  9\n$DWGCODEPAGE\n  3\nANSI_1252\n"
    assert named in text
    text = text.replace(named, named.replace("ANSI_1252", codepage) if codepage else "")
    path.write_bytes(text.encode(encoding))
    floor = read_floor(path)
    is_the_flat(floor)
    assert any(f"layer {walls} is taken for walls" in item.message for item in floor.findings)


@pytest.mark.parametrize(
    ("name", "role"),
    [
        ("Room - Kitchen", "rooms"),
        ("Room - WC", "rooms"),
        ("room_border", "rooms"),
        ("KITCHEN", "furniture"),
        ("Kitchen Wall", "walls"),
        ("Wall - Kitchen", "walls"),
        ("Küchen-Wand", "walls"),
        ("Stair Wall", "walls"),
        ("Treppenhauswand", "walls"),
        ("Plbg-Toilet Wall Mount - 1ST FLOOR PLAN", "furniture"),
        ("Walls Floor 1", "walls"),
        ("Curtain Wall", "windows"),
        ("Glass Wall", "windows"),
        ("A-FLOR-CASE", "furniture"),
        ("A-FLOR-STRS", "stairs"),
        ("A-WALL-PATT", "walls"),
        ("A-DOOR-IDEN", "ignore"),
        ("A-AREA-IDEN", "names"),
        ("Doors/Windows", "openings"),
        ("Fenster_Türen", "openings"),
        ("Stahlträger", "beams"),
        ("Shelves", "furniture"),
        ("X_ramka_przekroj_sciany", "ignore"),
    ],
)
def test_a_layers_name_is_read_whole_and_its_last_thing_decides(name: str, role: str) -> None:
    found = reading_of(name)
    assert found is not None
    assert found.role == role


def test_printed_advice_on_a_layer_can_be_pasted_into_a_shell(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace(), walls="A210g - Ext Walls")
    told = [item.message for item in read(drawing, tmp_path).findings if item.code == "layer_by_name"]
    assert any("(--layer 'A210g - Ext Walls=KIND' corrects it)" in message for message in told)


@pytest.mark.parametrize("version", ["R12", "R2000", "R2018"])
def test_every_version_reads_the_same(tmp_path: Path, version: str) -> None:
    drawing = ezdxf.new(version)
    flat(drawing.modelspace())
    is_the_flat(read(drawing, tmp_path))


@pytest.mark.parametrize("kind", ["door-block", "leaf"])
def test_a_door_in_a_mirrored_and_scaled_block_is_found(tmp_path: Path, kind: str) -> None:
    """On layer 0 too, if the block's name says door; else by its swing in a gap of the wall."""
    drawing = new_drawing()
    model = drawing.modelspace()
    flat(model, doors="DIM")
    block = drawing.blocks.new(kind)
    block.add_line((0, 0), (0, 1))
    block.add_arc((0, 0), 1, 0, 90)
    model.add_blockref(kind, (4.2, 2.9), dxfattribs={"xscale": -0.9, "yscale": 0.9, "rotation": 90})
    is_the_flat(read(drawing, tmp_path))


def test_a_swing_of_many_small_lines_is_a_swing(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    flat(model, doors="DIM")
    turns = [math.radians(9 * k) for k in range(11)]
    points = [(4.2 + 0.9 * math.cos(turn), 2 + 0.9 * math.sin(turn)) for turn in turns]
    for a, b in zip([(4.2, 2.0), *points], points, strict=False):
        model.add_line(a, b, dxfattribs={"layer": "A-DOOR"})
    is_the_flat(read(drawing, tmp_path))


def test_a_leaf_that_stands_open_along_a_wall_opens_no_wall(tmp_path: Path) -> None:
    """The door leads out of the hall at the end of its wall; open, its leaf lies on the wall next to it."""
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "FLOORING", 0, 0, 8, 6)
    rectangle(model, "A-WALL", 2, 4, 6, 4.2)
    model.add_line((4, 3.97), (4.9, 3.97), dxfattribs={"layer": "A-DOOR"})
    model.add_arc((4, 3.97), 0.9, 270, 360, dxfattribs={"layer": "A-DOOR"})
    floor = read(drawing, tmp_path)
    assert sum(solid.area for item in floor.elements for solid in item.solids) == pytest.approx(0.8)
    assert [item.line[:, 0].round(2).tolist() for item in floor.openings] == [[4.0, 4.0]]


def test_a_gap_between_walls_ends_is_a_passage(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace(), doors="DIM")
    floor = read(drawing, tmp_path)
    assert [item.kind for item in floor.openings] == ["passage"]
    assert len(floor.rooms) == 2
    assert "inferred_passages" in codes(floor)


def test_a_window_in_the_same_gap_lets_nobody_through(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace(), doors="DIM")
    drawing.modelspace().add_line((4.1, 2), (4.1, 2.9), dxfattribs={"layer": "A-GLAZ"})
    floor = read(drawing, tmp_path)
    assert floor.openings == ()
    assert len(floor.rooms) == 2


def test_walls_as_single_lines_stay_lines_and_part_rooms(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "MUR", 0, 0, 9, 5)
    for a, b in (((4, 0), (4, 2)), ((4, 2.9), (4, 5))):
        model.add_line(a, b, dxfattribs={"layer": "MUR"})
    model.add_line((4, 2), (4, 2.9), dxfattribs={"layer": "PORTE"})
    floor = read(drawing, tmp_path)
    assert sorted(room.area for room in floor.rooms) == pytest.approx([20, 25], abs=0.2)
    assert [item.kind for item in floor.openings] == ["door"]


def test_walls_as_hatches_are_solid(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    for x0, y0, x1, y1 in ((0, 0, 9, 0.2), (0, 4.8, 9, 5), (0, 0, 0.2, 5), (8.8, 0, 9, 5)):
        hatch = model.add_hatch(dxfattribs={"layer": "Wand"})
        hatch.paths.add_polyline_path([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    floor = read(drawing, tmp_path)
    assert floor.area == pytest.approx(45, abs=1e-3)
    assert sum(solid.area for item in floor.elements for solid in item.solids) > 5


def test_a_survey_far_from_the_origin_keeps_its_coordinates(tmp_path: Path) -> None:
    drawing = new_drawing(4)
    flat(drawing.modelspace(), unit=1000, x=691_000.0, y=5_334_000.0)
    is_the_flat(read(drawing, tmp_path), x=691_000.0, y=5_334_000.0)


@pytest.mark.parametrize(
    ("header", "unit"), [(1, 1.0), (4, 1 / 0.0254), (0, 1000.0), (6, 1000.0), (5, 1 / 0.3048)]
)
def test_a_wrong_unit_is_found_by_the_doors(tmp_path: Path, header: int, unit: float) -> None:
    drawing = new_drawing(header)
    flat(drawing.modelspace(), unit=unit)
    floor = read(drawing, tmp_path)
    assert floor.area == pytest.approx(9.6 * 5.4, rel=1e-3)
    assert codes(floor).count("units_wrong") + codes(floor).count("units_missing") == 1


def test_round_corners_and_quarter_round_walls_are_walls_and_no_doors(tmp_path: Path) -> None:
    """A hall of 12 by 8 m with a corner of 1.2 m radius and one of 3 m, in double lines."""
    drawing = new_drawing()
    model = drawing.modelspace()
    for out in (0.0, 0.2):
        for a, b in (
            ((0 - out, 3), (0 - out, 8 - 1.2)),
            ((1.2, 8 + out), (12 + out, 8 + out)),
            ((12 + out, 8 + out), (12 + out, 0 - out)),
            ((12 + out, 0 - out), (3, 0 - out)),
        ):
            model.add_line(a, b, dxfattribs={"layer": "A-WALL"})
        model.add_arc((1.2, 6.8), 1.2 + out, 90, 180, dxfattribs={"layer": "A-WALL"})
        model.add_arc((3, 3), 3 + out, 180, 270, dxfattribs={"layer": "A-WALL"})
    floor = read(drawing, tmp_path)
    cut = (1 - math.pi / 4) * (1.4**2 + 3.2**2)
    assert floor.area == pytest.approx(12.4 * 8.4 - cut, abs=0.1)
    assert not floor.openings


def test_a_unit_that_is_given_is_taken_and_an_absurd_one_refused(tmp_path: Path) -> None:
    drawing = new_drawing(0)
    flat(drawing.modelspace(), unit=100)
    assert read(drawing, tmp_path, units="cm").area == pytest.approx(9.6 * 5.4, abs=1e-3)
    with pytest.raises(InputError, match="--units furlong: no such unit; known: mm, cm"):
        read(drawing, tmp_path, units="furlong")


def test_a_corridor_of_kilometres_is_refused(tmp_path: Path) -> None:
    drawing = new_drawing(6)
    flat(drawing.modelspace(), unit=430, doors="DIM")
    with pytest.raises(InputError, match="4128 m across; name another unit"):
        read(drawing, tmp_path, units="m")


def test_walls_of_kilometres_are_refused_whatever_the_unit(tmp_path: Path) -> None:
    """The header says metre, the leaves are of 0.9 m, and the walls go on for 4 km."""
    drawing = new_drawing(6)
    flat(drawing.modelspace())
    drawing.modelspace().add_line((0, 0), (4000, 0), dxfattribs={"layer": "A-WALL"})
    with pytest.raises(InputError, match="walls are 4000 m across, read in metre; say the drawing's unit"):
        read(drawing, tmp_path)


def two_plans(folder: Path, *, doors: str = "A-DOOR") -> Drawing:
    drawing = new_drawing()
    flat(drawing.modelspace())
    flat(drawing.modelspace(), x=20.0, doors=doors)
    return drawing


def test_of_several_drawings_the_one_with_swings_is_the_plan(tmp_path: Path) -> None:
    floor = read(two_plans(tmp_path, doors="DIM"), tmp_path)
    is_the_flat(floor)
    assert "drawings_found" in codes(floor)


def test_of_two_plans_a_person_chooses_one(tmp_path: Path) -> None:
    drawing = two_plans(tmp_path)
    with pytest.raises(InputError, match="2 drawings side by side, choose one with --drawing N"):
        read(drawing, tmp_path)
    is_the_flat(read(drawing, tmp_path, drawing=2), x=20.0)
    is_the_flat(read(drawing, tmp_path, region=(19.0, -1.0, 30.0, 6.0)), x=20.0)
    with pytest.raises(InputError, match="--drawing 3: found are 2"):
        read(drawing, tmp_path, drawing=3)
    with pytest.raises(InputError, match="nothing is drawn in the region 50,50,60,60"):
        read(drawing, tmp_path, region=(50.0, 50.0, 60.0, 60.0))
    told = survey_floor(saved(drawing, tmp_path))
    assert [item.option for item in told.floors] == ["--drawing 1", "--drawing 2"]
    assert told.refusal is not None


def test_furniture_is_an_obstacle_and_notes_are_nothing(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    flat(model)
    for a, b in (((1, 1), (2, 1)), ((2, 1), (2, 2)), ((2, 2), (1, 2)), ((1, 2), (1, 1))):
        model.add_line(a, b, dxfattribs={"layer": "Möbel"})
    model.add_line((0, 2.5), (9, 2.5), dxfattribs={"layer": "Bemaßung"})
    floor = read(drawing, tmp_path)
    (table,) = [item for item in floor.elements if item.kind == "other"]
    assert table.obstacle
    assert table.solids[0].area == pytest.approx(1)
    assert floor.ignored == ()


def test_two_names_in_one_space_part_it_at_its_narrowest(tmp_path: Path) -> None:
    """A hall of 6 by 4 m and a bay next to it behind a mouth of 2 m, wider than any door."""
    drawing = new_drawing()
    model = drawing.modelspace()
    ring = [(0, 0), (6, 0), (6, 1), (9, 1), (9, 3), (6, 3), (6, 4), (0, 4)]
    model.add_lwpolyline(ring, close=True, dxfattribs={"layer": "A-WALL"})
    for text, at in (("HALL", (2, 2)), ("BAY", (8, 2))):
        model.add_text(text, dxfattribs={"layer": "A-AREA-IDEN", "insert": at})
    floor = read(drawing, tmp_path)
    assert {room.name: round(room.area) for room in floor.rooms} == {"HALL": 24, "BAY": 6}
    assert [item.kind for item in floor.openings] == ["passage"]


def test_a_floor_and_walls_alone_get_rooms_and_doors(tmp_path: Path) -> None:
    """The mildest case: our own names, but nobody drew ROOMS or DOORS; what is drawn stays as it is."""
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "FLOOR", -0.2, -0.2, 9.4, 5.2)
    flat(model, walls="WALLS", doors="SWING")
    floor = read(drawing, tmp_path)
    assert sorted(round(room.area, 2) for room in floor.rooms) == [20.0, 25.0]
    assert [item.kind for item in floor.openings] == ["door"]
    assert not any(item.solids for item in floor.elements if item.kind == "walls" and len(item.lines))


def test_a_map_says_the_same_as_the_survey_that_wrote_it(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace())
    drawing.modelspace().add_line((1, 1), (2, 2), dxfattribs={"layer": "TEMP"})
    path = saved(drawing, tmp_path)
    (tmp_path / "layers.toml").write_text(layer_map(survey_floor(path)), encoding="utf-8")
    mapped = kinds_by_name(entries_in(str(tmp_path / "layers.toml")))
    assert mapped == {"A-WALL": "walls", "A-DOOR": "doors", "TEMP": "other"}
    again = read_floor(path, FloorOptions(layer_map=mapped))
    plain = read_floor(path)
    is_the_flat(again)
    assert [part.exterior.tolist() for part in again.outline] == [p.exterior.tolist() for p in plain.outline]
    assert again.source.basis != plain.source.basis


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[layers]\n"A" = "wall"\n', "A = wall: unknown kind; known: floor, rooms"),
        ('[layer]\n"A" = "walls"\n', r"unknown key layer; known: \[layers\]"),
        ("layers\n", "not a TOML file"),
        ("", r"no table \[layers\]"),
    ],
)
def test_a_faulty_map_is_refused_in_one_line(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "layers.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=says):
        entries_in(str(path))
    with pytest.raises(InputError, match="write one with: stopgo floors"):
        entries_in(str(tmp_path / "none.toml"))


def test_walls_that_enclose_nothing_are_refused(tmp_path: Path) -> None:
    drawing = new_drawing()
    rectangle(drawing.modelspace(), "A-WALL", 0, 0, 6, 0.2)
    with pytest.raises(InputError, match="the walls on A-WALL enclose no floor; draw its outline"):
        read(drawing, tmp_path)


def test_walls_left_open_without_a_room_or_a_door_are_refused(tmp_path: Path) -> None:
    """A line from end to end of three walls is no fourth one."""
    drawing = new_drawing()
    outside, inside = ((-0.1, 0), (-0.1, 6.1), (3.1, 6.1), (3.1, 0)), ((3, 0), (3, 6), (0, 6), (0, 0))
    ring = [*outside, *inside, outside[0]]
    for a, b in pairwise(ring):
        drawing.modelspace().add_line(a, b, dxfattribs={"layer": "A-WALL"})
    with pytest.raises(InputError, match="the walls on A-WALL enclose no floor"):
        read(drawing, tmp_path)


def test_a_drawing_all_on_layer_0_is_read_by_its_geometry(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace(), walls="0", doors="0")
    is_the_flat(read(drawing, tmp_path))
    is_the_flat(read(drawing, tmp_path, layers={"0": "walls"}))


def test_a_pattern_of_tiles_is_no_wall(tmp_path: Path) -> None:
    drawing = new_drawing()
    for k in range(16):
        drawing.modelspace().add_line((k, 0), (k, 15), dxfattribs={"layer": "A-WALL"})
        drawing.modelspace().add_line((0, k), (15, k), dxfattribs={"layer": "A-WALL"})
    with pytest.raises(InputError, match="225 cells smaller than a room"):
        read(drawing, tmp_path)


def test_a_large_building_has_as_many_niches_as_a_pattern_has_cells(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    rectangle(model, "A-WALL", 0, 0, 80, 40)
    for k in range(160):
        x, y = 1 + 2 * (k % 39), 5 + 8 * (k // 39)
        rectangle(model, "A-WALL", x, y, x + 1, y + 1)
    assert read(drawing, tmp_path, units="m").area == pytest.approx(3200, rel=1e-3)


def test_an_area_next_to_a_rooms_name_is_no_second_name(tmp_path: Path) -> None:
    drawing = new_drawing()
    model = drawing.modelspace()
    flat(model)
    model.add_line((0, 3), (2.5, 3), dxfattribs={"layer": "A-WALL"})
    for text, at in (("Office", (1, 1)), ("20 m²", (1, 4)), ("Store", (6, 1)), ("25 m²", (6, 4))):
        model.add_text(text, height=0.2, dxfattribs={"layer": "A-AREA-IDEN"}).set_placement(at)
    assert len(read(drawing, tmp_path).rooms) == 2


def test_an_endless_line_is_left_out(tmp_path: Path) -> None:
    drawing = new_drawing()
    flat(drawing.modelspace())
    drawing.modelspace().add_xline((0, 0), (1, 0), dxfattribs={"layer": "A-WALL"})
    drawing.modelspace().add_line((0, 0), (1e300, 0), dxfattribs={"layer": "A-WALL"})
    floor = read(drawing, tmp_path)
    is_the_flat(floor)
    assert "bad_coordinates" in codes(floor)
