"""Goals that drive the robot are ours, those that Nav2 sends for ours, or other clients'."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.ros2.nav2_port import Nav2Port
from stopgo.bridge.ros2.ros_settings import DriveActions, RosSettings
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.run.events import Pose

EXECUTING, CANCELED = 2, 5
END = Pose(x=2.0, y=0.0, heading=0.0)


class FakeNode:
    """A node whose topics are given by the test, and whose goals are kept."""

    name, namespace = "stopgo", "/"

    def __init__(self) -> None:
        self.heard: dict[str, Callable[[Any], None]] = {}
        self.sent: list[tuple[str, bytes, Any]] = []
        self.servers = frozenset({"first"})

    def subscribe(self, kind: str, topic: str, take: Callable[[Any], None], *quality: object) -> None:
        self.heard[topic] = take

    def action_client(self, kind: str, action: str) -> Any:
        def send(goal_id: bytes, fields: Any, events: Any) -> None:
            self.sent.append((action, goal_id, fields))
            events.accepted(True)

        goal = SimpleNamespace(fields={"path": "", "pose": ""})
        return SimpleNamespace(goal=goal, missing=str, send=send)

    def client(self, kind: str, service: str) -> Any:
        return SimpleNamespace(missing=str, call=lambda *given: None)

    def service_kinds(self, kind: str) -> tuple[Any, Any]:
        fields = {"success": "boolean", "message": "string"}
        return SimpleNamespace(fields={}), SimpleNamespace(fields=fields, inner=None)

    def is_published(self, topic: str) -> bool:
        return True

    def publishers(self, topic: str) -> frozenset[str]:
        return self.servers

    def now_ns(self) -> int:
        return 0

    def status(self, action: str, **goals: int) -> None:
        made = SimpleNamespace
        listed = [
            made(goal_info=made(goal_id=made(uuid=name.encode())), status=value)
            for name, value in goals.items()
        ]  # fmt: skip
        self.heard[f"{action}/_action/status"](SimpleNamespace(status_list=listed))


@pytest.fixture
def node() -> FakeNode:
    return FakeNode()


@pytest.fixture
def port(node: Any) -> Nav2Port:
    clock, settings = SimulatedClock(), RosSettings(drive=DriveActions(spin="spin"))
    return Nav2Port(node, settings, RosTelemetry(clock, settings.frames, settings.limits), clock)


def test_goals_that_nav2_sends_to_its_own_servers_for_ours_are_nobody_elses(
    node: FakeNode, port: Nav2Port
) -> None:
    sent = port.navigate(END)
    assert node.sent[-1][0] == "navigate_to_pose"
    node.status("follow_path", first=EXECUTING)
    node.status("follow_path", second=EXECUTING)
    node.status("spin", recovery=EXECUTING)
    assert port.foreign_goals() == ()
    sent.ended(4, None)
    assert port.foreign_goals() == (), "its last goal may end a little later"
    node.status("follow_path", third=EXECUTING)
    assert port.foreign_goals() == ("goal 74686972 of follow_path",)


def test_another_client_of_a_navigator_is_seen_while_nav2_finds_its_own_way(
    node: FakeNode, port: Nav2Port
) -> None:
    port.navigate(END)
    node.status("navigate_through_poses", other=EXECUTING)
    assert port.foreign_goals() == ("goal 6f746865 of navigate_through_poses",)
    node.status("navigate_through_poses", other=CANCELED)
    node.status("navigate_to_pose", another=EXECUTING)
    assert port.foreign_goals() == ("goal 616e6f74 of navigate_to_pose",)


def test_on_the_legs_every_goal_that_is_not_ours_is_another_clients(node: FakeNode, port: Nav2Port) -> None:
    port.follow((END, END))
    node.status("follow_path", other=EXECUTING)
    assert port.foreign_goals() == ("goal 6f746865 of follow_path",)


def test_a_goal_of_a_server_that_was_restarted_is_nobodys(node: FakeNode, port: Nav2Port) -> None:
    """The robot was refused every start and retry, because a goal of the former server was active."""
    node.status("follow_path", other=EXECUTING)
    assert port.foreign_goals() == ("goal 6f746865 of follow_path",)
    node.servers = frozenset({"first", "second"})
    assert port.foreign_goals() == ("goal 6f746865 of follow_path",)
    node.servers = frozenset({"second"})
    assert port.foreign_goals() == ()
    node.servers = frozenset()
    node.status("follow_path", other=EXECUTING)
    assert port.foreign_goals() == ()
    node.servers = frozenset({"late"})
    assert port.foreign_goals() == ("goal 6f746865 of follow_path",), "its server was not known yet"


def covariance(*, x: float, y: float) -> SimpleNamespace:
    told = [0.0] * 36
    told[0], told[7] = x, y
    return SimpleNamespace(pose=SimpleNamespace(covariance=told))


@pytest.mark.parametrize("which", [{"x": math.nan, "y": 0.01}, {"x": 0.01, "y": math.nan}])
def test_a_covariance_without_numbers_is_no_certainty(
    node: FakeNode, port: Nav2Port, which: dict[str, float]
) -> None:
    port._take_covariance(covariance(**which))
    assert port.telemetry.sigma_m == math.inf
    port._take_covariance(covariance(x=0.04, y=0.01))
    assert port.telemetry.sigma_m == pytest.approx(0.2)


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 2.0, 1.0), (0.0, 0.0, math.nan, 1.0)])
def test_a_transform_without_a_rotation_says_nothing(
    node: FakeNode, port: Nav2Port, rotation: tuple[float, ...]
) -> None:
    made = SimpleNamespace
    turn = made(**dict(zip("xyzw", rotation, strict=True)))
    header = made(frame_id="map", stamp=made(sec=1, nanosec=0))
    inner = made(translation=made(x=1.0, y=2.0), rotation=turn)
    one = made(header=header, child_frame_id="base_link", transform=inner)
    node.heard["/tf"](made(transforms=[one]))
    assert "tf has no transform from map to base_link" in port.telemetry.silence()
