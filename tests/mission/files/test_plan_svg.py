"""plan.svg is well-formed, to scale, legible, the same every time, and nothing on it overlaps."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import combinations, pairwise

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stopgo.mission.document import Overlap
from stopgo.mission.errors import InputError
from stopgo.mission.files import plan_panel
from stopgo.mission.files.plan_panel import coordinate_ticks
from stopgo.mission.files.plan_svg import plan_svg
from stopgo.mission.files.room_labels import Busy, covered_weight, inside, room_labels, wrapped
from stopgo.mission.files.sheet import MARGIN, PAPERS, PaperBox, PaperSheet, SheetContents, fit
from stopgo.mission.files.svg import SMALLEST_TEXT, lines_data, number, shortened, text_width
from stopgo.mission.floor import Room
from stopgo.mission.geometry import Polygon
from stopgo.mission.stages import Route
from tests.mission.worlds import box, mission_of, room_mission, room_route, stop

SVG = "{http://www.w3.org/2000/svg}"


def drawn(route: Route | None = None, **changes: object) -> ET.Element:
    mission = msgspec.structs.replace(room_mission(), **changes)
    return ET.fromstring(plan_svg(route or room_route(), mission, date="2026-11-21"))


def words(root: ET.Element) -> list[str]:
    return [item.text or "" for item in root.iter(f"{SVG}text")]


def layer(root: ET.Element, name: str) -> ET.Element:
    return next(item for item in root.iter(f"{SVG}g") if item.get("id") == name)


def corners(element: ET.Element) -> list[tuple[float, float]]:
    """Points of a path, in millimetres."""
    pairs = re.findall(r"[ML](-?[\d.]+) (-?[\d.]+)", element.get("d", ""))
    return [(float(x), float(y)) for x, y in pairs]


def test_the_same_plan_gives_the_same_bytes() -> None:
    once = plan_svg(room_route(), room_mission(), date="2026-11-21")
    assert once == plan_svg(room_route(), room_mission(), date="2026-11-21")
    assert once != plan_svg(room_route(), room_mission(), date="2026-11-22")


def test_the_sheet_is_in_millimetres() -> None:
    root = drawn()
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("297mm", "210mm", "0 0 297 210")


def test_eight_metres_are_160_mm_at_1_to_50() -> None:
    root = drawn()
    assert any("1:50" in word for word in words(root))
    (room,) = layer(root, "rooms")
    xs, ys = zip(*corners(room), strict=True)
    assert max(xs) - min(xs) == pytest.approx(160.0)
    assert max(ys) - min(ys) == pytest.approx(80.0)


def test_up_on_the_site_is_up_on_paper() -> None:
    (leg,) = layer(drawn(), "route")
    first, second = corners(leg)[:2]  # from (1.2, 1.0) up to (1.2, 2.0)
    assert second == pytest.approx((first[0], first[1] - 20.0))


def test_the_title_block_names_the_mission() -> None:
    mission = room_mission()
    shown = words(drawn())
    for fact in ("room", f"{mission.id[:12]}, revision 1", mission.digest[:12], "2026-11-21", "room.dxf"):
        assert fact in shown


def test_every_stop_has_a_disc_and_a_row() -> None:
    root = drawn()
    assert words(layer(root, "stops")) == ["1", "2"]
    assert words(layer(root, "table"))[7:] == [
        *("1", "1.200", "2.000", "0.0", "10", "10", "0:04"),
        *("2", "6.800", "2.000", "0.0", "10", "10", "1:15"),
    ]


@pytest.mark.parametrize("hold_m", [1e-5, 0.01, 0.7])
def test_the_error_of_the_weakest_pair_fits_into_its_frame(hold_m: float) -> None:
    pair = Overlap(*(stop.id for stop in room_mission().stops), common_m=3.0, share=0.2, hold_m=hold_m)
    frame, error = layer(drawn(network=(pair,)), "weakest")
    assert float(frame.get("width", 0)) >= text_width(error.text or "", float(error.get("font-size", 0)))


def test_names_are_escaped_and_what_xml_cannot_hold_is_replaced() -> None:
    shown = words(drawn(name='a <b> & "c" \x00'))
    assert 'a <b> & "c" \ufffd' in shown
    assert any(word.startswith("Hall <1>") for word in shown)


def test_seen_and_unseen_faces_are_different_layers() -> None:
    route = room_route()
    everything = drawn(route)
    assert "seen" in {item.get("id") for item in everything.iter(f"{SVG}g")}
    half = replace(route, selection=replace(route.selection, chosen=route.selection.chosen[:1]))
    (unseen,) = layer(drawn(half), "unseen")
    middle = max(x for x, _ in corners(layer(everything, "rooms")[0])) - 80.0
    assert max(x for x, _ in corners(unseen)) <= middle + 0.01  # candidate 1 sees the right half


def test_units_that_meet_are_one_line() -> None:
    """Twelve faces of one or more units; the room's four meet at its corners, the columns' too."""
    (seen,) = layer(drawn(), "seen")
    assert seen.get("d", "").count("M") == 3


def test_no_text_is_too_small_to_read() -> None:
    sizes = [float(item.get("font-size", 0)) for item in drawn().iter(f"{SVG}text")]
    assert min(sizes) >= SMALLEST_TEXT


def test_what_is_not_there_is_not_in_the_legend() -> None:
    shown = words(layer(drawn(), "legend"))
    assert "windows" in shown
    assert "railings" not in shown
    assert "back to the start" in shown
    assert "back to the start" not in words(layer(drawn(return_=None), "legend"))


def test_a_mission_of_hundreds_of_stops_continues_its_table_in_columns() -> None:
    legs = [(1.0 + 0.01 * number, 1.0) for number in range(401)]
    stops = [stop(f"S{number}", *leg) for number, leg in enumerate(pairwise(legs), 1)]
    mission = mission_of(*stops, begin=legs[0])
    root = ET.fromstring(plan_svg(room_route(), mission, date="2026-11-21"))
    assert words(layer(root, "table")).count("no") >= 3
    assert "400" in words(layer(root, "table"))


def test_a_long_table_is_cut_before_the_drawing_becomes_too_small() -> None:
    """All rows of a plan of 156 m by 120 m left its drawing so little room that it was at 1:500."""
    legs = [(4.0 * (number % 40), 4.0 * (number // 40)) for number in range(1201)]
    mission = mission_of(*(stop(f"S{n}", *leg) for n, leg in enumerate(pairwise(legs), 1)), begin=legs[0])
    root = ET.fromstring(plan_svg(room_route(), mission, date="2026-11-21"))
    scale = words(root)[words(root).index("Scale") + 1]
    assert scale.startswith("1:200 on"), scale
    table = words(layer(root, "table"))
    more = next(found for word in table if (found := re.fullmatch(r"and (\d+) more", word)))
    assert str(1200 - int(more[1])) in table and int(more[1]) > 0


def test_a_table_that_no_sheet_holds_is_cut_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """A floor of 100 000 m² was refused for its unit, after minutes of planning: its rows filled A0 twice."""
    monkeypatch.setattr(plan_panel, "MOST_ROWS", (4000, 10))
    legs = [(1.0 + 0.001 * number, 1.0) for number in range(4001)]
    mission = mission_of(*(stop(f"S{n}", *leg) for n, leg in enumerate(pairwise(legs), 1)), begin=legs[0])
    root = ET.fromstring(plan_svg(room_route(), mission, date="2026-11-21"))
    assert "and 3990 more" in words(layer(root, "table"))


def test_coordinates_of_a_national_grid_are_written_in_full() -> None:
    sheet = fit(SheetContents((392_000.0, 5_712_000.0, 392_020.0, 5_712_010.0), 8.0, 60.0, 65.0, 0))
    shown = words(ET.fromstring(f'<svg xmlns="http://www.w3.org/2000/svg">{coordinate_ticks(sheet)}</svg>'))
    assert {"392000", "392005", "5712000", "5712005"} <= set(shown)


def test_a_bare_floor_without_stops_is_drawn() -> None:
    route = room_route()
    candidates = route.candidates
    floor = replace(candidates.floor, rooms=(), openings=())
    space = replace(candidates.space, floor=floor, rooms=(), openings=())
    visibility = replace(route.visibility, candidates=replace(candidates, space=space))
    none = np.empty(0, dtype=np.int64)
    selection = replace(route.selection, visibility=visibility, chosen=none, coverage_steps=none)
    bare = replace(route, selection=selection, order=none, approaches=(), return_leg=None)
    root = ET.fromstring(plan_svg(bare, mission_of(), date="2026-11-21"))
    assert {"route", "stops", "table", "names", "seen"}.isdisjoint(item.get("id") for item in root.iter())


sides = st.floats(0.5, 300.0)


@given(sides, sides, st.integers(0, 400), st.sampled_from([40.0, 66.0]), st.sampled_from([60.0, 70.0]))
def test_nothing_on_a_sheet_overlaps(
    width: float, height: float, rows: int, legend: float, title: float
) -> None:
    sheet = fit(SheetContents((0.0, 0.0, width, height), 8.0, legend, title, rows))
    boxes = [sheet.drawing, sheet.legend, sheet.title, *(chunk.box for chunk in sheet.table)]
    assert all(apart(one, other) for one, other in combinations(boxes, 2))
    assert all(on_sheet(box, sheet) for box in boxes)
    assert [chunk.first for chunk in sheet.table] == [
        sum(chunk.count for chunk in sheet.table[:index]) for index in range(len(sheet.table))
    ]
    assert sum(chunk.count for chunk in sheet.table) == rows
    low, high = sheet.on_paper(np.array([[0.0, 0.0], [width, height]]))
    assert sheet.drawing.x + 7.99 <= low[0] <= high[0] <= sheet.drawing.x + sheet.drawing.width - 7.99
    assert sheet.drawing.y + 7.99 <= high[1] <= low[1] <= sheet.drawing.y + sheet.drawing.height - 7.99


def apart(one: PaperBox, other: PaperBox) -> bool:
    slack = 0.01
    return (
        one.x + one.width <= other.x + slack
        or other.x + other.width <= one.x + slack
        or one.y + one.height <= other.y + slack
        or other.y + other.height <= one.y + slack
    )


def on_sheet(box: PaperBox, sheet: PaperSheet) -> bool:
    right, low = sheet.width - MARGIN + 0.01, sheet.height - MARGIN + 0.01
    inner = box.x >= MARGIN - 0.01 and box.y >= MARGIN - 0.01
    return inner and box.x + box.width <= right and box.y + box.height <= low


@pytest.mark.parametrize(
    ("width", "height", "scale", "paper"),
    [(8, 4, 50, "A4"), (12, 10, 50, "A3"), (26, 13, 100, "A3"), (50, 36, 200, "A3"), (400, 300, 500, "A0")],
)
def test_the_scale_is_the_largest_that_is_handy(width: float, height: float, scale: int, paper: str) -> None:
    sheet = fit(SheetContents((0.0, 0.0, width, height), 8.0, 60.0, 65.0, 10))
    assert (sheet.scale, sheet.paper) == (scale, paper)
    assert {sheet.width, sheet.height} == set(map(float, PAPERS[paper]))


def test_a_floor_in_the_wrong_unit_by_far_is_refused() -> None:
    with pytest.raises(InputError, match="check its unit"):
        fit(SheetContents((0.0, 0.0, 1e12, 1.0), 8.0, 60.0, 65.0, 10))


def test_inside_is_the_even_odd_rule() -> None:
    outer = np.array([[0, 0], [4, 0], [4, 4], [0, 4]], dtype=float)
    hole = np.array([[1, 1], [1, 3], [3, 3], [3, 1]], dtype=float)
    found = inside(np.array([0.5, 2.0, 5.0]), np.array([0.5, 2.0]), [outer, hole])
    assert found.tolist() == [[True, True, False], [True, False, False]]


def test_a_long_room_name_is_broken_where_its_halves_are_alike() -> None:
    assert wrapped("134 TEAM CONFERENCE", width=25.0) == ["134 TEAM", "CONFERENCE"]
    assert wrapped("short", width=25.0) == ["short"]
    assert all(text_width(part, 2.2) <= 12.0 for part in wrapped("116 UPS/BATTERY STORAGE", width=12.0))


@given(st.integers(0, 2**32 - 1), st.integers(0, 300))
def test_points_near_a_label_are_found_and_weighed_as_one_by_one(seed: int, many: int) -> None:
    random = np.random.default_rng(seed)
    xy, weight = random.uniform(-30, 30, (many, 2)), random.integers(1, 60, many)
    busy = Busy(xy, weight)
    low, high = np.sort(random.uniform(-35, 35, (2, 2)), axis=0)
    near = busy.near(low, high)
    inner = ((xy > low) & (xy < high)).all(axis=1)
    assert sorted(near.xy.tolist()) == sorted(xy[inner].tolist()) and near.weight.sum() == weight[inner].sum()
    x, y, half = np.linspace(-20, 20, 7), np.linspace(-5, 25, 5), random.uniform(0, 15, 2)
    under = (np.abs(xy[:, 0] - x[:, None]) < half[0])[None] & (np.abs(xy[:, 1] - y[:, None]) < half[1])[
        :, None
    ]
    assert covered_weight(x, y, half, busy).tolist() == (under * weight).sum(axis=2).tolist()


@given(st.lists(st.tuples(*[st.floats(-1e4, 1e4) | st.floats(-0.02, 0.02)] * 2), min_size=1))
def test_points_of_lines_are_written_as_single_numbers(points: list[tuple[float, float]]) -> None:
    words = [f"{number(x)} {number(y)}" for x, y in points]
    drawn = lines_data(np.array([*points, points[0]]), [len(points), 1], end="Z")
    assert drawn == f"M{'L'.join(words)}ZM{words[0]}Z"


@given(st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=40), st.floats(5, 50))
def test_shortened_text_is_never_wider(content: str, width: float) -> None:
    short = shortened(content, size=2.0, width=width)
    assert text_width(short, 2.0) <= width or len(short) <= 2


@pytest.mark.parametrize("wide", [0.4, 1.2, 2.0, 4.0, 9.0])
def test_room_names_cross_no_wall_and_no_other_name(wide: float) -> None:
    """A name without room is cut to its first word; without room for that, it is left out."""
    sheet = PaperSheet(
        *("A0", 1189.0, 841.0, 200, PaperBox(10.0, 10.0, 1000.0, 800.0), NOWHERE, NOWHERE, ()), (0.0, 0.0)
    )
    corners = [(n * wide, m * 3.0) for n in range(6) for m in range(2)]
    rooms = tuple(
        Room(f"R{k}", f"{k} Meeting and conference", (Polygon.of(box(x, y, x + wide, y + 3.0)),))
        for k, (x, y) in enumerate(corners, 101)
    )
    avoid = Busy(np.empty((0, 2)), np.empty(0, dtype=np.int64))
    root = ET.fromstring(f"<g>{room_labels(rooms, sheet, avoid=avoid)}</g>")
    rings = [sheet.on_paper(room.polygons[0].exterior) for room in rooms]
    for item in root.iter("text"):
        x, size = float(item.get("x", "")), float(item.get("font-size", ""))
        half = text_width(item.text or "", size) / 2
        y = float(item.get("y", ""))
        within = [
            bool(inside(np.array([x - half, x + half]), np.array([y - 0.8 * size, y]), [ring]).all())
            for ring in rings
        ]
        assert sum(within) == 1, item.text
    said = {word for item in root.iter("text") for word in (item.text or "").split()}
    assert any(word.startswith("101") for word in said) == (wide > 1.0)
    assert ("m²" in said) == (wide > 1.5)


NOWHERE = PaperBox(0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("head", [plan_panel.STOP_HEAD, plan_panel.COVERAGE_HEAD])
def test_headings_leave_room_between_them(head: plan_panel.Row) -> None:
    """Bold letters are up to a tenth wider; `covered` and `covered %` once ran into each other."""
    for (before, edge), cell in zip(pairwise(head.edges), head.cells[1:], strict=True):
        assert 1.1 * text_width(cell, plan_panel.BODY) + 0.5 < edge - before, cell
