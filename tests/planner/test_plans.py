"""Whole plans of real floors, checked by plain shapely and brute force."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stopgo.mission.document import Mission
from stopgo.mission.files.mission_json import encode
from stopgo.mission.floor import FloorPlan
from stopgo.mission.geometry import polyline_length
from stopgo.mission.settings import Settings
from stopgo.mission.stages import Candidates, NavigableSpace, Selection
from stopgo.planner import plan
from stopgo.planner.appraisal.unreached import unreached
from stopgo.planner.candidates import candidates
from stopgo.planner.floors import read_floor
from stopgo.planner.space.navigable import navigable
from tests.faults.sizes import FULL, some
from tests.planner.checking.test_claims import counted
from tests.planner.checks import check_plan, check_rooms_are_joined
from tests.planner.worlds import FLOORS, changed, moved, planned, shared, shifted, turned

LARGEST = "layered/office-l1.dxf"
AGAIN = FLOORS if FULL else [name for name in FLOORS if name != LARGEST and "case1" not in name]
"""In the short form, the floors that take a second at most: the others take five times as long together."""


@cache
def the_plan(name: str) -> tuple[Mission, dict[type, Any]]:
    return planned(shared(name))


@pytest.mark.parametrize("name", AGAIN)
def test_a_real_floor_is_planned_well(name: str) -> None:
    mission, nouns = the_plan(name)
    check_plan(mission, nouns, Settings())
    assert nouns[Selection].coverage >= 0.9


@pytest.mark.parametrize("name", some([name for name in AGAIN if name != LARGEST], every=3))
def test_what_a_plan_of_a_real_floor_claims_is_so(name: str) -> None:
    mission, nouns = the_plan(name)
    found, problems = counted(mission, nouns)
    assert problems == []
    assert found.share == nouns[Selection].coverage


@pytest.mark.parametrize("name", [name for name in AGAIN if "structural" not in name])
def test_rooms_joined_by_a_passable_opening_are_connected(name: str) -> None:
    assert check_rooms_are_joined(the_plan(name)[1][NavigableSpace]) > 0


@pytest.mark.parametrize("name", some(AGAIN, every=2))
def test_two_plans_of_a_floor_are_the_same_bytes(name: str) -> None:
    assert encode(planned(shared(name))[0]) == encode(the_plan(name)[0])


@pytest.mark.parametrize("name", [name for name in AGAIN if name != LARGEST])
def test_the_order_of_entities_does_not_change_a_plan(name: str) -> None:
    """Stairs, which are no targets, meet walls in case 2: whose face it is depends on the order."""
    one, other = the_plan(name)[0], planned(in_another_order(name))[0]
    assert one.network
    assert encode(one) == encode(other)


def in_another_order(name: str) -> FloorPlan:
    """A floor with its entities in another order."""
    random = np.random.default_rng(1)
    original = shared(name)

    def shuffled(items: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(items[k] for k in random.permutation(len(items)))

    return replace(
        original,
        outline=shuffled(original.outline),
        rooms=shuffled(original.rooms),
        openings=shuffled(original.openings),
        elements=shuffled(original.elements),
    )


@pytest.mark.parametrize(
    "name", some([name for name in AGAIN if "rooms" in name or "duplex" in name], every=2)
)
def test_elements_drawn_twice_do_not_change_a_plan(name: str) -> None:
    original = shared(name)
    other = replace(original, elements=original.elements + original.elements[::3])
    assert encode(planned(other)[0]) == encode(the_plan(name)[0])


REAL = ("layered/fzk-haus-eg.dxf", "paper/synthetic_case2_rooms.dxf")
OTHERS = (
    Settings(d_sec=0.35, edge=0.0, grid=0.7),
    Settings(robot_radius=0.25, range=10.0, coverage=1.0, d_dis=0.2),
    Settings(doors="closed", coverage=0.5, tour="closed"),
    Settings(targets=("columns", "walls", "beams"), selector="greedy"),
    Settings(d_sec=1.0, door_access=0.8, d_dis=0.2),
    Settings(edge=0.0, d_dis=0.1),
    Settings(candidates="triangulation"),
    Settings(selector="exact", d_dis=0.2, node_limit=200),
    Settings(router="aco", d_dis=0.1),
    Settings(door_scan=True, d_dis=0.1),
    Settings(door_candidates=True, coverage=1.0, d_dis=0.1),
    Settings(fov=120.0, d_dis=0.2),
)
"""In the short form, every fifth pair of these and a floor."""


@pytest.mark.parametrize(
    ("name", "settings"),
    some([(name, settings) for name in REAL for settings in OTHERS], every=5),
    ids=lambda case: case if isinstance(case, str) else ", ".join(changed(case)),
)
def test_other_settings_are_planned_well(name: str, settings: Settings) -> None:
    mission, nouns = planned(shared(name), settings)
    check_plan(mission, nouns, settings, brute=settings.fov == 360)


TURNED = some(["layered/fzk-haus-eg.dxf", "paper/synthetic_case1_rooms.dxf"], every=2)


@pytest.mark.parametrize("degrees", [17.0, 45.0])
@pytest.mark.parametrize("name", TURNED)
def test_a_turned_floor_is_planned_well_and_alike(name: str, degrees: float) -> None:
    there, nouns = planned(moved(shared(name), turned(degrees)))
    check_plan(there, nouns, Settings(), brute=False)
    here, straight = the_plan(name)
    visible = [found[Selection].visibility.visible.sum() for found in (nouns, straight)]
    assert abs(visible[0] / visible[1] - 1) <= 0.01
    assert abs(len(there.stops) - len(here.stops)) <= 1


def test_a_shifted_floor_has_the_shifted_plan() -> None:
    by = np.array([4096.0, -512.25])
    here = the_plan("layered/fzk-haus-eg.dxf")[0]
    there = planned(moved(shared("layered/fzk-haus-eg.dxf"), shifted(*by)))[0]
    assert len(there.stops) == len(here.stops)
    for one, other in zip(there.stops, here.stops, strict=True):
        assert np.allclose(np.subtract((one.x, one.y), by), (other.x, other.y), atol=1e-5)
        lengths = [polyline_length(np.array(stop.approach)) for stop in (one, other)]
        assert lengths[0] == pytest.approx(lengths[1], abs=1e-4)


SAMPLE = Path(__file__).parents[2] / "recordings" / "samples" / "office.dxf"


def test_a_floor_with_one_room_not_drawn_is_planned_all_the_same() -> None:
    office = read_floor(SAMPLE)
    settings = Settings(register=False)
    mission, nouns = planned(office, settings)
    for name in ("105 Corridor", "104 Open office"):
        less = replace(office, rooms=tuple(room for room in office.rooms if room.name != name))
        there, others = planned(less, settings)
        check_plan(there, others, settings, brute=False)
        assert unreached(others[Candidates]) == ()
        assert abs(len(there.stops) - len(mission.stops)) <= 1
        seen = [found[Selection].visibility.visible.sum() for found in (nouns, others)]
        assert seen[1] == pytest.approx(seen[0], rel=1e-3)


@pytest.mark.parametrize("name", some(["140 OPEN OFFICE", "151 BOC"], every=2))
def test_the_office_with_one_room_not_drawn_is_reached_all_the_same(name: str) -> None:
    office = shared(LARGEST)
    less = replace(office, rooms=tuple(room for room in office.rooms if room.name != name))
    assert len(less.rooms) == len(office.rooms) - 1
    here, there = (candidates(navigable(floor, Settings())) for floor in (office, less))
    assert there.part_area[0] == pytest.approx(here.part_area[0], rel=1e-3)
    assert len(there.kept) == pytest.approx(len(here.kept), rel=0.02)


def test_all_parts_of_the_duplex_are_planned_apart() -> None:
    _, nouns = the_plan("layered/duplex-l1.dxf")
    made = plan(nouns[FloorPlan], nouns[NavigableSpace].settings, all_parts=True)
    assert len(made.parts) >= 2
    assert len({part.candidates.chosen_part for part in made.parts}) == len(made.parts)
    for part in made.parts:
        check_plan(part.mission, {type(noun): noun for noun in part.stage_results()}, made.settings)
