"""Simulated pairs of scans: components, and position errors after the adjustment of all pairs together."""

from __future__ import annotations

import math
from dataclasses import replace as changed

import numpy as np
import pytest
from msgspec.structs import replace

from stopgo.mission.document import Mission, PositionError
from stopgo.mission.geometry import FloatArray
from stopgo.mission.proof.plan_proof import PlanProof, ScanPair
from stopgo.mission.settings import Settings
from stopgo.mission.stages.network import CONTROL_FRAME
from stopgo.planner.scan_simulation.registration import Registered
from stopgo.planner.scan_simulation.scan_network import scan_network
from tests.mission.worlds import mission_of, stop
from tests.planner.scan_simulation.test_verification import COARSEST, verified
from tests.planner.worlds import two_rooms

FIRM = np.diag([500.0, 500.0, 5000.0])
CORNERS = ((0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0))
AT = np.array(CORNERS)
"""Positions of the scans."""
MISSION = mission_of(*(stop(f"s{k}", corner) for k, corner in enumerate(CORNERS, start=1)))


def pair(
    a: int,
    b: int,
    error: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    information: FloatArray = FIRM,
    registers: bool = True,
) -> Registered:
    """A pair whose second scan lies `error` (x, y, heading) off in the first."""
    x, y, turn = error
    there = np.eye(4)
    there[:2, :2] = [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    there[:2, 3] = AT[b] - AT[a] + (x, y)
    off_m = math.hypot(x, y) if registers else 1.0
    found = ScanPair(f"s{a + 1}", f"s{b + 1}", 0.5, None, off_m, math.degrees(abs(turn)))
    return Registered(found, there, information)


def errors(*pairs: Registered) -> list[float]:
    return list(scan_network(MISSION, AT, pairs).errors_m.values())


def test_pairs_without_error_leave_none() -> None:
    assert errors(*(pair(k, k + 1) for k in range(3))) == pytest.approx([0.0] * 4)


def test_errors_of_a_chain_add_up() -> None:
    """The second scan is turned by 0.1 mrad: what hangs on it moves with its distance from it."""
    found = errors(pair(0, 1, (0.001, 0.0, 1e-4)), pair(1, 2), pair(2, 3))
    assert found[:2] == pytest.approx([0.0, 0.001])
    assert found[2] == pytest.approx(0.001 - 4 * 1e-4, abs=1e-6)
    assert found[3] == pytest.approx(math.hypot(0.001 - 4 * 1e-4, 6 * 1e-4), abs=1e-6)


def test_a_loop_shares_out_what_one_pair_is_off() -> None:
    loop = [pair(k, k + 1) for k in range(3)]
    off = (0.008, 0.0, 0.0)
    assert 0.001 < max(errors(*loop, pair(3, 0, off))) < 0.008
    assert max(errors(*loop, pair(3, 0, off, information=FIRM * 1e-6))) < 1e-6


def test_a_scan_that_registers_with_none_is_a_component_of_its_own() -> None:
    pairs = [pair(0, 1), pair(1, 2, (0.002, 0.0, 0.0)), pair(2, 3, registers=False)]
    network = scan_network(MISSION, AT, pairs)
    assert [len(piece) for piece in network.pieces] == [3, 1]
    assert (network.worst, network.adrift_m) == ("s3", pytest.approx(0.002))


def framed(*, holds: int | None) -> Mission:
    """The mission with predicted errors of 3 mm, in the frame of one stop, or of control points."""
    claims = [PositionError(*(2 * [0.0 if k == holds else 0.003]), 0.0) for k in range(4)]
    stops = tuple(replace(one, error=claim) for one, claim in zip(MISSION.stops, claims, strict=True))
    return replace(MISSION, stops=stops)


def test_errors_are_in_the_frame_that_the_plan_has() -> None:
    """The fourth scan hangs on none: its error in this frame is not zero, it is not known."""
    network = scan_network(framed(holds=2), AT, [pair(0, 1), pair(1, 2, (0.002, 0.0, 0.0))])
    assert network.frame == "s3"
    assert network.errors_m == pytest.approx({"s1": 0.002, "s2": 0.002, "s3": 0.0})


def test_without_a_frame_of_the_plan_errors_are_in_that_of_the_largest_component() -> None:
    network = scan_network(MISSION, AT, [pair(1, 2), pair(2, 3, (0.002, 0.0, 0.0))])
    assert network.frame == "s2"
    assert network.errors_m == pytest.approx({"s2": 0.0, "s3": 0.0, "s4": 0.002})


def test_control_points_hold_the_frame_of_the_scans_that_see_two() -> None:
    """The second scan sees both points where they are; the fourth scan hangs on none."""
    mission = framed(holds=None)
    pairs = [pair(0, 1, (0.003, 0.0, 0.0)), pair(1, 2, (0.0, 0.002, 0.0))]
    points = [(1, np.array(at)) for at in ((5.0, 1.0), (5.0, 3.0))]
    network = scan_network(mission, AT, pairs, points)
    assert network.frame == CONTROL_FRAME
    assert network.errors_m == pytest.approx({"s1": 0.003, "s2": 0.0, "s3": 0.002})
    assert scan_network(mission, AT, pairs, points[:1]).frame == "s1"


def test_scans_turn_onto_the_control_points_that_several_of_them_see() -> None:
    """The second scan puts its point 6 mm off, the first its own right: a turn of 1 mrad explains both."""
    points = [(0, np.array([0.0, 1.0])), (1, np.array([6.0, 1.0]))]
    network = scan_network(framed(holds=None), AT, [pair(0, 1, (0.0, 0.006, 0.0))], points)
    assert network.errors_m == pytest.approx({"s1": 0.001, "s2": 0.001}, rel=0.1)


@pytest.fixture(scope="module")
def proof() -> PlanProof:
    return verified(two_rooms(0.9), Settings(range=4.0), COARSEST)


def test_an_accuracy_that_the_scans_miss_is_not_met(proof: PlanProof) -> None:
    worst = 1000 * proof.network.adrift_m
    assert not [line for line in proof.unmet if "position error" in line]
    strict = changed(proof, accuracy_mm=worst / 2)
    assert f"{proof.network.worst}: position error {worst:.1f} mm, {worst / 2:g} mm required" in strict.unmet
    assert changed(proof, accuracy_mm=worst * 1.01).unmet == proof.unmet


def test_a_scan_that_hangs_on_none_is_neither_accurate_nor_within_its_prediction(proof: PlanProof) -> None:
    names = [stop.id for stop in proof.mission.stops]
    errors = {names[0]: 0.0}
    torn = changed(proof, network=changed(proof.network, errors_m=errors, frame=names[0]), accuracy_mm=1000.0)
    assert f"{names[1]}: not connected with {names[0]}, position error of 1000 mm required" in torn.unmet
    assert torn.within_prediction == 1 < proof.within_prediction
