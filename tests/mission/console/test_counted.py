"""Counts with their nouns: one of a thing is never plural."""

from __future__ import annotations

import numpy as np

from stopgo.mission.console.table import counted
from stopgo.planner.floors.ifc.storey_plan import _named
from stopgo.recordings.logs.field_log import poses_of


def test_a_count_has_its_noun() -> None:
    assert [counted(n, "gap") for n in (0, 1, 2)] == ["0 gaps", "1 gap", "2 gaps"]
    assert [counted(n, "entry", "entries") for n in (1, 2)] == ["1 entry", "2 entries"]


def test_one_gap_and_one_jump_of_a_log_are_singular() -> None:
    seconds = np.r_[np.arange(50) / 10, 60 + np.arange(50) / 10]
    xy = np.column_stack([np.where(np.arange(100) < 20, 0.0, 9.0), np.zeros(100)])
    found = poses_of("poses", "map", (seconds * 1e9).astype(np.int64), xy, np.zeros(100))
    assert found is not None
    assert any(line.startswith("1 gap without poses") for line in found.oddities)
    assert any(line.startswith("1 jump of position") for line in found.oddities)


def test_one_element_of_a_model_is_singular() -> None:
    (one,) = _named("no_body", ["IfcWall a"], "have no body in the model and are left out")
    assert one.message == "1 element has no body in the model and is left out: IfcWall a"
    (two,) = _named("no_body", ["a", "b"], "have no body in the model and are left out")
    assert two.message.startswith("2 elements have no body in the model and are left out")
