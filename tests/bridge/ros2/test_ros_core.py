"""A robot that speaks ROS 2 drives a mission to its end, and stops for whatever goes wrong."""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec
import pytest

from stopgo.bridge.ros2.ros_settings import FrameNames, RosSettings
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.frames.transform import SAME, Transform
from stopgo.mission.run.events import Arrived, Scanned
from tests.bridge.ros2.world import TICK_S, Killed, RosField, World
from tests.bridge.world import corridor

MISSION = corridor(stops=3)


def started(field: RosField, mission: Mission = MISSION) -> RosField:
    field.station().push(mission)
    assert field.order("start").outcome == "ok"
    return field


def scanned(field: RosField) -> list[str]:
    return [event.stop for event in field.journal.events() if isinstance(event, Scanned)]


def test_a_mission_runs_to_its_end() -> None:
    field = started(RosField())
    field.work()
    assert field.controller.run.state == "FINISHED", field.controller.run
    assert scanned(field) == ["s1", "s2", "s3"]
    assert len(field.world.scans) == 3


def test_a_success_before_the_goal_is_not_believed() -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: field.world.end("succeeded"))
    field.work_until(lambda run: run.stop_state == "SETTLING")
    arrived = next(event for event in field.journal.events() if isinstance(event, Arrived))
    assert arrived.deviation_m <= MISSION.robot.radius
    assert len(field.world.goals) == 2


def test_a_pause_cancels_the_goal_and_the_robot_stands() -> None:
    field = started(RosField())
    field.world.later(3.0, lambda: field.order("pause"))
    field.work()
    assert field.controller.run.state == "PAUSED"
    assert field.world.goals[-1].status == "canceled"
    assert field.world.speed == 0.0
    assert 0.5 < field.world.at.x < 1.9


def test_a_goal_that_is_accepted_after_the_stop_is_cancelled() -> None:
    field = started(RosField())
    field.world.later(TICK_S, lambda: field.order("pause"))  # the goal is sent, and not accepted yet
    field.work()
    field.clock.wait(5.0)
    assert [goal.status for goal in field.world.goals] == ["canceled"]
    assert field.world.at.x < 0.05


def test_a_goal_that_a_killed_program_has_left_is_cancelled_at_the_next_start() -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: setattr(field.world, "killed", True))
    with pytest.raises(Killed):
        field.work()
    assert field.world.goals[-1].status == "active"
    field.boot()
    assert field.world.goals[-1].status == "canceled"
    assert field.controller.run.state == "PAUSED"


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda world: world.silent.add("tf"), "tf has no"),
        (lambda world: world.silent.add("odometry"), "no odometry for"),
        (lambda world: setattr(world, "odometry_offset_s", 3600.0), "3600.0 s behind this computer's"),
        (lambda world: world.foreign(3.0, 3.0), "another client drives the robot"),
        (
            lambda world: world.end("canceled"),
            "another client, or the guard of this program, has cancelled the goal",
        ),
        (lambda world: world.restart_servers(30.0), "action server is not available"),
        (
            lambda world: setattr(world, "correction", Transform(x=0.0, y=5.0, heading=0.0)),
            "jumped by 5.00 m",
        ),
        (lambda world: setattr(world.telemetry, "emergency_stop", True), "the emergency stop is pressed"),
        (lambda world: world.telemetry.say_inactive("the node is inactive"), "the node is inactive"),
    ],
)
def test_what_goes_wrong_in_a_drive_stops_the_robot_and_is_reported(
    harm: Callable[[World], object], words: str
) -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: harm(field.world))
    field.work()
    run = field.controller.run
    assert run.state == "HELD"
    assert words in run.reason
    assert field.world.speed == 0.0


def test_another_clients_goal_that_becomes_known_after_the_end_of_ours_is_reported() -> None:
    field = started(RosField())
    world = field.world
    known = world.foreign_goals

    def preempted() -> None:
        world.foreign(3.0, 3.0)
        world.foreign_goals = lambda: ()  # type: ignore[method-assign]
        world.later(0.2, lambda: setattr(world, "foreign_goals", known))

    world.later(2.0, preempted)
    field.work()
    assert field.controller.run.state == "HELD"
    assert "another client drives the robot" in field.controller.run.reason


def test_a_robot_that_was_localised_again_by_hand_goes_on_with_the_next_command() -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: setattr(field.world, "correction", Transform(x=0.0, y=5.0, heading=0.0)))
    field.work()
    assert "jumped by 5.00 m" in field.controller.run.reason
    field.world.correction = SAME
    field.clock.wait(1.0)
    assert field.order("retry").outcome == "ok"
    field.work()
    assert field.controller.run.state == "FINISHED"


def test_a_node_that_fails_holds_the_robot() -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: setattr(field.world.telemetry, "fault", "RCLError: context"))
    field.work()
    assert "the ROS 2 node has failed (RCLError: context)" in field.controller.run.reason
    assert field.world.speed == 0.0


def test_a_localisation_that_moves_a_little_is_followed() -> None:
    field = started(RosField())
    field.world.later(2.0, lambda: setattr(field.world, "correction", Transform(x=0.0, y=0.2, heading=0.0)))
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]
    assert abs(field.world.at.y + 0.2) < 0.06


def test_a_scan_during_which_the_map_moves_does_not_count() -> None:
    field = started(RosField())
    field.work_until(lambda run: run.stop_state == "SCANNING")
    field.world.later(1.0, lambda: setattr(field.world, "correction", Transform(x=0.0, y=0.3, heading=0.0)))
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]
    assert len(field.world.scans) == 4


def test_transforms_that_are_no_numbers_count_as_missing() -> None:
    field = started(RosField())
    lost = Transform(x=math.nan, y=math.nan, heading=math.nan)
    field.world.later(2.0, lambda: setattr(field.world, "correction", lost))
    field.work()
    run = field.controller.run
    assert run.state == "HELD"
    assert "tf has no map -> odom for" in run.reason
    assert "nan" not in run.reason
    field.world.correction = SAME
    field.clock.wait(1.0)
    assert field.order("retry").outcome == "ok"
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]


def test_a_scan_with_an_odometry_without_numbers_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    field = started(RosField(world=World(scan_s=10.0)))
    field.work_until(lambda run: run.stop_state == "SCANNING")
    telemetry = field.world.telemetry
    assert telemetry is not None
    told = telemetry.take_odometry
    monkeypatch.setattr(telemetry, "take_odometry", lambda *_, **more: told(math.nan, math.nan, **more))
    field.work()
    assert scanned(field) == []
    assert "no odometry for" in field.controller.run.reason


def test_a_localisation_whose_variance_is_no_number_is_unknown() -> None:
    field = started(RosField())
    telemetry = field.world.telemetry
    assert telemetry is not None
    field.world.later(2.0, lambda: telemetry.take_variances(math.nan, math.nan))
    field.work()
    assert field.controller.run.state == "HELD"
    assert "the localisation is uncertain by inf m" in field.controller.run.reason
    assert telemetry.health().localisation == 0.0


@pytest.mark.parametrize(("parent", "child"), [("odom", "odom"), ("", "odom"), ("map", "")])
def test_a_transform_without_two_frames_says_nothing(parent: str, child: str) -> None:
    """One such message took the place of a transform that is published once."""
    telemetry = RosField().world.telemetry
    assert telemetry is not None
    telemetry.take_transform(parent, child, Transform(x=1.0, y=2.0, heading=0.0), stamp_ns=2 * 10**18)
    assert telemetry.silence() == ""
    assert (telemetry.pose().x, telemetry.pose().y) == (0.0, 0.0)


def test_a_frame_that_tf_lacks_is_named_with_those_that_it_has() -> None:
    field = RosField(settings=RosSettings(frames=FrameNames(map="site_map")))
    refused = field.order("start")
    assert refused.outcome == "refused"
    telemetry = field.world.telemetry
    assert telemetry is not None
    told = telemetry.silence()
    assert told == "tf has no transform from site_map to base_link; its frames: base_link, map, odom"


def test_a_robot_whose_guard_has_ended_is_held_until_another_one_runs() -> None:
    field = started(RosField())
    field.world.later(3.0, lambda: setattr(field.world.telemetry, "unguarded", "no guard"))
    field.work()
    assert (field.controller.run.state, field.world.speed) == ("HELD", 0.0)
    assert "no guard" in field.controller.run.reason
    assert field.order("retry").outcome != "ok"
    field.world.telemetry.unguarded = ""
    assert field.order("retry").outcome == "ok"
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]


def with_own_way(mission: Mission = MISSION) -> Mission:
    policy = msgspec.structs.replace(mission.policy, own_way=True)
    return with_digest(msgspec.structs.replace(mission, policy=policy))


OWN_WAYS = [(stop.x, stop.y) for stop in MISSION.stops] + [(MISSION.start.x, MISSION.start.y)]
"""To every stop, and back."""


def test_only_a_mission_that_allows_it_lets_nav2_find_its_own_way() -> None:
    field = started(RosField())
    field.work()
    assert field.world.ways == []
    field = started(RosField(), with_own_way())
    farthest = 0.0

    def look() -> None:
        nonlocal farthest
        farthest = max(farthest, abs(field.world.at.y))
        field.world.later(0.5, look)

    field.world.later(0.5, look)
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]
    assert field.world.ways == OWN_WAYS
    assert farthest > field.settings.limits.off_path_m, "farther than a robot on its legs may be"
    arrived = [event.deviation_m for event in field.journal.events() if isinstance(event, Arrived)]
    assert max(arrived) <= max(stop.tolerance_m for stop in MISSION.stops)


def test_the_last_piece_of_its_own_way_is_driven_straight() -> None:
    """Nav2's own tolerance, 0.25 m, is larger than a mission's."""
    field = RosField()
    field.world.near = 0.25
    started(field, with_own_way())
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]
    assert field.world.ways == OWN_WAYS


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda world: world.foreign(3.0, 3.0), "another client drives the robot"),
        (lambda world: world.silent.add("tf"), "tf has no"),
        (lambda world: setattr(world, "navigates", False), "action server is not available"),
        (lambda world: world.end("canceled"), "has cancelled the goal"),
    ],
)
def test_what_goes_wrong_on_its_own_way_stops_the_robot(harm: Callable[[World], object], words: str) -> None:
    field = started(RosField(), with_own_way())
    field.world.later(2.0, lambda: harm(field.world))
    field.work()
    assert (field.controller.run.state, field.world.speed) == ("HELD", 0.0)
    assert words in field.controller.run.reason


def test_a_robot_that_finds_its_own_way_is_paused_and_resumed_beside_its_route() -> None:
    field = started(RosField(), with_own_way())
    field.world.later(3.0, lambda: field.order("pause"))
    field.work()
    assert (field.controller.run.state, field.world.speed) == ("PAUSED", 0.0)
    assert abs(field.world.at.y) > MISSION.robot.radius
    assert field.order("resume").outcome == "ok"
    field.work()
    assert scanned(field) == ["s1", "s2", "s3"]
