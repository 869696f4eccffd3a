"""A robot's end that drives Nav2 over zenoh, as a process, against a stand-in of Nav2, with its faults.

Nothing here counts time: a deadline is only the last resort.
"""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from stopgo.bridge.link.protocol import encode
from stopgo.bridge.ros2.ros_definitions import action_types, message_type, service_types
from stopgo.mission.document import Mission, RobotSpec, with_digest
from tests.bridge.proxy import Proxy
from tests.bridge.ros2.zenoh_nav2 import StandIn, session_at
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.faults.sizes import FULL, some
from tests.ports import free_port

pytestmark = pytest.mark.real_time
ROOT = Path(__file__).parents[3]
DEADLINE_S = 30.0
DOMAIN = 5
FAST = RobotSpec(radius=0.35, speed=1.5, turn_rate=2.0, acceleration=2.0)


class OurCodec:
    """CDR and hashes of one distribution by stopgo's definitions; tests/ros2 has those of real ROS."""

    def __init__(self, distribution: str) -> None:
        self._kinds: dict[str, Any] = {}
        self._hashes: dict[str, str] = {}
        for name in ("std_srvs/srv/Trigger", "action_msgs/srv/CancelGoal"):
            self._know(service_types(name)[0])
        for name in ("nav2_msgs/action/FollowPath", "nav2_msgs/action/Spin"):
            (found,) = (one for one in action_types(name) if distribution in one.send_goal.said)
            self._know(found.send_goal)
            self._know(found.get_result)

    def _know(self, service: Any) -> None:
        self._hashes[service.name] = service.hash
        self._kinds[service.request.name] = service.request
        self._kinds[service.response.name] = service.response

    def hash(self, kind: str) -> str:
        return self._hashes.get(kind) or message_type(kind).hash

    def encode(self, kind: str, fields: Mapping[str, Any]) -> bytes:
        return bytes((self._kinds.get(kind) or message_type(kind)).encode(fields))

    def decode(self, kind: str, data: bytes) -> Any:
        return (self._kinds.get(kind) or message_type(kind)).decode(data)


def quick_corridor(*, stops: int, closed: bool = False) -> Mission:
    made = corridor(stops=stops, closed=closed, settle_s=0.3)
    quick = [
        msgspec.structs.replace(stop, scan=msgspec.structs.replace(stop.scan, duration_s=0.3))
        for stop in made.stops
    ]
    return with_digest(msgspec.structs.replace(made, stops=tuple(quick), robot=FAST))


class Place:
    """A zenoh router with the stand-in at it, and stopgo's processes."""

    def __init__(self, folder: Path, robot: StandIn, router: str) -> None:
        self.folder = folder
        self.robot = robot
        self.router = router
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.processes: list[subprocess.Popen[str]] = []
        self.said: dict[str, str] = {}
        robot.network.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", self._hear)

    def _hear(self, message: Any) -> None:
        for status in message.status:
            self.said = {value.key: value.value for value in status.values}

    def settings(self, router: str, guard: str = "here") -> None:
        (self.folder / "ros2.toml").write_text(
            f'[topics]\ncmd_vel = "cmd_vel"\n[drive]\nspin = "spin"\n[limits]\ngap_s = 3.0\n'
            f'[zenoh]\nrouter = "{router}"\ndomain = {DOMAIN}\nnamespace = "r1"\nguard = "{guard}"\n'
        )

    def agent(self) -> subprocess.Popen[str]:
        return self.started(
            "ready r1", "robot", "--name", "r1", "--listen", self.endpoint, "--state",
            str(self.folder / "r1.state"), "--controller", f"ros2-zenoh:{self.folder / 'ros2.toml'}",
        )  # fmt: skip

    def started(self, ready: str, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-m", "stopgo", *arguments], text=True, cwd=ROOT,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self.processes.append(process)
        assert process.stdout is not None
        lines = []
        for line in process.stdout:
            lines.append(line)
            if line.startswith(ready):
                return process
        raise AssertionError("".join(lines))

    def stopgo(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return stopgo(*arguments, "--robot", "r1", "--connect", self.endpoint)

    def state(self) -> dict[str, Any]:
        answer = self.stopgo("status", "--json")
        return dict(json.loads(answer.stdout)) if answer.returncode == 0 else {}

    def until(self, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        end_s = time.monotonic() + DEADLINE_S
        while not reached(state := self.state()):
            assert time.monotonic() < end_s, state
            time.sleep(0.1)
        return state

    def await_(self, reached: Callable[[], bool]) -> None:
        end_s = time.monotonic() + DEADLINE_S
        while not reached():
            assert time.monotonic() < end_s, self.state()
            time.sleep(0.02)

    def begin(self, mission: Mission) -> None:
        (self.folder / "mission.json").write_bytes(encode(mission))
        pushed = self.stopgo("push", str(self.folder / "mission.json"))
        assert pushed.returncode == 0, pushed.stderr
        began = self.stopgo("start")
        assert began.returncode == 0, began.stderr

    def drives(self, beyond: float = 0.0) -> None:
        """Wait until the robot drives."""
        self.await_(lambda: self.robot.speed > 0.2 and self.robot.x > beyond)

    def held(self) -> str:
        """Wait until the run is held; the reason, from the node's diagnostics."""
        self.until(lambda state: state.get("state") == "HELD")
        self.said.pop("state", None)
        self.await_(lambda: self.said.get("state") == "HELD")
        return self.said["reason"]

    @staticmethod
    def guard_has_ended(agent: subprocess.Popen[str]) -> None:
        """Wait until the guard of a killed program, which writes where it wrote, has ended.

        Until then it cancels every goal.
        """
        assert agent.stdout is not None
        agent.stdout.read()

    def finished(self, stops: int) -> None:
        state = self.until(lambda state: state.get("state") in ("FINISHED", "HELD"))
        done = [f"s{number}" for number in range(1, stops + 1)]
        assert (state["state"], state["done"]) == ("FINISHED", done), self.held()
        scans = [file.read_text().split() for file in sorted((self.folder / "scans").iterdir())]
        assert [round(float(scan[0])) for scan in scans] == [2 * number for number in range(1, stops + 1)]
        assert {scan[3] for scan in scans} == {"False"}, "the robot moved during a scan"

    def close(self) -> None:
        for process in self.processes:
            process.send_signal(signal.SIGKILL)
            process.wait()


@contextmanager
def place_in(folder: Path, *, distribution: str = "Jazzy", speed: float = 1.5) -> Iterator[Place]:
    (folder / "scans").mkdir()
    router = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        stack.enter_context(session_at("router", router))
        session = stack.enter_context(session_at("client", router))
        robot = StandIn(session, DOMAIN, OurCodec(distribution), folder / "scans", speed)
        place = Place(folder, robot, router)
        place.settings(router)
        stack.callback(robot.close)
        stack.callback(place.close)
        yield place


@pytest.mark.parametrize("distribution", some(["Jazzy", "Lyrical"], every=2))
def test_a_mission_is_driven_to_its_end(tmp_path: Path, distribution: str) -> None:
    with place_in(tmp_path, distribution=distribution) as place:
        place.robot.start()
        place.agent()
        place.begin(quick_corridor(stops=2, closed=True))
        place.finished(2)
        assert max(abs(y) for _, y in place.robot.path) < 0.1, "beside its legs"
        seen = stopgo("status", "--ros2", f"{DOMAIN}/r1", "--connect", place.router, "--json")
        assert json.loads(seen.stdout)["state"] == "FINISHED"


@pytest.mark.skipif(not FULL, reason="test_ros_core has these in simulated time; all of them: make faults")
def test_what_goes_wrong_in_a_leg_holds_the_run_and_a_person_lets_it_go_on(tmp_path: Path) -> None:
    with place_in(tmp_path, speed=0.6) as place:
        robot = place.robot
        robot.start()
        robot.rejects = True
        place.agent()
        place.begin(quick_corridor(stops=3))
        assert "rejected the goal" in place.held()
        robot.rejects = False
        assert place.stopgo("retry").returncode == 0
        place.drives(beyond=0.3)
        robot.foreign_goal(robot.x, 2.0)
        assert "another client" in place.held()
        assert all(goal.status not in (1, 2, 3) for goal in robot.goals)
        assert place.state()["done"] == []
        robot.y = 0.0  # a person brings it back
        assert place.stopgo("retry").returncode == 0
        place.drives(beyond=0.2)
        robot.end_servers()
        assert "server" in place.held()
        robot.start()
        robot.answers_no_goal = True
        place.until(lambda state: place.stopgo("retry").returncode == 0)
        # its acceptance was lost, and its status tells that it drives: the leg is driven to its end
        place.until(lambda state: state.get("done", [])[:1] == ["s1"])
        robot.answers_no_goal = False
        place.finished(3)


def test_a_killed_program_is_stopped_by_its_guard_and_takes_up_its_run(tmp_path: Path) -> None:
    with place_in(tmp_path, speed=0.6) as place:
        place.robot.start()
        agent = place.agent()
        place.begin(quick_corridor(stops=2))
        place.drives(beyond=0.3)
        agent.send_signal(signal.SIGKILL)
        agent.wait()
        place.await_(lambda: place.robot.goals[-1].status == 5)
        at = place.robot.x
        assert at < 1.9
        place.await_(lambda: place.robot.zeros > 0 and place.robot.speed == 0.0)
        place.guard_has_ended(agent)
        place.agent()
        assert place.until(lambda state: "state" in state)["state"] == "PAUSED"
        assert place.stopgo("resume").returncode == 0
        place.finished(2)


def test_a_cut_link_is_stopped_by_the_guard_at_the_robot(tmp_path: Path) -> None:
    with place_in(tmp_path, speed=0.3) as place, Proxy(int(place.router.rpartition(":")[2])) as line:
        place.robot.start()
        place.settings(line.endpoint, guard="robot")
        place.agent()
        (tmp_path / "mission.json").write_bytes(encode(quick_corridor(stops=1)))
        assert place.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        refused = place.stopgo("start")
        assert refused.returncode == 1
        assert "no guard at the robot answers" in refused.stderr
        guard = place.started("ready guard", "guard", "--ros2", f"{DOMAIN}/r1", "--connect", place.router)
        place.await_(lambda: place.stopgo("start").returncode == 0)
        place.drives(beyond=0.1)
        line.swallow(True)
        place.await_(lambda: place.robot.goals[-1].status == 5)
        assert place.robot.x < 1.5
        assert guard.stdout is not None
        assert "the robot is stopped" in guard.stdout.readline()
        place.until(lambda state: state.get("state") == "HELD")
        line.swallow(False)
        place.await_(lambda: place.stopgo("retry").returncode == 0)
        place.finished(1)


def test_a_definition_that_is_not_known_is_refused_naming_both(tmp_path: Path) -> None:
    with place_in(tmp_path) as place:
        place.robot.start(wrong_hash="RIHS01_00ff")
        place.agent()
        (tmp_path / "mission.json").write_bytes(encode(quick_corridor(stops=1)))
        assert place.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        refused = place.stopgo("start")
        jazzy, lyrical = action_types("nav2_msgs/action/FollowPath")
        assert refused.returncode == 1
        assert "two versions of nav2_msgs/action/FollowPath_SendGoal: RIHS01_00ff there" in refused.stderr
        assert f"{jazzy.send_goal.hash} (Jazzy, Kilted)" in refused.stderr
        assert f"{lyrical.send_goal.hash} (Lyrical)" in refused.stderr
        assert math.hypot(place.robot.x, place.robot.y) == 0.0


def test_without_a_router_or_a_robot_the_program_says_so(tmp_path: Path) -> None:
    (tmp_path / "ros2.toml").write_text(f'[zenoh]\nrouter = "tcp/127.0.0.1:{free_port()}"\n')
    ended = stopgo(
        "robot", "--name", "r1", "--listen", f"tcp/127.0.0.1:{free_port()}", "--state", str(tmp_path / "s"),
        "--controller", f"ros2-zenoh:{tmp_path / 'ros2.toml'}",
    )  # fmt: skip
    assert ended.returncode == 2
    assert "no zenoh router answers there" in ended.stderr
