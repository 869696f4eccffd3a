"""Small files that unpack to very much, or show nothing: one clear line, before the work is done."""

from __future__ import annotations

import zipfile
from pathlib import Path

import ezdxf
import pytest
from ezdxf.document import Drawing

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorOptions, read_floor
from stopgo.planner.floors.drawn_shapes import entities_with_copies, shapes_of
from tests.planner.floors.floor_drawings import rectangle

HALVES = 22


def drawing() -> Drawing:
    made = ezdxf.new()
    made.header["$INSUNITS"] = 6
    return made


def doubled(levels: int) -> Drawing:
    """A block of two blocks of two blocks, and so on: 2 ** levels lines."""
    made = drawing()
    made.blocks.new("B0").add_line((0, 0), (1, 0), dxfattribs={"layer": "WALLS"})
    for level in range(1, levels + 1):
        block = made.blocks.new(f"B{level}")
        for place in ((0, 0), (2**-level, 1)):
            block.add_blockref(f"B{level - 1}", place)
    made.modelspace().add_blockref(f"B{levels}", (0, 0))
    return made


def saved(made: Drawing, folder: Path) -> Path:
    path = folder / "plan.dxf"
    made.saveas(path)
    return path


def test_blocks_in_blocks_are_counted_and_not_expanded(tmp_path: Path) -> None:
    made = doubled(HALVES)
    assert entities_with_copies(made) > 2**HALVES
    with pytest.raises(InputError, match="more than 1000000 entities"):
        read_floor(saved(made, tmp_path))


def test_the_count_is_that_of_the_shapes_and_inserts() -> None:
    made = doubled(3)
    shapes, _ = shapes_of(made, source=Path("plan.dxf"))
    inserts = 1 + 2 + 4 + 8
    assert len(shapes) == 8
    assert entities_with_copies(made) == 8 + inserts


def test_a_block_that_holds_itself_is_counted_once() -> None:
    made = drawing()
    block = made.blocks.new("A")
    block.add_line((0, 0), (1, 0))
    block.add_blockref("A", (1, 1))
    made.modelspace().add_blockref("A", (0, 0))
    assert entities_with_copies(made) == 3


def test_blocks_too_deep_in_one_another_are_refused(tmp_path: Path) -> None:
    made = drawing()
    made.blocks.new("B0").add_line((0, 0), (1, 0), dxfattribs={"layer": "WALLS"})
    for level in range(1, 601):
        made.blocks.new(f"B{level}").add_blockref(f"B{level - 1}", (0, 0))
    made.modelspace().add_blockref("B600", (0, 0))
    with pytest.raises(InputError, match="blocks lie too deep in one another; explode or purge them"):
        read_floor(saved(made, tmp_path))


def test_a_symbol_of_very_many_lines_is_no_walls(tmp_path: Path) -> None:
    """Between 2 500 lines from one point, rooms were searched for minutes, and no signal was heard."""
    made = drawing()
    rectangle(made.modelspace(), "FLOOR", 0, 0, 10, 8)
    for k in range(400):
        made.modelspace().add_line((5, 4), (5 + k / 200, 6), dxfattribs={"layer": "WALLS"})
    with pytest.raises(InputError, match=r"400 lines of walls end at \(5.00, 4.00\), more than 300: that is"):
        read_floor(saved(made, tmp_path))


def test_a_zip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path = tmp_path / "bomb.ifczip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb.ifc", b"ISO-10303-21;" + bytes(60 * 1024**2))
    with pytest.raises(InputError, match=r"bytes unpack to 62914573, as no model does; unzip it first"):
        read_floor(path)


def test_a_drawing_in_paper_space_is_named(tmp_path: Path) -> None:
    made = drawing()
    made.layout("Layout1").add_lwpolyline([(0, 0), (8, 0), (8, 5)], dxfattribs={"layer": "WALLS"})
    with pytest.raises(InputError, match="1 entities are in the paper space 'Layout1': move them"):
        read_floor(saved(made, tmp_path))


def test_a_drawing_in_another_file_is_named(tmp_path: Path) -> None:
    made = drawing()
    made.add_xref_def("plan.dwg", "PLAN")
    made.modelspace().add_blockref("PLAN", (0, 0))
    with pytest.raises(InputError, match=r"only external references \(PLAN\).*bind them"):
        read_floor(saved(made, tmp_path))


def test_a_drawings_number_is_refused_where_layers_show_one_floor(tmp_path: Path) -> None:
    made = drawing()
    for layer in ("FLOOR", "ROOMS"):
        rectangle(made.modelspace(), layer, 0, 0, 8, 5)
    rectangle(made.modelspace(), "WALLS", 0, 0, 8, 0.2)
    made.modelspace().add_line((3, 0.1), (4, 0.1), dxfattribs={"layer": "DOORS"})
    path = saved(made, tmp_path)
    assert read_floor(path).area == pytest.approx(40)
    with pytest.raises(InputError, match="--drawing 7 does not apply"):
        read_floor(path, FloorOptions(drawing=7))
