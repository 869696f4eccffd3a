"""A plan says what it may have missed: walls, lines nobody read, floor it does not enter, places far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import ezdxf
import pytest

from stopgo.command_line import main
from stopgo.mission.floor import FloorPlan, IgnoredLine, Rank
from stopgo.mission.geometry import frozen
from stopgo.mission.settings import Settings
from stopgo.mission.stages.figures import Figures, percent
from stopgo.planner.appraisal.figures_of_route import ranked
from tests.planner.worlds import (
    box,
    column,
    element,
    floor_of,
    hall,
    planned,
    room,
    shell,
    two_rooms,
    wall,
)


def figures_of(floor: FloorPlan, settings: Settings | None = None) -> Figures:
    _, nouns = planned(floor, settings)
    figures: Figures = nouns[Figures]
    return figures


def codes(figures: Figures) -> list[str]:
    return [item.code for item in figures.findings]


def with_lines(floor: FloorPlan, *lines: Sequence[tuple[float, float]], layer: str = "GLASS") -> FloorPlan:
    return replace(floor, ignored=tuple(IgnoredLine(layer, frozen(list(line))) for line in lines))


def test_a_floor_in_order_has_nothing_doubtful() -> None:
    figures = figures_of(two_rooms(0.9))
    assert codes(figures) == []
    assert figures.unreached == ()
    assert figures.reached_m2 == pytest.approx(figures.rooms_m2)


def test_a_room_beyond_the_floor_counts_no_floor() -> None:
    """The right room's outline ends 4 m beyond the slab; one more lies outside of it."""
    floor = two_rooms(0.9)
    rooms = (floor.rooms[0], room("right", box(4.1, 0, 12, 4)), room("outside", box(14, 0, 18, 4)))
    figures = figures_of(replace(floor, rooms=rooms))
    assert figures.rooms_m2 == pytest.approx(2 * 3.9 * 4)
    assert figures.reached_m2 == pytest.approx(2 * 3.9 * 4)


def test_a_leg_over_lines_that_were_not_read_is_reported_first() -> None:
    floor = with_lines(two_rooms(0.9), [(4.0, 0.0), (4.0, 4.0)])
    first = figures_of(floor, Settings(range=3, coverage=1.0)).findings[0]
    assert first.code == "leg_over_ignored"
    assert first.rank == Rank.GRAVE
    assert "--layer GLASS=KIND" in first.message
    assert first.at is not None
    assert first.at[0] == pytest.approx(4.0)


def test_a_line_that_only_the_robots_edge_would_touch_is_reported() -> None:
    """The robot is 0.35 m wide to each side; both legs run through the door's middle at y = 2."""
    for y, touched in ((2.34, True), (2.5, False)):
        floor = with_lines(two_rooms(0.9), [(3.95, y), (4.05, y)])
        figures = figures_of(floor, Settings(range=3, coverage=1.0))
        assert figures.crosses_ignored == touched, y


def test_lines_next_to_every_leg_are_not_reported() -> None:
    floor = with_lines(two_rooms(0.9), [(0.05, 0.05), (0.3, 0.05)])
    assert "leg_over_ignored" not in codes(figures_of(floor))


def rooms_without_walls() -> FloorPlan:
    """Two rooms of 4 × 4 m whose walls are missing; a column shows something."""
    return floor_of(
        box(0, 0, 8, 4),
        rooms=(room("left", box(0, 0, 4, 4)), room("right", box(4, 0, 8, 4))),
        elements=(column("c", 2, 2), column("k", 6, 2)),
    )


def test_rooms_without_walls_are_grave() -> None:
    found = [item for item in figures_of(rooms_without_walls()).grave if item.code == "walls_missing"]
    assert len(found) == 1
    assert "2 of 2 rooms" in found[0].message


def test_walls_on_an_unknown_layer_are_missing_though_they_stand_in_the_way() -> None:
    floor = two_rooms(0.9, more=(column("c", 2, 1),))
    other = [replace(item, kind="other", occludes=False, target=False) for item in floor.elements[:3]]
    floor = replace(floor, elements=(*other, *floor.elements[3:]))
    assert {item.code for item in figures_of(floor).grave} == {"walls_missing", "scans_apart"}


def test_layers_that_are_not_read_are_named_next_to_missing_walls() -> None:
    floor = with_lines(rooms_without_walls(), [(0.0, 0.01), (8.0, 0.01)], layer="A-WALL")
    grave = [item.message for item in figures_of(floor).grave if item.code == "walls_missing"]
    assert "--layer A-WALL=walls" in grave[0]


def test_one_room_without_walls_among_many_is_doubtful_only() -> None:
    floor = two_rooms(0.9)
    terrace = room("terrace", box(8.4, 0, 12, 4))
    floor = replace(floor, outline=(box(0, 0, 12, 4),), rooms=(*floor.rooms, terrace))
    assert "room_without_walls" in codes(figures_of(floor))
    assert "walls_missing" not in codes(figures_of(floor))


def test_a_wall_far_from_the_floor_is_reported_with_its_distance() -> None:
    floor = hall(6, 4, wall("stray", box(506.2, 0, 507, 1)))
    found = [item for item in figures_of(floor).findings if item.code == "stray_element"]
    assert [item.element for item in found] == ["stray"]
    assert "500 m" in found[0].message


@pytest.mark.parametrize(("gap", "told"), [(0.0, False), (0.05, True), (0.25, True), (0.9, False)])
def test_a_gap_between_walls_drawn_as_lines_is_reported(gap: float, told: bool) -> None:
    """A partition drawn as a line that ends `gap` before the wall; 0.9 m is a doorway, not a slip."""
    line = element("partition", "walls", lines=[[(3.0, 0.0), (3.0, 4.0 - gap)]])
    floor = hall(6, 4, line, rooms=())
    found = [item for item in figures_of(floor).findings if item.code == "wall_gap"]
    assert bool(found) == told
    if found:
        assert f"{100 * gap:.1f} cm" in found[0].message


def test_a_part_that_is_cut_off_is_reported_where_there_are_no_rooms() -> None:
    floor = floor_of(
        box(0, 0, 12, 4), elements=(shell(0, 0, 12, 4), wall("cut", box(8, 0, 8.2, 4)), column("c", 2, 2))
    )
    (piece,) = figures_of(floor).unreached
    assert piece.room == "an area of floor"
    assert piece.area_m2 == pytest.approx((3.8 - 0.7) * (4 - 0.7), abs=0.5)


def test_both_parts_are_reached_when_both_are_planned(tmp_path: Path) -> None:
    path = drawn(tmp_path)
    assert main(["plan", str(path), "-o", str(tmp_path / "one"), "--strict"]) == 1
    assert main(["plan", str(path), "-o", str(tmp_path / "all"), "--strict", "--all-parts"]) == 0


def test_a_room_too_tight_is_reported_which_d_sec_would_do() -> None:
    """A closet of 1.2 × 1.2 m has a place 0.6 m from its walls, none 0.7 m from them."""
    floor = two_rooms(0.9)
    cell = (
        wall("a", box(6.7, 0, 6.8, 1.2)),
        wall("b", box(6.8, 1.2, 7.05, 1.3)),
        wall("c", box(7.95, 1.2, 8, 1.3)),
    )
    closet = room("closet", box(6.8, 0, 8, 1.2))
    floor = replace(floor, rooms=(*floor.rooms, closet), elements=(*floor.elements, *cell))
    (left_out,) = figures_of(floor).unreached
    assert left_out.room == "closet"
    assert "--clearance 0.6 leaves one" in left_out.why
    assert figures_of(floor, Settings(d_sec=0.6)).unreached == ()


def test_a_plan_on_a_raster_says_that_check_may_refute_it() -> None:
    figures = figures_of(two_rooms(0.9), Settings(visibility="bresenham"))
    (finding,) = figures.findings
    assert (finding.code, finding.rank) == ("raster_visibility", Rank.DOUBT)
    assert "check --floor" in finding.message


def test_findings_next_to_a_leg_come_before_others_of_their_rank() -> None:
    figures = figures_of(
        with_lines(two_rooms(0.9), [(4.0, 0.0), (4.0, 4.0)]), Settings(range=3, coverage=1.0)
    )
    doubts = [replace(figures.findings[0], code=code) for code in ("duplicate", "off_floor", "walls_missing")]
    beside = replace(figures.findings[0], code="wide_line")
    order = ranked((*doubts, beside), {0, 3})
    assert [item.code for item in order] == ["wide_line", "walls_missing", "off_floor", "duplicate"]


# ---- from a drawing, by the command ----


def drawn(folder: Path, *, cut: bool = True, glass: bool = False, walls: str = "WALLS") -> Path:
    """A floor of 12 × 4 m with a wall across, or a line of glass on a layer of its own."""
    document = ezdxf.new(units=6)
    space = document.modelspace()

    def ring(layer: str, x0: float, y0: float, x1: float, y1: float) -> None:
        points = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
        space.add_lwpolyline(points, close=True, dxfattribs={"layer": layer})

    ring("FLOOR", 0, 0, 12, 4)
    for sides in ((0, -0.2, 12, 0), (0, 4, 12, 4.2), (-0.2, 0, 0, 4), (12, 0, 12.2, 4)):
        ring(walls, *sides)
    ring("COLUMNS", 1.8, 1.8, 2.2, 2.2)
    if cut:
        ring(walls, 8, 0, 8.2, 4)
    if glass:
        space.add_line((8, 0), (8, 4), dxfattribs={"layer": "GLASS"})
    path = folder / "floor.dxf"
    document.saveas(path)
    return path


def test_a_plan_over_glass_ends_with_exit_1_until_it_is_said_what_it_is(tmp_path: Path) -> None:
    path = drawn(tmp_path, cut=False, glass=True)
    out = ["-o", str(tmp_path / "plan"), "--no-register"]  # a stop in the doorway would pass the glass
    assert main(["plan", str(path), *out]) == 1
    assert main(["plan", str(path), *out, "--layer", "GLASS=ignore"]) == 0
    assert main(["plan", str(path), *out, "--layer", "GLASS=windows"]) == 0
    assert main(["plan", str(path), *out, "--layer", "GLASS=windows", "--strict"]) == 1
    assert main(["plan", str(path), *out, "--layer", "GLASS=glass"]) == 2


def test_check_reports_lines_that_were_not_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = drawn(tmp_path, cut=False, glass=True)
    main(["plan", str(path), "-o", str(tmp_path), "--no-register"])
    capsys.readouterr()
    assert main(["check", str(tmp_path / "mission.json"), "--floor", str(path)]) == 1
    assert "GLASS" in capsys.readouterr().out


def test_findings_are_reported_when_no_plan_can_be_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = drawn(tmp_path, walls="X1")
    assert main(["plan", str(path), "-o", str(tmp_path), "--targets", "walls"]) == 1
    told = capsys.readouterr().err
    assert "layer X1" in told
    assert "no target" in told.splitlines()[-1]


def test_every_row_of_the_coverage_table_is_in_text_json_and_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import json

    path = drawn(tmp_path, cut=False)
    assert main(["plan", str(path), "-o", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert main(["plan", str(path), "-o", str(tmp_path)]) == 0
    text, picture = capsys.readouterr().out, (tmp_path / "plan.svg").read_text()
    for row in (told["coverage"]["total"], *told["coverage"]["rooms"], *told["coverage"]["kinds"]):
        share = percent(row["coverage"])
        assert share in text
        assert share in picture
