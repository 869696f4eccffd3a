"""A mission that makes no sense is reported so, with the JSON path of each problem."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import pytest

from stopgo.mission.document import Mission
from stopgo.mission.document.problems import problems_of
from stopgo.mission.frames.transform import SiteOrigin
from tests.mission.worlds import room_mission, square_tour, stop

change = msgspec.structs.replace


def paths(mission: Mission) -> list[str]:
    return [problem.path for problem in problems_of(mission)]


def with_stop(index: int, **changes: Any) -> Mission:
    mission = square_tour()
    stops = list(mission.stops)
    stops[index] = change(stops[index], **changes)
    return change(mission, stops=tuple(stops))


@pytest.mark.parametrize("mission", [square_tour(), room_mission(), change(square_tour(), return_=None)])
def test_a_sound_mission_has_no_problems(mission: Mission) -> None:
    assert problems_of(mission) == ()


def test_two_stops_of_one_name_are_reported() -> None:
    (problem,) = problems_of(with_stop(1, id="S1"))
    assert str(problem) == "$.stops[1].id: is 'S1', already used by $.stops[0]"


def test_a_leg_ends_at_its_stop() -> None:
    (problem,) = problems_of(with_stop(1, approach=((4.0, 0.0), (4.0, 2.99))))
    assert str(problem) == "$.stops[1].approach[1]: (4.000, 2.990) is not stop S2 at (4.000, 3.000)"


def test_a_leg_begins_where_the_one_before_ended() -> None:
    (problem,) = problems_of(with_stop(1, approach=((4.1, 0.0), (4.0, 3.0))))
    assert str(problem) == "$.stops[1].approach[0]: (4.100, 0.000) is not stop S1 at (4.000, 0.000)"


def test_the_first_leg_begins_at_the_start_and_the_return_at_the_last_stop() -> None:
    assert paths(with_stop(0, approach=((0.1, 0.0), (4.0, 0.0)))) == ["$.stops[0].approach[0]"]
    assert paths(change(square_tour(), return_=((4.0, 0.0), (0.0, 0.0)))) == ["$.return[0]"]
    assert paths(change(square_tour(), return_=())) == ["$.return"]


def test_a_millimetre_is_the_same_place() -> None:
    assert paths(with_stop(1, approach=((4.0, 0.0), (4.0009, 3.0)))) == []
    assert paths(with_stop(1, approach=((4.0, 0.0), (4.0011, 3.0)))) == ["$.stops[1].approach[1]"]


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"id": ""}, "$.stops[0].id"),
        ({"heading": 7.0}, "$.stops[0].heading"),
        ({"tolerance_m": 0.0}, "$.stops[0].tolerance_m"),
        ({"settle_s": -1.0}, "$.stops[0].settle_s"),
        ({"retries": -1}, "$.stops[0].retries"),
        ({"scan": change(stop("S", (0, 0)).scan, timeout_s=59.0)}, "$.stops[0].scan.timeout_s"),
        ({"sees": change(stop("S", (0, 0)).sees, new_units=11)}, "$.stops[0].sees"),
        ({"approach": ()}, "$.stops[0].approach"),
    ],
)
def test_a_senseless_stop_is_reported(changes: dict[str, Any], path: str) -> None:
    assert paths(with_stop(0, **changes)) == [path]


def test_a_full_turn_of_heading_is_allowed() -> None:
    assert paths(with_stop(0, heading=-math.tau)) == []


def test_numbers_that_are_none_are_reported() -> None:
    """Missions made in memory never passed the reader, which refuses NaN."""
    broken = with_stop(0, x=math.nan, approach=((0.0, 0.0), (math.nan, 0.0)))
    assert {"$.stops[0]", "$.stops[0].approach[1]"} <= set(paths(broken))


def test_a_waypoint_that_no_robot_drives_to_is_reported() -> None:
    (problem,) = problems_of(with_stop(1, approach=((4.0, 0.0), (1e6, 0.0), (4.0, 3.0))))
    assert str(problem) == (
        "$.stops[1].approach[1]: (1000000.000, 0.000) is 1000.0 km from the start; the limit is 20 km"
    )
    assert paths(with_stop(1, x=0.0, y=20_001.0, approach=((4.0, 0.0), (0.0, 20_001.0)))) == [
        *("$.stops[1]", "$.stops[1].approach[1]", "$.return[0]"),
    ]
    assert paths(change(square_tour(), return_=((4.0, 3.0), (4.0, 3e4), (0.0, 0.0)))) == ["$.return[1]"]


def test_a_mission_in_survey_coordinates_is_sound() -> None:
    x, y = 500_000.0, 5_400_000.0
    mission = square_tour()
    start = change(mission.start, x=mission.start.x + x, y=mission.start.y + y)
    legs = [tuple((px + x, py + y) for px, py in item.approach) for item in mission.stops]
    stops = tuple(
        change(item, x=item.x + x, y=item.y + y, approach=leg)
        for item, leg in zip(mission.stops, legs, strict=True)
    )
    back = tuple((px + x, py + y) for px, py in mission.return_ or ())
    moved = change(mission, start=start, stops=stops, return_=back)
    assert problems_of(change(moved, georeference=None)) == ()
    (problem,) = problems_of(moved)
    assert problem.path == "$.georeference"
    assert "5423 km from the drawing's 0,0" in problem.message


def test_the_rest_of_the_document_is_looked_at() -> None:
    mission = square_tour()
    broken = change(
        mission,
        revision=0,
        stops=(),
        return_=None,
        georeference=SiteOrigin(lat=91.0, lon=0.0, alt=0.0, heading_deg=0.0),
        robot=change(mission.robot, speed=0.0, turn_rate=-1.0),
        scanner=change(mission.scanner, fov_deg=0.0),
        policy=change(mission.policy, battery_min=1.0),
    )
    assert paths(broken) == [
        *("$.revision", "$.georeference", "$.robot.speed", "$.robot.turn_rate", "$.scanner.fov_deg"),
        *("$.stops", "$.policy.battery_min"),
    ]
