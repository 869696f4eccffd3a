"""Targets that count although fewer stops see them than required: the plan says how much."""

from __future__ import annotations

from stopgo.mission.settings import Settings
from stopgo.mission.stages import Selection
from stopgo.planner.appraisal.quality import FEWER_VIEWS, fewer_views
from tests.planner.worlds import column, hall, planned

HALL = hall(9, 6, column("a", 3, 3))


def test_targets_with_a_single_view_are_reported() -> None:
    """One candidate in the hall: all that it sees counts, from one stop instead of two."""
    mission, nouns = planned(HALL, Settings(views=2, grid=3.0))
    (finding,) = fewer_views(nouns[Selection])
    assert len(mission.stops) == 1
    assert finding.code == FEWER_VIEWS
    seen = nouns[Selection].visibility.seen_by(int(nouns[Selection].chosen[0]))
    metres = nouns[Selection].targets.unit_length[seen].sum()
    assert finding.message.startswith(f"{metres:.1f} m count as covered from fewer than 2 stops")


def test_one_view_is_never_too_few() -> None:
    assert list(fewer_views(planned(HALL)[1][Selection])) == []
