"""Floors without anything to scan: the refusal says why."""

from __future__ import annotations

from dataclasses import replace

import pytest

from stopgo.mission.errors import NegativeResult
from stopgo.mission.floor import Finding
from stopgo.mission.settings import Settings
from stopgo.planner.space.navigable import navigable
from tests.planner.worlds import box, floor_of


def test_a_floor_of_millimetres_is_refused_for_its_unit() -> None:
    """A model in metres whose header says millimetres: 12 m are 12 mm, and its walls vanish."""
    with pytest.raises(NegativeResult, match=r"it is only 0\.012 m across: correct the unit of length"):
        navigable(floor_of(box(0, 0, 0.012, 0.01)), Settings())


def test_a_floor_without_elements_is_refused_with_its_worst_finding() -> None:
    findings = (Finding("duplicate", "drawn twice"), Finding("invisible", "layer WALLS: 6 left out"))
    floor = replace(floor_of(box(0, 0, 12, 10)), findings=findings)
    with pytest.raises(NegativeResult, match=r"elements: none \(layer WALLS: 6 left out\)"):
        navigable(floor, Settings())
    with pytest.raises(NegativeResult, match="see --targets"):
        navigable(replace(floor, findings=()), Settings())
