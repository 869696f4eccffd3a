"""Scans as accurate as required: control points, more stops, and what is reported where neither suffices."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import msgspec
import numpy as np
import pytest

from stopgo.mission.errors import InputError
from stopgo.mission.files.plan_toml import read_settings
from stopgo.mission.plan import PartPlan
from stopgo.mission.settings import PARAMETERS, Settings
from stopgo.mission.stages.network import CONFIDENCE
from stopgo.planner import plan
from stopgo.planner.checking.network_claims import network_overclaims
from stopgo.planner.commands.plan_report import PlanReport
from stopgo.planner.geometry.shapes import local_origin
from stopgo.planner.overlap.control import seen_control
from stopgo.planner.overlap.network_error import TARGET_M, network_errors, worst_errors
from stopgo.planner.overlap.registered import predicted_errors
from stopgo.planner.space.navigable import navigable
from tests.planner.overlap.test_plans_that_register import three_rooms
from tests.planner.worlds import hall

ASKED = Settings(d_sec=0.4, edge=0.0, register=True, refine=False)
ONE = np.diag([1e6, 1e6, 1e6])
"""A pair with 1 mm in x and y, and 1 mrad."""


@cache
def made(**more: Any) -> PartPlan:
    return plan(three_rooms(), replace(ASKED, **more)).first


def worst_mm(part: PartPlan) -> float:
    return float(CONFIDENCE * 1000 * predicted_errors(part.route).m.max())


def test_two_control_points_hold_the_frame() -> None:
    """Two targets 10 m from the scan, to either side: each weighs half, and the scan lies between them."""
    points = [np.array((-10.0, 0.0)), np.array((10.0, 0.0))]
    covariances, frame = network_errors(np.zeros((1, 2)), [], [], [(0, point) for point in points])
    errors = worst_errors(covariances)
    assert frame is None
    assert errors[0] == pytest.approx(TARGET_M / math.sqrt(2))


def test_one_control_point_leaves_the_rotation_open() -> None:
    xy, seen = np.zeros((2, 2)), [(0, np.array((3.0, 0.0))), (1, np.array((3.0, 0.0)))]
    covariances, frame = network_errors(xy, [(0, 1)], [ONE], seen)
    errors = worst_errors(covariances)
    assert frame in (0, 1)
    assert errors.tolist().count(0.0) == 1


def test_control_points_of_two_scans_hold_their_network_together() -> None:
    """Each scan sees one point, and the pair joins them: the second point fixes the rotation."""
    seen = [(0, np.array((-10.0, 0.0))), (1, np.array((10.0, 0.0)))]
    covariances, frame = network_errors(np.zeros((2, 2)), [(0, 1)], [ONE], seen)
    errors = worst_errors(covariances)
    assert frame is None
    assert np.isfinite(errors).all()
    covariances, _ = network_errors(np.zeros((2, 2)), [], [], seen)
    alone = worst_errors(covariances)
    assert not np.isfinite(alone).all() or alone.tolist().count(0.0) >= 1


def test_a_control_point_behind_a_wall_or_too_far_away_is_not_seen() -> None:
    settings = replace(ASKED, control=((2.0, 1.0), (8.0, 1.0), (400.0, 1.0)))
    space = navigable(three_rooms(), settings)
    origin = local_origin(space.floor)
    (only,) = seen_control(space, np.array([(1.0, 1.0)]) - origin)
    assert only[0] == 0
    assert (only[1] + origin).tolist() == pytest.approx([2.0, 1.0])


def test_a_control_point_that_no_stop_sees_is_reported() -> None:
    """Such as one in millimetres, or within a wall: the network was in the frame of a stop without a word."""
    part = made(control=((2.0, 1.0), (2000.0, 1000.0)))
    told = [item for item in part.figures.findings if item.code == "control_unseen"]
    assert [item.at for item in told] == [(2000.0, 1000.0)]
    assert "the control point (2000, 1000) is seen by no stop within" in told[0].message


def test_further_stops_are_added_until_every_scan_is_accurate_enough() -> None:
    loose = made()
    before = worst_mm(loose)
    asked = round(0.9 * before, 1)
    tight = made(accuracy=asked)
    assert worst_mm(tight) <= asked
    assert len(tight.mission.stops) > len(loose.mission.stops)
    assert tight.selection.bound <= len(tight.selection.chosen)
    assert not list(network_overclaims(tight.mission, tight.space))


def test_an_accuracy_that_holds_already_costs_nothing() -> None:
    loose = made()
    assert len(made(accuracy=2 * worst_mm(loose)).mission.stops) == len(loose.mission.stops)


def test_an_accuracy_that_cannot_be_reached_is_reported_with_a_position_for_a_control_point() -> None:
    part = made(accuracy=0.01, grid=2.0)
    report = PlanReport(part, {}, {})
    (told,) = [item for item in report.figures.grave if item.code == "accuracy_not_met"]
    assert "with 0.01 mm required" in told.message
    assert "--control" in told.message
    assert told.at is not None
    assert report.exit_code == 1, "as check and prove, which refuse its mission"
    assert report.strict_exit_code == 1
    problems = list(network_overclaims(part.mission, part.space))
    assert [problem.path for problem in problems] == ["$.origin.parameters.accuracy"]


def test_missions_of_robots_report_an_accuracy_that_all_their_stops_do_not_reach() -> None:
    """By places: each mission has its own stop s01. They had no such finding, not even with --strict."""
    made_for_two = plan(
        three_rooms(), replace(ASKED, accuracy=0.01, grid=2.0, robots=2, start=(1.0, 1.0, 0.0))
    )
    for share in made_for_two.parts:
        (told,) = [item for item in share.figures.grave if item.code == "accuracy_not_met"]
        assert told.message.startswith("the predicted error of the stop at (")
        assert "in the frame of the stop at (" in told.message
        assert PlanReport(share, {}, {}).exit_code == 1


def test_check_finds_an_accuracy_that_missing_pairs_no_longer_give() -> None:
    tight = made(accuracy=round(0.9 * worst_mm(made()), 1))
    pairs = tight.mission.network
    assert isinstance(pairs, tuple)
    for dropped in pairs:
        rest = tuple(pair for pair in pairs if pair != dropped)
        fewer = msgspec.structs.replace(tight.mission, network=rest)
        if list(network_overclaims(fewer, tight.space)):
            return
    pytest.fail("every pair can be dropped")


@pytest.mark.parametrize(
    ("text", "millimetres"), [("5", 5.0), ("5mm", 5.0), ("0.5cm", 5.0), ("0.005m", 5.0), (" 5 mm ", 5.0)]
)
def test_an_accuracy_is_typed_with_or_without_a_unit(text: str, millimetres: float) -> None:
    assert PARAMETERS["accuracy"].given(text) == pytest.approx(millimetres)


@pytest.mark.parametrize("text", ["5ft", "mm", "", "nan", "0", "-1mm"])
def test_an_accuracy_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="--accuracy"):
        read_settings(None, {"accuracy": PARAMETERS["accuracy"].given(text or "x"), "register": True})


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"accuracy": 5.0, "register": False}, "no effect with --no-register"),
        ({"control": ((1.0, 2.0),), "coverage_rule": "paper"}, "no effect with --coverage-rule paper"),
        ({"accuracy": 5.0, "minimise": "time"}, "--minimise time"),
    ],
)
def test_an_accuracy_needs_scans_that_register(more: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        read_settings(None, more)


def test_a_single_scan_has_no_error_to_lower() -> None:
    settings = replace(ASKED, range=8.0, accuracy=0.1)
    part = plan(hall(4, 3), settings).first
    assert len(part.mission.stops) == 1
    assert not [item for item in part.figures.findings if item.code == "accuracy_not_met"]
