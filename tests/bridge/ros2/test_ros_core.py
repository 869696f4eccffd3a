"""A robot that speaks ROS 2 drives a mission to its end, and stops for whatever goes wrong."""

from __future__ import annotations

from stopgo.mission.document import Mission
from stopgo.mission.run.events import Scanned
from tests.bridge.ros2.world import RosField
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
