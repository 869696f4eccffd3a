"""Reasons for a stop's position: figures that can be checked on paper."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest

from stopgo.mission.geometry import frozen
from stopgo.mission.stages import Route, Visibility
from stopgo.mission.stages.stop_reasons import StopReason, driven_coverage, stop_reasons
from tests.recordings import world


def route() -> Route:
    return world.nouns_at()[5]


def test_what_a_stop_sees_and_what_it_alone_sees() -> None:
    """14 units of 0.1 m are visible; S1 sees 8 of them and S2 four of these and 3 more."""
    first, second = stop_reasons(route(), ("S1", "S2"))
    assert (first.units, first.alone_units, second.units, second.alone_units) == (8, 4, 7, 3)
    assert first.sees == pytest.approx(0.8) and first.new == pytest.approx(0.8)
    assert second.new == second.alone == pytest.approx(0.3)
    assert second.lost_fraction == pytest.approx(3 / 14)
    (room,) = second.rooms
    assert room.coverage == pytest.approx(8 / 14)
    assert [room.name for room in second.short] == ["Room 1"]
    assert second.coverage == pytest.approx(11 / 14)


def test_runners_up_would_have_seen_mostly_the_same() -> None:
    """Of S1's 8 units row 1 sees 4 and 3 others, 7 in all; row 2 sees 3 that S1 does not see."""
    (first, second) = stop_reasons(route(), ("S1", "S2"))
    assert [(item.candidate, round(item.new, 6)) for item in first.runners] == [(1, 0.7)]
    assert second.runners == ()
    assert "No other candidate" in second.sentences()[1]


def test_the_drive_gains_what_the_choice_gains_in_the_end() -> None:
    backwards = replace(route(), order=frozen([1, 0], "int64"))
    assert driven_coverage(route()) == pytest.approx([8 / 14, 11 / 14])
    assert driven_coverage(backwards) == pytest.approx([7 / 14, 11 / 14])
    assert [item.step for item in stop_reasons(backwards, ("S1", "S2"))] == [2, 1]


def test_a_stop_that_sees_nothing_alone_is_said_to_lose_nothing() -> None:
    twice = replace(route().selection, chosen=frozen([0, 0], "int64"))
    reasons = stop_reasons(replace(route(), selection=twice), ("S1", "S2"))
    assert "nothing would be lost" in reasons[0].sentences()[2]


def test_units_seen_twice_from_one_candidate_count_once() -> None:
    """A scanner in a doorway looks from both sides of the door."""
    seen = world.nouns_at()[3]
    assert isinstance(seen, Visibility)
    twice = replace(
        seen,
        pointer=frozen([0, 3, 5, 6], "int64"),
        segment=frozen([0, 0, 3, 0, 1, 4], "int64"),
        first=frozen([1, 0, 12, 0, 4, 16], "int64"),
        last=frozen([3, 2, 15, 3, 6, 18], "int64"),
    )
    assert twice.units_seen.tolist() == seen.units_seen.tolist() == [8, 7, 3]
    assert twice.seen_by(0).tolist() == seen.seen_by(0).tolist()


def test_where_two_views_are_asked_both_stops_are_needed() -> None:
    """Four units are seen by both; all others have but one candidate, and ask for one."""
    nouns = world.nouns_at()
    asking = replace(nouns[1].settings, views=2)
    space = replace(nouns[1], settings=asking)
    seen = replace(nouns[3], candidates=replace(nouns[2], space=space))
    made = replace(route(), selection=replace(route().selection, visibility=seen))
    first, second = stop_reasons(made, ("S1", "S2"))
    assert (first.alone_units, second.alone_units) == (8, 7)
    assert second.new == pytest.approx(0.7)
    assert driven_coverage(made) == pytest.approx([4 / 14, 11 / 14])


def test_reasons_survive_their_document() -> None:
    reasons = stop_reasons(route(), ("S1", "S2"))
    assert msgspec.json.decode(msgspec.json.encode(reasons), type=tuple[StopReason, ...]) == reasons
