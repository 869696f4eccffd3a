"""Stop ids as numbers."""

from __future__ import annotations

import pytest

from stopgo.mission.document import Mission
from stopgo.mission.mavlink.stop_numbers import numbers_of, stop_numbered
from tests.mission.worlds import mission_of, stop


def named(*names: str) -> Mission:
    """Stops of these names in one place."""
    return mission_of(*(stop(name, (0.0, 0.0)) for name in names))


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (("s01", "s02", "s10"), (1, 2, 10)),
        (("S7", "S3"), (7, 3)),
        (("room 2 a", "room 3 b"), (1, 2)),
        (("lobby", "s7"), (1, 2)),
        (("a1", "b1"), (1, 2)),
        (("s65535", "s0"), (65_535, 0)),
        (("s65536", "s1"), (1, 2)),
        (("s٣", "s4"), (1, 2)),  # a digit, but none of ours
    ],
)
def test_ids_give_their_own_numbers_or_all_their_places(names, numbers):
    assert numbers_of(named(*names)) == numbers


def test_a_number_gives_back_the_stop():
    mission = named("s7", "s12")
    assert [stop_numbered(mission, number) for number in (7, 12.0, 8, 7.5)] == ["s7", "s12", None, None]
