"""Instance cache: a derived value is stored with its instance only."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

from stopgo.mission.settings import Settings
from stopgo.planner.geometry.shapes import local_origin
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
