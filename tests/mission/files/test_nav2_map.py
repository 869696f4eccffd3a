"""A floor as a map of Nav2 and its mask, checked pixel by pixel and by the reader of robots' maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stopgo.command_line import main
from stopgo.mission.errors import InputError
from stopgo.mission.files.nav2_map import FREE, OCCUPIED, UNKNOWN, MapFiles, nav2_map
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import FloatArray, Polygon
from stopgo.planner.floors import FloorOptions, read_floor

SAMPLE = Path(__file__).parents[3] / "recordings" / "samples" / "office.dxf"


def floor_of(*elements: Element, hole: tuple[FloatArray, ...] = ()) -> FloorPlan:
    outline = Polygon.of([(0, 0), (4, 0), (4, 2), (0, 2)], hole)
    source = read_floor(SAMPLE, FloorOptions()).source
    return FloorPlan(name="hall", source=source, outline=(outline,), elements=elements)


def grey_at(made: MapFiles, picture: bytes, x: float, y: float) -> int:
    magic, size, most, pixels = picture.split(b"\n", 3)
    columns, rows = map(int, size.split())
    assert (magic, most, len(pixels)) == (b"P5", b"255", columns * rows)
    column = int((x - made.origin[0]) / made.resolution)
    row = rows - 1 - int((y - made.origin[1]) / made.resolution)
    return pixels[row * columns + column]


def test_floor_is_free_elements_are_occupied_and_the_rest_is_unknown_or_kept_out() -> None:
    column = Polygon.of([(1.0, 0.5), (1.3, 0.5), (1.3, 0.8), (1.0, 0.8)])
    rail = np.array([(3.02, 0.2), (3.02, 1.8)])
    shaft = np.array([(2.0, 1.0), (2.4, 1.0), (2.4, 1.4), (2.0, 1.4)])
    made = nav2_map(floor_of(
        Element("c", "columns", (column,), occludes=True),
        Element("r", "railings", lines=(rail,), obstacle=True),
        Element("b", "beams", (Polygon.of([(0, 0), (4, 0), (4, 1)]),)), hole=(shaft,),
    ))  # fmt: skip
    expected = {
        (0.5, 0.5): (FREE, FREE), (1.15, 0.65): (OCCUPIED, OCCUPIED), (3.02, 1.0): (OCCUPIED, OCCUPIED),
        (2.2, 1.2): (UNKNOWN, OCCUPIED), (-0.3, 1.0): (UNKNOWN, OCCUPIED), (3.5, 0.4): (FREE, FREE),
    }  # fmt: skip
    for (x, y), greys in expected.items():
        assert (grey_at(made, made.map, x, y), grey_at(made, made.mask, x, y)) == greys, (x, y)


def test_a_ring_of_wall_leaves_the_floor_inside_free() -> None:
    wall = Polygon.of(
        [(1, 0.4), (3, 0.4), (3, 1.6), (1, 1.6)], [[(1.2, 0.6), (2.8, 0.6), (2.8, 1.4), (1.2, 1.4)]]
    )
    made = nav2_map(floor_of(Element("w", "walls", (wall,), occludes=True, obstacle=True)))
    assert grey_at(made, made.map, 2.0, 1.0) == FREE
    assert grey_at(made, made.map, 1.1, 1.0) == OCCUPIED


def test_a_floor_too_large_for_a_picture_is_refused() -> None:
    with pytest.raises(InputError, match="pixels of 1e-05 m are too many"):
        nav2_map(floor_of(), 1e-5)


def test_the_sample_office_is_the_same_floor_when_its_map_is_read(tmp_path: Path) -> None:
    assert main(["convert", str(SAMPLE), "-o", str(tmp_path / "office.yaml")]) == 0
    drawn, read = read_floor(SAMPLE, FloorOptions()), read_floor(tmp_path / "office.yaml", FloorOptions())
    assert read.area == pytest.approx(drawn.area, rel=0.03)
    assert {path.name for path in tmp_path.iterdir()} == {
        "office.yaml", "office.pgm", "office.keepout.yaml", "office.keepout.pgm",
    }  # fmt: skip
