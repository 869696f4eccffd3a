"""Branch and bound that is ended before it knows anything."""

from __future__ import annotations

from stopgo.mission.settings import Settings
from stopgo.planner.selection.exact_cover import exact
from stopgo.planner.selection.greedy import greedy
from tests.planner.checks import meets
from tests.planner.selection.test_swaps import cover_of_rooms


def test_a_search_without_time_keeps_its_start_and_proves_nothing() -> None:
    """HiGHS has no bound then: it reports minus infinity."""
    cover = cover_of_rooms(1)
    start = greedy(cover)
    rows, bound = exact(cover, start, settings=Settings(selector="exact", time_limit=1e-9))
    assert meets(cover, rows)
    assert len(rows) <= len(start)
    assert 0 <= bound <= len(rows)
