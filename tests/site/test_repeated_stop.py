"""A STOP without an answer: the server sends it again until the robot answers or obeys another order."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.link.memory_link import Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.robot.program import RobotOptions, robot_on
from stopgo.bridge.robot.robot_hardware import SimulatedBody
from stopgo.bridge.robot.simulated_faults import read_faults
from stopgo.bridge.station.station import Station
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.run_commands import Answer
from stopgo.site import robot_orders
from stopgo.site.event_feed import EventFeed
from stopgo.site.robot_orders import OrderRequest, StopRequest
from stopgo.site.site_folder import SiteFiles
from stopgo.site.web_server import SiteFleet, SiteOptions
from tests.recordings import world
from tests.waiting import wait_until

ROBOT = "r1"


@pytest.fixture
def board() -> Switchboard:
    return Switchboard()


@pytest.fixture
def fleet(board: Switchboard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[SiteFleet]:
    """A site with one robot, of which nothing is heard yet."""
    monkeypatch.setattr(robot_orders, "AGAIN_S", 0.01, raising=False)
    options, stopped = SiteOptions(tmp_path, "", timeout_s=0.2), threading.Event()
    made = SiteFleet(board.link(), options, None, EventFeed(), SiteFiles.at(tmp_path), stopped)
    made.add(ROBOT)
    yield made
    stopped.set()
    made.orders.close()
    for thread in made.threads:
        thread.join()


def press(fleet: SiteFleet, name: str) -> robot_orders.OrderRecord:
    (pressed,) = fleet.orders.stop(StopRequest(id=name))
    return pressed.result()


def shown(fleet: SiteFleet) -> Any:
    return fleet.feed.value("stop", ROBOT) or {}


def test_a_robot_that_was_out_of_reach_is_paused_when_it_is_back(
    fleet: SiteFleet, board: Switchboard, tmp_path: Path
) -> None:
    """The page showed "unknown" and sent nothing more; the robot drove on."""
    body = SimulatedBody(tmp_path / "r1", faults=read_faults(["blocked@1"]))
    robot = RobotOptions(name=ROBOT, listen="", state=tmp_path / "r1", body=body)
    station = Station(board.link(), KeyExpressions(ROBOT), commander="ben")
    with robot_on(board.link(), KeyExpressions(ROBOT), robot):
        station.push(world.nouns_at()[-1])
        station.command("start")
        board.cut = True
        pressed = press(fleet, "1")
        assert (pressed.outcome, pressed.repeated, pressed.heard_at) == ("unknown", True, None)
        assert "--timeout" not in pressed.message
        board.cut = False
        record = wait_until(lambda: (found := shown(fleet))["standing_at"] and found)
        assert (record["id"], record["outcome"], record["repeated"]) == ("1", "ok", False)
        assert record["sent_at"] <= record["heard_at"] <= record["standing_at"]
        assert station.status().state == "PAUSED"


class Silent:
    """Commands of a robot that answers no pause, but other orders."""

    def __init__(self, fleet: SiteFleet, monkeypatch: pytest.MonkeyPatch) -> None:
        self.pauses: list[str] = []
        monkeypatch.setattr(fleet.robots[ROBOT].station, "command", self.command)

    def command(self, verb: str, *, cmd_id: str = "", **details: Any) -> Answer:
        if verb == "pause":
            self.pauses.append(cmd_id)
            raise OutcomeUnknown("no answer")
        return Answer(
            cmd_id="2", verb="resume", outcome="ok", reason=None, message="", run_id=None, state="RUNNING"
        )


def test_a_stop_is_one_command_however_often_it_is_sent(
    fleet: SiteFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = Silent(fleet, monkeypatch)
    press(fleet, "1")
    wait_until(lambda: len(robot.pauses) > 3)
    assert len(set(robot.pauses)) == 1
    assert robot.pauses[0]


def test_a_stop_is_not_sent_again_once_the_robot_obeys_another_order(
    fleet: SiteFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A pause that came after the resume would stop the robot against the newer word."""
    robot = Silent(fleet, monkeypatch)
    press(fleet, "1")
    assert fleet.orders.order(ROBOT, OrderRequest(id="2", verb="resume")).result().outcome == "ok"
    wait_until(lambda: not shown(fleet)["repeated"])
    sent = len(robot.pauses)
    press(fleet, "3")
    wait_until(lambda: len(robot.pauses) > sent + 3)
    assert len(set(robot.pauses[sent:])) == 1


def test_the_newest_stop_alone_is_sent_again(fleet: SiteFleet, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Silent(fleet, monkeypatch)
    press(fleet, "1")
    press(fleet, "2")
    wait_until(lambda: set(robot.pauses[-20:]) == {robot.pauses[-1]} != {robot.pauses[0]})
    assert shown(fleet)["id"] == "2"


def test_a_stop_that_is_never_answered_is_given_up_and_shown_so(
    fleet: SiteFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_orders, "REPEATED_S", 0.0, raising=False)
    Silent(fleet, monkeypatch)
    assert press(fleet, "1").repeated
    wait_until(lambda: not shown(fleet)["repeated"])
    assert shown(fleet)["outcome"] == "unknown"
