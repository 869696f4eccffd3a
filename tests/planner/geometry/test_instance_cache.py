"""Instance cache: a derived value is stored with its instance only."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import shapely

from stopgo.mission.settings import Settings
from stopgo.planner.geometry.instance_cache import forget_all, taken
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.space.local_shapes import drive_area_of, drive_parts_of
from stopgo.planner.space.navigable import navigable
from stopgo.planner.space.reach import reach_of
from tests.planner.worlds import two_rooms
from tests.sources import MODULES


def test_it_is_worked_out_once_and_again_for_a_noun_with_other_values() -> None:
    space = navigable(two_rooms(0.9), Settings())
    assert reach_of(space) is reach_of(space)
    other = replace(space, settings=Settings(robot_radius=0.2))
    assert reach_of(other) is not reach_of(space)
    assert local_origin(space.floor) is local_origin(space.floor)


def test_what_is_stored_is_what_would_be_worked_out() -> None:
    space = navigable(two_rooms(0.9), Settings())
    again = replace(space)
    assert drive_area_of(space) is not drive_area_of(again)
    assert shapely.to_wkb(drive_area_of(space)) == shapely.to_wkb(drive_area_of(again))
    parts, once_more = drive_parts_of(space), drive_parts_of(again)
    assert shapely.to_wkb(parts.cells).tolist() == shapely.to_wkb(once_more.cells).tolist()
    assert parts.cell_part.tolist() == once_more.cell_part.tolist()


def test_it_goes_with_the_noun() -> None:
    space = navigable(two_rooms(0.9), Settings())
    found = weakref.ref(reach_of(space))
    assert found() is not None
    del space
    gc.collect()
    assert found() is None


def test_no_module_keeps_nouns_alive() -> None:
    nouns = [name for name in MODULES if not name.startswith("stopgo.bridge.")]
    keeping = [name for name in nouns if "lru_cache" in MODULES[name].read_text(encoding="utf-8")]
    assert not keeping


def test_what_is_taken_is_forgotten() -> None:
    space = navigable(two_rooms(0.9), Settings())
    kept = drive_area_of(space)
    assert taken(drive_area_of, space) is kept
    assert drive_area_of(space) is not kept


def test_all_is_forgotten_that_was_derived_from_an_instance_and_nothing_else() -> None:
    space = navigable(two_rooms(0.9), Settings())
    kept, rooms = reach_of(space), space.rooms
    forget_all(space)
    assert space.rooms is rooms
    assert reach_of(space) is not kept
