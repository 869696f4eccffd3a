"""A robot's map is a floor in its own frame: the occupied stands there, the unknown is no floor."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from stopgo.mission.errors import InputError
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.planner import plan
from stopgo.planner.floors import read_floor, survey_floor
from stopgo.planner.floors.robot_map.cell_regions import polygons_of_cells
from stopgo.planner.floors.robot_map.grey_picture import read_picture
from tests.planner.worlds import box, door, floor_of, room, wall

RESOLUTION = 0.05
FREE, UNKNOWN, WALL = 254, 205, 0
Grid = NDArray[np.uint8]


def two_rooms() -> Grid:
    """Rooms of 4 by 5 m and 5 by 5 m, walls of 0.2 m, a passage of 1 m; 1 m of the unknown around it."""
    cells = np.full((148, 228), UNKNOWN, dtype=np.uint8)

    def fill(value: int, x0: float, y0: float, x1: float, y1: float) -> None:
        x, y, right, top = (round(side / RESOLUTION) + 20 for side in (x0, y0, x1, y1))
        cells[y:top, x:right] = value

    fill(WALL, 0, 0, 9.6, 5.4)
    fill(FREE, 0.2, 0.2, 4.2, 5.2)
    fill(FREE, 4.4, 0.2, 9.4, 5.2)
    fill(FREE, 4.2, 2.2, 4.4, 3.2)
    return cells[::-1]


def pgm(cells: Grid) -> bytes:
    rows, columns = cells.shape
    return b"P5\n# made by a test\n%d %d\n255\n" % (columns, rows) + cells.tobytes()


def png(cells: Grid, *, kind: int = 0) -> bytes:
    """A grey PNG whose rows are filtered by the given kind."""
    rows, columns = cells.shape
    wide = np.pad(cells, ((1, 0), (1, 0))).astype(int)
    left, above, corner = wide[1:, :-1], wide[:-1, 1:], wide[:-1, :-1]
    guess = left + above - corner
    away = np.abs(np.stack([guess - left, guess - above, guess - corner]))
    paeth = np.choose(away.argmin(axis=0), [left, above, corner])
    near = (0 * left, left, above, (left + above) // 2, paeth)[kind]
    lines = np.hstack([np.full((rows, 1), kind), (cells - near) % 256]).astype(np.uint8)

    def chunk(name: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        )

    header = struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines.tobytes())) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def map_in(
    folder: Path, cells: Grid, *, image: bytes | None = None, origin: str = "[-2.0, 3.0, 0.0]", more: str = ""
) -> Path:
    (folder / "map.pgm").write_bytes(pgm(cells) if image is None else image)
    text = f"image: map.pgm\nresolution: {RESOLUTION}\norigin: {origin}\nnegate: 0\n{more}"
    (folder / "map.yaml").write_text(text, encoding="utf-8")
    return folder / "map.yaml"


def walls_area(floor: FloorPlan) -> float:
    return sum(solid.area for item in floor.elements if item.kind == "walls" for solid in item.solids)


def test_a_map_is_a_floor_with_rooms_in_its_own_frame(tmp_path: Path) -> None:
    floor = read_floor(map_in(tmp_path, two_rooms()))
    assert floor.area == pytest.approx(9.6 * 5.4)
    assert walls_area(floor) == pytest.approx(9.6 * 5.4 - 20 - 25 - 0.2)
    assert [round(room.area, 1) for room in floor.rooms] == [20.0, 25.0]
    assert floor.outline[0].exterior[0].tolist() == pytest.approx([-1.0, 4.0])
    (passage,) = floor.openings
    assert passage.kind == "passage"
    assert passage.line.tolist() == [pytest.approx([3.3, 6.2]), pytest.approx([3.3, 7.2])]


def test_a_turned_map_is_turned_about_its_origin(tmp_path: Path) -> None:
    floor = read_floor(map_in(tmp_path, two_rooms(), origin=f"\n  - 10.0\n  - 0\n  - {math.pi / 2}"))
    low, high = floor.outline[0].exterior.min(axis=0), floor.outline[0].exterior.max(axis=0)
    assert low.tolist() == pytest.approx([10 - 6.4, 1.0])
    assert high.tolist() == pytest.approx([10 - 1.0, 10.6])
    assert len(floor.rooms) == 2


def test_a_plan_of_a_map_reaches_the_figures_of_the_floor_it_shows(tmp_path: Path) -> None:
    rooms = (room("a", box(0.2, 0.2, 4.2, 5.2)), room("b", box(4.4, 0.2, 9.4, 5.2)))
    parts = [(0, 0, 9.6, 0.2), (0, 5.2, 9.6, 5.4), (0, 0.2, 0.2, 5.2), (9.4, 0.2, 9.6, 5.2)]
    parts += [(4.2, 0.2, 4.4, 2.2), (4.2, 3.2, 4.4, 5.2)]
    walls = tuple(wall(f"w{k}", box(*part)) for k, part in enumerate(parts))
    way = door("p", (4.3, 2.2), (4.3, 3.2), kind="passage")
    true = floor_of(box(0, 0, 9.6, 5.4), rooms=rooms, openings=(way,), elements=walls)
    drawn = plan(true, Settings()).first
    found = plan(read_floor(map_in(tmp_path, two_rooms())), Settings()).first
    assert len(found.mission.stops) == len(drawn.mission.stops)
    assert found.figures.whole.total == pytest.approx(drawn.figures.whole.total, rel=0.01)
    assert found.figures.whole.visible == pytest.approx(drawn.figures.whole.visible, rel=0.01)
    assert found.figures.reached_m2 == pytest.approx(drawn.figures.reached_m2, rel=0.01)
    assert found.mission.frame.name == "map"
    assert found.mission.frame.to_map is not None


@pytest.mark.parametrize("kind", range(5))
def test_a_png_is_the_same_picture(kind: int) -> None:
    cells = np.random.default_rng(1).integers(0, 256, (9, 7)).astype(np.uint8)
    assert np.array_equal(read_picture(png(cells, kind=kind), name="map.png").grey, cells)


def test_a_damaged_picture_is_refused_and_one_too_large_is_not_unpacked() -> None:
    whole = png(two_rooms())
    with pytest.raises(InputError, match="cannot be read"):
        read_picture(whole[:20] + b"\xff" + whole[21:], name="map.png")
    header = struct.pack(">4sIIBBBBB", b"IHDR", 90_000, 90_000, 8, 0, 0, 0, 0)
    large = whole[:12] + header + struct.pack(">I", zlib.crc32(header)) + whole[33:]
    with pytest.raises(InputError, match="90000 x 90000 pixels"):
        read_picture(large, name="map.png")


def test_modes_and_thresholds_are_map_servers(tmp_path: Path) -> None:
    cells = two_rooms()
    plain = read_floor(map_in(tmp_path, cells))
    swapped = (255 - cells.astype(int)).astype(np.uint8)
    negated = map_in(tmp_path, swapped)
    negated.write_text(negated.read_text().replace("negate: 0", "negate: 1"))
    assert read_floor(negated).area == pytest.approx(plain.area)
    raw = np.select([cells == FREE, cells == WALL], [0, 100], 255).astype(np.uint8)
    assert read_floor(map_in(tmp_path, raw, more="mode: raw")).area == pytest.approx(plain.area)
    assert read_floor(map_in(tmp_path, cells, more="mode: scale")).area == pytest.approx(plain.area)


def test_the_unknown_is_no_floor_and_a_lone_unknown_cell_is_noise(tmp_path: Path) -> None:
    cells = two_rooms().copy()
    cells[40:60, 40:60] = UNKNOWN
    cells[70, 150] = UNKNOWN
    assert read_floor(map_in(tmp_path, cells)).area == pytest.approx(9.6 * 5.4 - 1.0)


THRESHOLDS = ("free_thresh: 0.196", "free_thresh: 0.25", "free_thresh: 0.45\noccupied_thresh: 0.46")
"""Nav2 since June 2025, Nav2 before, and a person's own."""


def saved(cells: Grid, mode: str) -> tuple[Grid, Grid | None]:
    """The picture of a map as map_saver writes it, and its transparency if the mode has one."""
    if mode == "raw":
        return np.select([cells == FREE, cells == WALL], [0, 100], 255).astype(np.uint8), None
    if mode == "scale":
        grey = np.select([cells == FREE, cells == WALL], [255, 0], 127).astype(np.uint8)
        return grey, np.where(cells == UNKNOWN, 0, 255).astype(np.uint8)
    return cells, None


def with_alpha(grey: Grid, alpha: Grid) -> bytes:
    """A PNG of grey and transparency, its rows unfiltered."""
    plain = png(np.stack([grey, alpha], axis=2).reshape(len(grey), -1))
    header = struct.pack(">IIBBBBB", grey.shape[1], grey.shape[0], 8, 4, 0, 0, 0)
    chunk = struct.pack(">I", len(header)) + b"IHDR" + header
    return plain[:8] + chunk + struct.pack(">I", zlib.crc32(b"IHDR" + header)) + plain[33:]


@pytest.mark.parametrize("thresholds", THRESHOLDS)
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_unknown_cells_are_known_by_their_value_whatever_the_thresholds(
    tmp_path: Path, mode: str, thresholds: str
) -> None:
    cells = two_rooms()
    grey, alpha = saved(cells, mode)
    more = f"mode: {mode}\noccupied_thresh: 0.65\n{thresholds}"
    images = [pgm(grey)] if alpha is None else [pgm(grey), with_alpha(grey, alpha)]
    for image in images:
        path = map_in(tmp_path, grey, image=image, more=more)
        assert read_floor(path).area == pytest.approx(9.6 * 5.4)
        share = np.count_nonzero(cells == UNKNOWN) / cells.size
        assert survey_floor(path).ignored[0] == f"13008 unknown cells ({share:.0%}) are not floor"


def test_a_negated_map_has_its_unknown_negated(tmp_path: Path) -> None:
    swapped = (255 - two_rooms().astype(int)).astype(np.uint8)
    path = map_in(tmp_path, swapped, more="free_thresh: 0.25")
    path.write_text(path.read_text().replace("negate: 0", "negate: 1"))
    assert read_floor(path).area == pytest.approx(9.6 * 5.4)


def two_pieces() -> Grid:
    """The two rooms with their passage, and apart from them a hall of 11 by 6 m without any."""
    hall = np.full((140, 260), UNKNOWN, dtype=np.uint8)
    hall[6:-6, 16:-16] = WALL
    hall[10:-10, 20:-20] = FREE
    rooms = two_rooms()
    wide = np.full((len(hall) + len(rooms), 260), UNKNOWN, dtype=np.uint8)
    wide[: len(rooms), : rooms.shape[1]] = rooms
    wide[len(rooms) :] = hall
    return wide


def test_the_largest_piece_of_a_map_is_planned_or_that_of_the_start(tmp_path: Path) -> None:
    floor = read_floor(map_in(tmp_path, two_pieces()))
    assert floor.rooms
    largest = plan(floor, Settings()).first
    assert largest.figures.reached_m2 == pytest.approx(11 * 6, rel=0.15)
    assert all(stop.y < 3.0 + 7.0 for stop in largest.mission.stops)
    started = plan(floor, Settings(start=(1.0, 12.5, 0.0))).first
    assert started.figures.reached_m2 == pytest.approx(9.2 * 5, rel=0.15)


def test_a_few_occupied_cells_are_an_obstacle_and_no_wall(tmp_path: Path) -> None:
    cells = two_rooms().copy()
    cells[70, 150] = cells[90, 60] = WALL
    floor = read_floor(map_in(tmp_path, cells))
    small = [item for item in floor.elements if item.kind == "other"]
    assert [item.obstacle for item in small] == [True, True]
    assert not any(item.target for item in small)
    assert walls_area(floor) == pytest.approx(9.6 * 5.4 - 45.2)
    (told,) = [item.message for item in floor.findings if item.code == "small_obstacles"]
    assert told.startswith("2 groups of occupied cells")


def test_outlines_of_cells_are_exact() -> None:
    mask = np.zeros((4, 5), dtype=bool)
    mask[0, 0] = mask[1, 1] = mask[1, 2] = mask[3, 4] = True
    shapes = sorted(polygons_of_cells(mask), key=lambda shape: shape.bounds)
    assert [shape.bounds for shape in shapes] == [(0, 0, 1, 1), (1, 1, 3, 2), (4, 3, 5, 4)]
    ring = np.ones((3, 3), dtype=bool)
    ring[1, 1] = False
    assert [shape.area for shape in polygons_of_cells(ring)] == [8.0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("resolution: 0", "resolution = 0: metres per pixel"),
        ("resolution: nan", "must be a finite number"),
        ("origin: [1, 2]", r"write \[x, y, yaw\]"),
        ("negate: perhaps", "negate = perhaps: write 0 or 1"),
        ("mode: grey", "mode = grey: known: trinary, scale, raw"),
        ("free_thresh: 0.9", "write 0 <= free_thresh <= occupied_thresh <= 1"),
        ("image: none.pgm", "its image none.pgm cannot be read"),
        ("what is this", "is not 'key: value'"),
    ],
)
def test_a_faulty_description_is_refused_in_one_line(tmp_path: Path, change: str, says: str) -> None:
    path = map_in(tmp_path, two_rooms())
    path.write_text(path.read_text(encoding="utf-8") + change + "\n", encoding="utf-8")
    with pytest.raises(InputError, match=says):
        read_floor(path)


@pytest.mark.parametrize(
    ("image", "says"),
    [
        (pgm(np.full((40, 40), UNKNOWN, dtype=np.uint8)), r"no floor is free on the map \(100% of its cells"),
        (pgm(two_rooms())[:-9], "is cut off after 33735 of 33744 pixels"),
        (png(two_rooms())[:300], "cannot be read|is cut off"),
        (b"GIF89a", "is neither PGM nor PNG"),
        (b"P5\n99999999 99999999\n255\n", "a map has 1 to"),
    ],
)
def test_a_faulty_picture_is_refused_in_one_line(tmp_path: Path, image: bytes, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_floor(map_in(tmp_path, two_rooms(), image=image))


def test_a_survey_reports_what_is_on_the_map(tmp_path: Path) -> None:
    told = survey_floor(map_in(tmp_path, two_rooms()))
    assert told.kind == "robot map, 228 x 148 cells of 0.05 m"
    assert told.floors[0].elements["rooms"] == 2
    assert told.ignored[0].startswith("13008 unknown cells")
