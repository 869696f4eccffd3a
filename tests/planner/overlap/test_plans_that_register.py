"""Plans whose scans register: one network, reported and checked; remedies for separate components."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from stopgo.mission.document import stop_names
from stopgo.mission.errors import InputError, NegativeResult
from stopgo.mission.files.plan_toml import recorded_settings
from stopgo.mission.floor import FloorPlan
from stopgo.mission.settings import Settings
from stopgo.mission.settings.parameter_checks import check_settings
from stopgo.mission.stages import NavigableSpace
from stopgo.mission.stages.network import Network, network_of
from stopgo.planner import plan
from stopgo.planner.candidates import candidates
from stopgo.planner.checking.network_claims import network_overclaims
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.overlap import links_of
from stopgo.planner.overlap.registered import SCANS_APART, registered_pairs
from stopgo.planner.pipeline.follow_up_mission import PlannedFloor, top_up
from stopgo.planner.selection.separators import components_of
from stopgo.planner.space.navigable import navigable
from tests.planner.worlds import box, door, floor_of, planned, room, shell, two_rooms, wall

ASKED = Settings(d_sec=0.4, edge=0.0, overlap=0.1, seed=1)
LOOSE = replace(ASKED, register=False, overlap=None)


def three_rooms(*, gap: float = 0.9) -> FloorPlan:
    """Three rooms in a row, 4 m x 4 m each, with a door between neighbours."""
    low, high = 2 - gap / 2, 2 + gap / 2
    walls = [
        wall(f"w{k}", box(x, 0, x + 0.2, low), box(x, high, x + 0.2, 4)) for k, x in enumerate((4.0, 8.2))
    ]
    return floor_of(
        box(0, 0, 12.4, 4),
        rooms=[room(f"r{k}", box(x, 0, x + 4, 4)) for k, x in enumerate((0, 4.2, 8.4))],
        openings=[door(f"d{k}", (x + 0.1, low), (x + 0.1, high)) for k, x in enumerate((4.0, 8.2))],
        elements=[shell(0, 0, 12.4, 4), *walls],
    )


@pytest.fixture(scope="module")
def made() -> PlanReport:
    return PlanReport(plan(three_rooms(), ASKED).first, {}, {})


def test_the_plan_is_one_network_and_its_pairs_are_counted_again(made: PlanReport) -> None:
    network = network_of(made.mission)
    assert network is not None
    assert len(network.pieces) == 1
    assert not list(network_overclaims(made.mission, made.part.space))
    told = made.as_json()["network"]
    assert told["pieces"] == network.pieces
    assert "network     connected" in made.as_text()


def test_errors_grow_with_the_noise_of_the_scanner(made: PlanReport) -> None:
    """Three times as much noise predicts three times the errors; `check` knows."""
    noisy = PlanReport(plan(three_rooms(), replace(ASKED, range_noise=6.0)).first, {}, {})
    few, many = network_of(made.mission), network_of(noisy.mission)
    assert few is not None and many is not None
    one, other = (float(network.error_in_words(few.overlaps[0]).split()[0]) for network in (few, many))
    assert other == pytest.approx(3 * one, abs=0.2)
    assert len(many.stops) >= len(few.stops)
    assert not list(network_overclaims(noisy.mission, noisy.part.space))
    assert list(network_overclaims(made.mission, noisy.part.space))  # a third of the errors is claimed


def test_a_pair_that_says_more_than_is_counted_is_a_problem(made: PlanReport) -> None:
    pairs = made.mission.network
    assert not isinstance(pairs, msgspec.UnsetType)
    more = msgspec.structs.replace(pairs[0], hold_m=pairs[0].hold_m + 0.01)
    wrong = msgspec.structs.replace(made.mission, network=(more, *pairs[1:]))
    (problem,) = network_overclaims(wrong, made.part.space)
    assert problem.path == "$.network[0].hold_m"
    assert "counted line by line" in problem.message


def test_without_registration_there_is_no_network_and_not_more_stops(made: PlanReport) -> None:
    plain = plan(three_rooms(), LOOSE).mission
    assert network_of(plain) is None
    assert "network" not in msgspec.to_builtins(plain)
    assert len(plain.stops) <= len(made.mission.stops)


def test_rooms_that_cannot_see_one_another_are_reported_with_a_remedy() -> None:
    """No pair shares 99 % of a scan: every piece is reported, with where spheres would join it."""
    settings = replace(ASKED, doors="closed", overlap=0.99, candidates="grid")
    report = PlanReport(plan(three_rooms(), settings).first, {}, {})
    apart = [item for item in report.figures.grave if item.code == "scans_apart"]
    network = network_of(report.mission)
    assert network is not None
    assert len(apart) == len(network.pieces) - 1 > 0
    assert "a target sphere or board that" in apart[0].message
    assert "of 99.0 % required" in apart[0].message
    assert report.strict_exit_code == 1
    assert "COMPONENTS" in report.as_text()


@pytest.mark.parametrize("fov", [90.0, 180.0])
def test_scans_that_no_heading_of_a_limited_view_joins_pass_the_check(fov: float) -> None:
    """Without their headings, the candidates would see all round, and connect what no stop can."""
    mission, nouns = planned(two_rooms(1.0), Settings(fov=fov, grid=2.0))
    network = network_of(mission)
    assert network is not None and len(network.pieces) > 1
    assert list(network_overclaims(mission, nouns[NavigableSpace])) == []


def test_scans_of_a_limited_view_that_candidates_would_join_fail_the_check() -> None:
    mission, nouns = planned(two_rooms(1.0), Settings(fov=180.0))
    last, network = mission.stops[-1].id, network_of(mission)
    assert network is not None and len(network.pieces) == 1
    pairs = tuple(pair for pair in network.overlaps if last not in (pair.a, pair.b))
    stops = tuple(msgspec.structs.replace(stop, error=msgspec.UNSET) for stop in mission.stops)
    torn = msgspec.structs.replace(mission, network=pairs, stops=stops)
    (problem,) = network_overclaims(torn, nouns[NavigableSpace])
    assert problem.path == "$.network" and "apart" in problem.message


def test_a_plan_that_nobody_asked_to_register_reports_into_how_many_pieces_its_scans_fall() -> None:
    report = PlanReport(plan(three_rooms(), replace(LOOSE, range=3.0)).first, {}, {})
    (told,) = [item for item in report.figures.findings if item.code == "scans_not_joined"]
    joined = Network(tuple(stop_names(len(report.mission.stops))), registered_pairs(report.part.route))
    assert len(joined.pieces) > 1
    count = len(joined.pieces)
    assert told.message.startswith(f"the scans fall into {count} components that no common surfaces connect")
    assert told.message in report.as_text()
    assert report.strict_exit_code == 0, "a surveyor may have spheres"


def test_a_plan_whose_scans_join_anyway_says_nothing() -> None:
    made = plan(floor_of(box(0, 0, 6, 4), elements=(shell(0, 0, 6, 4),)), LOOSE)
    assert not [item for item in made.first.figures.findings if item.code in SCANS_APART]


def test_a_further_mission_joins_the_scans_that_were_taken(made: PlanReport) -> None:
    """One position in each outer room sees all of it; the additional stops of the middle room join both."""
    space = made.part.space
    planned = PlannedFloor(
        space.floor, replace(space.settings, coverage=0.5, room_coverage=0.0), made.mission
    )
    driven = np.array([(2.0, 1.0, 0.0), (10.4, 3.0, 0.0)])
    loose = top_up(replace(planned, settings=replace(planned.settings, register=False, overlap=None)), driven)
    joining = top_up(planned, driven)
    assert joining is not None
    assert loose is None or len(loose.stops) <= len(joining.stops)
    places = [*driven[:, :2].tolist(), *((stop.x, stop.y) for stop in joining.stops)]
    asked = replace(planned.settings, use=tuple(map(tuple, places)))
    rows = candidates(navigable(space.floor, asked))
    taken = np.array([np.flatnonzero((rows.xy[rows.kept] == place).all(axis=1))[0] for place in places])
    assert len(components_of(links_of(rows), taken)) == 1


def test_scans_register_by_default_and_not_by_the_paper_s_rule() -> None:
    assert Settings().registers
    assert not Settings(coverage_rule="paper").registers
    assert not Settings(register=False).registers
    made = plan(three_rooms(), Settings(d_sec=0.4, edge=0.0)).mission
    network = network_of(made)
    assert network is not None
    assert len(network.pieces) == 1


def test_an_overlap_ratio_of_scans_that_need_not_register_is_refused() -> None:
    with pytest.raises(InputError, match=r"--overlap 0\.1: has no effect with --no-register"):
        check_settings(replace(ASKED, register=False))
    check_settings(LOOSE)


@pytest.mark.parametrize("overlap", [None, 0.1])
def test_a_mission_of_an_earlier_version_registers_only_if_it_gave_an_overlap(overlap: float | None) -> None:
    made = plan(three_rooms(), replace(LOOSE, range=3.0)).mission
    before = {key: value for key, value in made.origin.parameters.items() if key != "register"}
    settings = recorded_settings({**before, **({"overlap": overlap} if overlap else {})})
    assert settings.registers == (overlap is not None)
    space = navigable(three_rooms(), settings)
    problems = [problem.path for problem in network_overclaims(made, space)]
    assert problems == (["$.network"] if overlap else [])


def test_a_separate_scan_is_reported_with_the_reason_and_a_position_for_a_target() -> None:
    """A corridor of 60 m whose ends no stop in its middle sees: its walls hold nothing along it."""
    corridor = floor_of(box(0, 0, 60, 3), elements=(shell(0, 0, 60, 3),))
    asked = Settings(d_sec=0.5, edge=0.0, overlap_range=8.0, range=8.0)
    made = plan(corridor, asked).first
    told = [item for item in made.figures.findings if item.code == "scans_apart"]
    assert told
    assert all("a target sphere or board" in item.message and item.at is not None for item in told)
    assert any("no surface that both see holds them along" in item.message for item in told)


def test_doorways_alone_are_no_candidates() -> None:
    with pytest.raises(NegativeResult, match="no candidate is left"):
        plan(three_rooms(), replace(ASKED, d_sec=100.0))
