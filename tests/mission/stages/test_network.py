"""A mission's network: pieces, bridges, the weakest pair, and what skipped stops leave of it."""

from __future__ import annotations

import msgspec
import pytest

from stopgo.mission.document import Overlap, digest_of, stop_names, with_digest
from stopgo.mission.document.problems import problems_of
from stopgo.mission.files.mission_json import encode, parse
from stopgo.mission.stages.network import Network, apart_in_words, network_lines, network_of, network_table
from tests.mission.worlds import square_tour as a_mission


def pair(a: int, b: int, hold: float = 1.0) -> Overlap:
    return Overlap(a=f"s{a:02d}", b=f"s{b:02d}", common_m=5.0, share=0.4, hold_m=hold)


def test_a_ring_with_a_tail() -> None:
    ring = (pair(1, 2), pair(2, 3, 0.2), pair(1, 3, 0.7), pair(3, 4, 0.6))
    network = Network(tuple(stop_names(4)), ring)
    assert network.pieces == (("s01", "s02", "s03", "s04"),)
    assert network.bridges == (pair(3, 4, 0.6),)
    assert network.weakest == pair(3, 4, 0.6)  # 2-3 is weaker and is gone round by 1-2 and 1-3
    assert network.among(["s01", "s02", "s04"]).pieces == (("s01", "s02"), ("s04",))


def test_bridges_are_what_parts_a_network_when_it_goes() -> None:
    pairs = (pair(1, 2), pair(2, 3), pair(3, 1), pair(3, 4), pair(4, 5), pair(5, 6), pair(6, 4), pair(7, 8))
    network = Network(tuple(stop_names(8)), pairs)
    for one in pairs:
        rest = Network(network.stops, tuple(item for item in pairs if item != one))
        assert (one in network.bridges) == (len(rest.pieces) > len(network.pieces))


def test_a_mission_with_a_network_reads_back_and_one_without_is_as_before() -> None:
    plain = a_mission()
    assert "network" not in msgspec.to_builtins(plain)
    assert network_of(plain) is None
    assert network_table(None) == {}
    assert network_lines(None) == []
    first, second = (stop.id for stop in plain.stops[:2])
    pairs = (Overlap(a=first, b=second, common_m=5.0, share=0.4, hold_m=1.0),)
    told = with_digest(msgspec.structs.replace(plain, network=pairs))
    assert digest_of(told) != plain.digest
    assert parse(encode(told), "test") == told
    assert not problems_of(told)


@pytest.mark.parametrize("wrong", [("s01", "nobody"), ("s01", "s01")])
def test_a_pair_of_no_two_stops_is_a_problem(wrong: tuple[str, str]) -> None:
    pairs = (Overlap(a=wrong[0], b=wrong[1], common_m=5.0, share=0.4, hold_m=1.0),)
    assert problems_of(msgspec.structs.replace(a_mission(), network=pairs))


def test_skipping_a_stop_in_between_is_reported() -> None:
    tour = a_mission()
    names = stop_names(3)
    stops = tuple(msgspec.structs.replace(tour.stops[0], id=name) for name in names)
    told = msgspec.structs.replace(tour, stops=stops, network=(pair(1, 2), pair(2, 3)))
    assert apart_in_words(told, names) == ""
    words = apart_in_words(told, ["s01", "s03"])
    assert words == "the scans are in 2 components without s02; separate: s03"
