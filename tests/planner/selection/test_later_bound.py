"""The bound of a selection that is found during its route: the same as the bound that is found at once."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from typing import Any

import pytest

from stopgo.mission.settings import Settings
from stopgo.mission.stages import Route, Selection
from stopgo.planner import pipeline
from stopgo.planner.geometry import side_work
from stopgo.planner.selection import cover_problem, later_bound
from stopgo.planner.selection.bound import lower_bound
from stopgo.planner.selection.cover import Cover
from stopgo.planner.selection.later_bound import LaterBound
from tests.planner.worlds import hall, two_rooms

ALONE = Settings(refine=False, register=False)


def _unproved() -> tuple[Route, Cover]:
    """A route with the bound 0, and the problem of its selection."""
    found = pipeline.plan(hall(), ALONE).route
    selection = replace(found.selection, bound=0, method="greedy")
    return replace(found, selection=selection), cover_problem(found.visibility)[2]


def _never() -> Selection:
    raise AssertionError("the selection is made again")


def test_a_route_gets_the_bound_and_keeps_what_was_derived_from_it() -> None:
    route, problem = _unproved()
    length = route.length
    with LaterBound(_never) as later:
        assert later(problem, found=9) == 0
        proved = later.proved(route)
    assert proved.selection.bound == lower_bound(problem, found=9) == len(route.selection.chosen) == 1
    assert proved.selection.method == "greedy, proved fewest"
    assert vars(proved)["length"] == length


def test_a_bound_that_is_not_asked_for_changes_nothing() -> None:
    route, _ = _unproved()
    with LaterBound(_never) as later:
        assert later.proved(route) is route


def test_a_selection_is_made_again_if_its_process_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    def die(*_: object, **__: object) -> int:
        os.kill(os.getpid(), signal.SIGKILL)
        return 0

    monkeypatch.setattr(side_work, "can_fork", lambda: True)
    monkeypatch.setattr(later_bound, "lower_bound", die)
    route, problem = _unproved()
    with LaterBound(lambda: replace(route.selection, bound=7)) as later:
        later(problem, found=9)
        assert later.proved(route).selection.bound == 7


@pytest.mark.parametrize("many", [0, 10**9])
def test_a_plan_has_its_bound_in_the_end(monkeypatch: pytest.MonkeyPatch, many: int) -> None:
    """A bound of 1 by the process replaces that of the search, which counts for nothing here."""
    monkeypatch.setattr(pipeline, "MANY", many)
    monkeypatch.setattr(side_work, "can_fork", lambda: True)
    monkeypatch.setattr("stopgo.planner.selection.early_bound", lambda *_, **__: 0)
    monkeypatch.setattr("stopgo.planner.selection.relaxation_bound", lambda _: 0)
    seen: list[Any] = []
    made = pipeline.plan(two_rooms(0.9), Settings(refine=False), observe=seen.append)
    assert made.selection.bound > 0
    observed = [item for item in seen if isinstance(item, Selection)]
    assert observed[-1] is made.selection
    assert [item.bound > 0 for item in observed] == ([False, True] if many == 0 else [True])
