"""Floods of lines and texts: each step takes time and memory as their number, or a count refuses them."""

from __future__ import annotations

import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.entities import Text
from numpy.typing import NDArray

from stopgo.mission.errors import InputError
from stopgo.planner.floors import FloorFile, FloorOptions, drawings, read_floor
from stopgo.planner.floors import robot_map as robot_map_reader
from stopgo.planner.floors.drawings import DrawingFound, drawings_in
from stopgo.planner.floors.drawn import Open, drawn
from stopgo.planner.floors.dxf_sheet import drawings_text
from stopgo.planner.floors.ifc.loading import _unzipped
from stopgo.planner.floors.lines_and_texts import Stroke
from stopgo.planner.floors.linework import patterns, swings
from stopgo.planner.floors.robot_map import cell_regions, grey_picture
from stopgo.planner.floors.robot_map.description import MapDescription
from stopgo.planner.floors.robot_map.grey_picture import GreyPicture, read_picture
from stopgo.planner.floors.units import room_texts, unit_evidence
from stopgo.planner.space.opening_joins import PROBES, _sides


def line(*points: tuple[float, float], role: str = "walls") -> Stroke:
    return Stroke(np.array(points, dtype=float), "A-WALL", role)


def test_lines_side_by_side_are_drawings_in_little_memory() -> None:
    """Drawings 8 m apart: their boxes were compared in a table of all with all."""
    count = 4000
    strokes = [line((8.0 * k, 0.0), (8.0 * k + 4, 0.0)) for k in range(count)]
    tracemalloc.start()
    found = drawings_in(strokes)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert [item.box[0] for item in found] == [8.0 * k for k in range(count)]
    assert peak < 30e6


def test_drawings_whose_boxes_overlap_are_one_in_any_portion(monkeypatch: pytest.MonkeyPatch) -> None:
    """An L around a line, and a third that overlaps only the box of both; two stand alone."""
    angle = line((0, 0), (20, 0), (20, 20))
    strokes = [line((3, 10), (7, 10)), angle, line((40, 0), (45, 0)), line((50, 0), (55, 0))]
    for at_once in (1, 2, 200):
        monkeypatch.setattr(drawings, "AT_ONCE", at_once)
        assert [item.box for item in drawings_in(strokes)] == [
            (0.0, 0.0, 20.0, 20.0),
            (40.0, 0.0, 45.0, 0.0),
            (50.0, 0.0, 55.0, 0.0),
        ]


def test_lines_longer_than_any_building_are_sampled_at_a_limited_number_of_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drawings, "MOST_SAMPLES", 1000)
    points, number = drawings._sampled([np.array([(0.0, 0.0), (9000.0, 0.0)])] * 20)
    assert len(points) <= 1000
    assert np.bincount(number).tolist() == [50] * 20


def test_of_very_many_drawings_the_first_are_listed() -> None:
    text = drawings_text([DrawingFound((0, 0, 5, 5), 20.0, 0, {})] * 1000)
    assert text.endswith("; and 980 more")
    assert text.count("5.0 x 5.0 m") == 20


def test_lines_without_length_are_left_out_without_comparing_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each line was looked for among those without length."""

    def compared(one: Open, other: object) -> bool:
        raise AssertionError("lines were compared with one another")

    monkeypatch.setattr(Open, "__eq__", compared)
    points = [line((k, 0), (k + 1e-5, 0)) for k in range(5)]
    found = drawn([*points, line((0, 1), (5, 1))])
    assert len(found.open) == 1
    assert len(found.dropped) == 5


def test_only_some_of_very_many_written_sides_are_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lines around a text are sought among all lines of the drawing."""
    measured = []
    span = room_texts._span

    def counted(segments: NDArray[np.float64], x: float, y: float) -> float:
        measured.append((x, y))
        return span(segments, x, y)

    monkeypatch.setattr(room_texts, "MOST_LABELS", 10)
    monkeypatch.setattr(room_texts, "_span", counted)
    drawing = ezdxf.new("R2010", units=6)
    space = drawing.modelspace()
    space.add_lwpolyline([(0, 0), (9, 0), (9, 9), (0, 9)], close=True, dxfattribs={"layer": "A-WALL"})
    for k in range(95):
        space.add_text("3.00m x 4.00m", dxfattribs={"layer": "TEXT", "insert": (1 + k / 20, 1)})
    drawing.saveas(tmp_path / "texts.dxf")
    read_floor(tmp_path / "texts.dxf")
    assert len(measured) == 2 * 10
    assert max(measured)[0] > 5, "texts of the whole drawing are taken"


def test_more_arcs_of_doors_than_any_storey_has_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(patterns, "MOST_SWINGS", 20)
    drawing = ezdxf.new("R2010", units=6)
    space = drawing.modelspace()
    for out in (0.0, 0.2):
        ring = [(-out, -out), (60 + out, -out), (60 + out, 9 + out), (-out, 9 + out)]
        space.add_lwpolyline(ring, close=True, dxfattribs={"layer": "A-WALL"})
    for k in range(20):
        space.add_arc((2.0 * k + 1, 4), 0.9, 0, 90, dxfattribs={"layer": "A-DOOR"})
        space.add_arc((2.0 * k + 1, 6), 0.05, 0, 90, dxfattribs={"layer": "A-DOOR"})
    drawing.saveas(tmp_path / "doors.dxf")
    read_floor(tmp_path / "doors.dxf", FloorOptions(units="m"))
    space.add_arc((50, 4), 0.9, 0, 90, dxfattribs={"layer": "A-DOOR"})
    drawing.saveas(tmp_path / "doors.dxf")
    with pytest.raises(InputError, match="21 arcs of doors on A-DOOR, more than 20, as no storey has"):
        read_floor(tmp_path / "doors.dxf", FloorOptions(units="m"))


def test_each_text_is_decoded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Names, areas and sides are sought in the same texts, and the words of the floor are read after them."""
    decoded = []
    plain_text = Text.plain_text

    def counted(text: Text) -> str:
        decoded.append(text.dxf.handle)
        return plain_text(text)

    monkeypatch.setattr(Text, "plain_text", counted)
    drawing = ezdxf.new("R2010", units=6)
    space = drawing.modelspace()
    for layer in ("FLOOR", "WALLS"):
        space.add_lwpolyline([(0, 0), (9, 0), (9, 9), (0, 9)], close=True, dxfattribs={"layer": layer})
    for k in range(8):
        layer = "A-ROOM" if k % 2 else "NOTES"
        space.add_text(f"Office {k}", dxfattribs={"layer": layer, "insert": (1 + k, 1), "height": 0.2})
    drawing.saveas(tmp_path / "texts.dxf")
    read_floor(tmp_path / "texts.dxf")
    assert len(decoded) == len(set(decoded)) == 8


def test_of_very_many_arcs_some_show_the_unit_and_none_the_swings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All arcs were searched three times before their number was refused."""
    fitted = []
    fit = swings._fitted

    def counted(arc: NDArray[np.float64]) -> swings.Swing | None:
        fitted.append(arc)
        return fit(arc)

    monkeypatch.setattr(swings, "_fitted", counted)
    for module in (patterns, unit_evidence):
        monkeypatch.setattr(module, "MOST_SWINGS", 30)
    monkeypatch.setattr(unit_evidence, "_SOME_ARCS", 10)
    drawing = ezdxf.new("R2010", units=6)
    space = drawing.modelspace()
    for out in (0.0, 0.2):
        ring = [(-out, -out), (90 + out, -out), (90 + out, 9 + out), (-out, 9 + out)]
        space.add_lwpolyline(ring, close=True, dxfattribs={"layer": "A-WALL"})
    for k in range(40):
        space.add_arc((2.0 * k + 1, 4), 0.9, 0, 90, dxfattribs={"layer": "A-DOOR"})
    drawing.saveas(tmp_path / "doors.dxf")
    with pytest.raises(InputError, match="40 arcs of doors on A-DOOR, more than 30"):
        read_floor(tmp_path / "doors.dxf")
    assert len(fitted) == 10


def test_rooms_beside_an_opening_are_probed_no_farther_than_the_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The innermost room at the nearest probe counts; a room around thousands takes long to ask."""
    asked = []

    class Counted(shapely.STRtree):
        def query(self, geometry: shapely.Point, **rest: object) -> NDArray[np.int64]:
            asked.append(geometry)
            return np.asarray(super().query(geometry, **rest))

    rooms = Counted([shapely.box(-9, 0, 9, 9), shapely.box(-1, 0, 1, 5), shapely.box(-9, -9, 9, -0.5)])
    assert _sides(shapely.LineString([(-0.5, 0), (0.5, 0)]), rooms) == (1, 2)
    assert len(asked) == 1 + len(PROBES)


def robot_map(folder: Path, occupied: NDArray[np.bool_]) -> Path:
    """A map of cells of 5 cm, free where they are not occupied."""
    picture = np.where(occupied, 0, 254).astype(np.uint8)
    (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % picture.shape[::-1] + picture.tobytes())
    (folder / "map.yaml").write_text(
        "image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    return folder / "map.yaml"


def test_a_map_of_noise_is_refused_by_its_outlines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each occupied cell by itself has four edges."""
    occupied = np.zeros((60, 60), dtype=bool)
    occupied[5:55:5, 5:55:5] = True
    monkeypatch.setattr(robot_map_reader, "MOST_STEPS", 399)
    with pytest.raises(InputError, match="occupied cells have 400 edges, more than 399: that is noise"):
        read_floor(robot_map(tmp_path, occupied))


def test_a_map_of_very_many_specks_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    occupied = np.zeros((60, 60), dtype=bool)
    occupied[5:55:5, 5:55:5] = True
    monkeypatch.setattr(robot_map_reader, "MOST_SPECKS", 99)
    with pytest.raises(InputError, match=r"100 groups of occupied cells smaller than 0.5 m, more than 99"):
        read_floor(robot_map(tmp_path, occupied))


def peak_of(work: Callable[[], object]) -> int:
    """Most bytes that are held at once."""
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def test_a_row_of_very_many_cells_takes_few_bytes_for_each() -> None:
    """20 million of them took 1.25 GB."""
    count = 200_000
    row = np.ones((1, count), dtype=bool)
    assert peak_of(lambda: cell_regions._edges(row)) < 25 * count
    picture = GreyPicture(np.full((1, count), 254, dtype=np.uint8), np.ones((1, count), dtype=bool))
    described = MapDescription("map.pgm", 0.05, (0, 0, 0))
    assert peak_of(lambda: described.cells(picture)) < 10 * count


@pytest.mark.parametrize("kind", ["P2", "P5"])
def test_pictures_are_read_in_few_bytes_for_each_pixel(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    count = 200_000
    values = b"254 " * count if kind == "P2" else b"\xfe" * count
    data = b"%s\n%d 1\n255\n" % (kind.encode(), count) + values
    monkeypatch.setattr(grey_picture, "_PIECE", 1000)
    found = []
    assert peak_of(lambda: found.append(read_picture(data, name="map.pgm"))) < 10 * count
    assert (found[0].grey == 254).all()
    assert found[0].grey.shape == (1, count)


@pytest.mark.filterwarnings("error")
def test_a_picture_of_values_that_are_no_numbers_is_refused() -> None:
    with pytest.raises(InputError, match="a value is no number"):
        read_picture(b"P2\n2 1\n255\n0 nan\n", name="map.pgm")


def test_a_zip_that_claims_to_be_small_is_unpacked_in_pieces(tmp_path: Path) -> None:
    """200 MB whose header says 1000 bytes."""
    path = tmp_path / "model.ifczip"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("model.ifc", "w") as member,
    ):
        for _ in range(200):
            member.write(b" " * 10**6)
    data = bytearray(path.read_bytes())
    for at in (22, data.rfind(b"PK\x01\x02") + 24):
        data[at : at + 4] = struct.pack("<I", 1000)
    tracemalloc.start()
    with pytest.raises(InputError, match="cannot be unzipped"):
        _unzipped(FloorFile(path, bytes(data)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20e6
