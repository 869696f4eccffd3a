"""The robot's map and the mission's frame: what is driven where."""

from __future__ import annotations

import json
import math
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.commands.spawn import robot_process
from stopgo.bridge.link.clock import SimulatedClock
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.inbox import Inbox
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.bridge.robot.map_frame import OnMap, turned, turned_back
from stopgo.bridge.robot.simulator import SimulatedBase, SimulatedScanner
from stopgo.mission.document import Frame, with_digest
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose
from tests.bridge.world import EXACT, Field, corridor
from tests.called import stopgo

QUARTER = Transform(x=10.0, y=20.0, heading=math.pi / 2)


def test_a_quarter_turn_on_paper() -> None:
    """(1, 2) turned by 90° is (-2, 1); shifted by (10, 20) it is (8, 21)."""
    assert QUARTER.point((1.0, 2.0)) == pytest.approx((8.0, 21.0))
    there = turned(Pose(x=1.0, y=2.0, heading=0.5), QUARTER)
    assert there.heading == pytest.approx(0.5 + math.pi / 2)
    back = turned_back(there, QUARTER)
    assert (back.x, back.y, back.heading) == pytest.approx((1.0, 2.0, 0.5))


@pytest.mark.parametrize("own", [QUARTER, None])
def test_a_mission_is_driven_on_the_map_and_reported_in_its_own_frame(own: Transform | None) -> None:
    """The robot's own transform counts before the mission's."""
    other = Transform(x=-3.0, y=0.0, heading=1.0)
    mission = with_digest(
        msgspec.structs.replace(corridor(closed=False), frame=Frame(name="site", to_map=other))
    )
    clock, journal = SimulatedClock(), memory_journal()
    inner = SimulatedBase(clock=clock, wear=EXACT)
    base = OnMap(inner, own)
    base.take(mission)
    inner.stand_at(turned(Pose(x=0.0, y=0.0, heading=0.0), own or other))
    controller = Controller(
        robot="r1", journal=journal, base=base, scanner=SimulatedScanner(clock=clock), clock=clock,
        mission_taken=base.take,
    )  # fmt: skip
    field = Field(journal=journal, clock=clock)
    field.controller, field.inbox = controller, Inbox(journal, controller, None)
    field.station().push(mission)
    assert field.order("start").outcome == "ok"
    field.work()
    assert controller.run.state == "FINISHED"
    assert (base.pose().x, base.pose().y) == pytest.approx((6.0, 0.0), abs=1e-6)
    assert (inner.pose().x, inner.pose().y) == pytest.approx((own or other).point((6.0, 0.0)))


def test_push_shows_the_transform(tmp_path: Path) -> None:
    document = tmp_path / "mission.json"
    document.write_bytes(msgspec.json.encode(corridor()))
    with robot_process("r1", tmp_path / "state", speed_up=100, extra=("--map", "10,20,90")) as endpoint:
        reach = ("--robot", "r1", "--connect", endpoint)
        pushed = stopgo("push", str(document), *reach, "--json")
        assert stopgo("start", *reach).returncode == 0
        assert stopgo("watch", *reach).returncode == 0
    assert "rotated by 90.00°, then shifted by (10.000, 20.000) m (robot --map)" in pushed.stderr
    assert json.loads(pushed.stdout)["revision"] == 1
    assert json.loads((tmp_path / "state" / "world.json").read_bytes())["pose"]["x"] == pytest.approx(
        10.0, abs=0.05
    )
