"""Coverage demands: the units they count, and required fractions of every room and kind of element."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.floor import Element, FloorPlan
from stopgo.mission.geometry import Polygon
from stopgo.mission.settings import Settings
from stopgo.mission.stages import NavigableSpace, Selection, weights_of
from stopgo.planner.space.navigable import navigable
from tests.planner.worlds import (
    box,
    column,
    door,
    element,
    floor_of,
    hall,
    moved,
    planned,
    room,
    shell,
    turned,
    two_rooms,
    wall,
)


def share(selection: Selection, member: np.ndarray) -> float:
    """Share by length of the visible units of a mask that the chosen stops see."""
    seen = selection.visibility.seen_from(selection.chosen)
    length = selection.visibility.targets.unit_length
    visible = selection.visibility.visible & member
    return float(length[visible & seen].sum() / length[visible].sum())


def units_of(space: NavigableSpace, kind: str) -> np.ndarray:
    kinds = np.array([space.floor.elements[k].kind for k in space.targets.element])
    return kinds[space.targets.unit_segment] == kind


def round_column(id: str, x: float, y: float, corners: int) -> Element:
    """A column of 0.6 m, drawn with this many points."""
    turns = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    ring = np.array([x, y]) + 0.3 * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return element(id, "columns", Polygon.of(ring))


def test_how_finely_a_column_is_drawn_changes_no_share() -> None:
    one, other = (
        planned(
            hall(8, 5, *(round_column(f"c{k}", 2 + 2 * k, 2.5, corners) for k in range(3))),
            Settings(room_coverage=0, kind_coverage=0),
        )
        for corners in (48, 480)
    )
    drawn = [nouns[Selection] for _, nouns in (one, other)]
    walls = [share(found, units_of(found.space, "walls")) for found in drawn]
    assert drawn[1].visibility.targets.total > drawn[0].visibility.targets.total + 1200
    assert walls[1] == pytest.approx(walls[0], abs=0.01)
    assert len(drawn[0].chosen) == len(drawn[1].chosen)


def test_the_paper_counts_units_of_the_whole_only() -> None:
    targets = navigable(hall(4, 3), Settings(d_dis=0.3)).targets
    assert set(weights_of(targets, Settings(coverage_rule="paper")).tolist()) == {1}
    lengths = weights_of(targets, Settings()) / 1e6
    assert lengths.sum() == pytest.approx(14.0 + 15.6, abs=1e-3)


def closet_beside_a_hall() -> FloorPlan:
    """A hall of 12 × 8 m and a closet of 2 × 2 m that shows 8 of 48 m: less than the 10 % left over."""
    return floor_of(
        box(0, 0, 14.2, 8),
        rooms=(room("hall", box(0, 0, 12, 8)), room("closet", box(12.2, 0, 14.2, 2))),
        openings=(door("d", (12.1, 0.5), (12.1, 1.4)),),
        elements=(
            shell(0, 0, 14.2, 8),
            wall("south", box(12, 0, 12.2, 0.5)),
            wall("north", box(12, 1.4, 12.2, 8)),
            wall("block", box(12.2, 2, 14.2, 8)),
        ),
    )


def test_no_room_is_given_up_for_the_whole() -> None:
    for share_of_room in (0.0, 0.7, 0.9):
        settings = Settings(range=20, coverage=0.8, room_coverage=share_of_room, kind_coverage=0)
        _, nouns = planned(closet_beside_a_hall(), settings)
        found = nouns[Selection]
        rooms = found.space.unit_room
        assert share(found, rooms == 1) >= share_of_room
        assert share(found, np.ones(len(rooms), dtype=bool)) >= 0.8
    assert len(found.chosen) == 2


def test_no_kind_is_given_up_for_the_whole() -> None:
    columns = [column(f"c{k}", 2 + 2 * k, 3, side=0.2) for k in range(5)]
    floor = hall(12, 6, *columns)
    for least in (0.0, 0.95):
        _, nouns = planned(floor, Settings(range=10, coverage=0.7, kind_coverage=least, room_coverage=0))
        found = nouns[Selection]
        assert share(found, units_of(found.space, "columns")) >= least
    assert len(found.chosen) >= 2


@pytest.mark.parametrize("degrees", [0.0, 33.0])
def test_a_wall_belongs_to_the_room_it_faces(degrees: float) -> None:
    space = navigable(moved(two_rooms(1.0), turned(degrees)), Settings())
    back = turned(-degrees)(space.targets.unit_xy)
    a, b = (turned(-degrees)(end) for end in (space.targets.a, space.targets.b))
    left = (back[:, 0] < 3.9001) & (back[:, 1] > -0.001) & (back[:, 1] < 4.001) & (back[:, 0] > -0.001)
    facade = (back[:, 0] < -0.1) | (back[:, 0] > 8.1) | (back[:, 1] < -0.1) | (back[:, 1] > 4.1)
    assert set(space.unit_room[facade].tolist()) == {-1}
    jamb = (
        (np.abs(a[:, 1] - b[:, 1]) < 1e-4)[space.targets.unit_segment]
        & ~facade
        & (np.abs(back[:, 0] - 4) < 0.1)
    )
    assert set(space.unit_room[left & ~jamb].tolist()) == {0}
    assert set(space.unit_room[jamb].tolist()) <= {0, 1}
    assert jamb.sum() > 0


def test_a_beam_belongs_to_the_room_it_lies_over() -> None:
    floor = two_rooms(1.0, more=(element("b", "beams", box(5, 1, 7, 1.2)),))
    space = navigable(floor, Settings())
    assert set(space.unit_room[units_of(space, "beams")].tolist()) == {1}


def test_stops_in_doorways_count_for_what_they_see() -> None:
    """Three rooms in a row of 3 × 3 m: two doorways see all three rooms, so nothing else is needed."""
    walls = [
        wall(f"{k}{n}", box(3.2 * k - 0.2, y0, 3.2 * k, y1))
        for k in (1, 2)
        for n, y0, y1 in (("s", 0, 1), ("n", 2, 3))
    ]
    floor = floor_of(
        box(0, 0, 9.4, 3),
        rooms=tuple(room(f"r{k}", box(3.2 * k, 0, 3.2 * k + 3, 3)) for k in range(3)),
        openings=tuple(door(f"d{k}", (3.2 * k - 0.1, 1), (3.2 * k - 0.1, 2)) for k in (1, 2)),
        elements=(shell(0, 0, 9.4, 3), *walls),
    )
    for selector in ("default", "greedy", "exact"):
        mission, nouns = planned(floor, Settings(door_scan=True, coverage=0.85, selector=selector))
        found = nouns[Selection]
        assert sum(stop.doorway for stop in mission.stops) == 2
        assert len(mission.stops) == fewest_beside(found, 2)


def fewest_beside(found: Selection, fixed: int) -> int:
    """Stops needed by trying all sets of candidates next to the doorways."""
    visibility = found.visibility
    doorways = visibility.candidates.doorway_rows.tolist()
    assert len(doorways) == fixed
    others = [row for row in range(visibility.rows) if row not in doorways]
    space, settings = visibility.space, visibility.settings
    members = [(np.ones(len(space.unit_room), dtype=bool), settings.coverage)]
    members += [(space.unit_room == k, settings.least_of_room) for k in range(len(space.rooms))]
    for more in range(4):
        for rows in combinations(others, more):
            chosen = replace(found, chosen=np.array([*doorways, *rows]))
            if all(share(chosen, member) >= least - 1e-9 for member, least in members):
                return fixed + more
    raise AssertionError("more than three stops beside the doorways")


def test_positions_off_the_pattern_may_save_a_stop_and_never_cost_one() -> None:
    """From the middle of a hall of 7 × 4 m a scanner of 4 m sees 96 % of it; a grid of 2.5 m misses it."""
    floor = hall(7, 4)
    stops = {}
    for refine in (False, True):
        _, nouns = planned(floor, Settings(grid=2.5, range=4, coverage=0.95, refine=refine))
        stops[refine] = nouns[Selection]
    assert (len(stops[True].chosen), len(stops[False].chosen)) == (1, 2)
    assert np.array_equal(stops[True].visibility.visible, stops[False].visibility.visible)


def test_the_papers_rule_offers_nothing_off_the_pattern() -> None:
    _, nouns = planned(hall(7, 4), Settings(coverage_rule="paper"))
    assert not len(nouns[Selection].candidates.extra_rows)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"coverage_rule": "paper", "room_coverage": 0.7}, "--room-coverage 0.7"),
        ({"coverage_rule": "paper", "refine": True}, "--refine: does"),
        ({"fov": 120.0, "refine": True}, "--fov 120"),
        ({"kind_coverage": 1.2}, "between 0 and 1"),
    ],
)
def test_what_would_be_ignored_is_refused(given: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        read_settings(None, given)
