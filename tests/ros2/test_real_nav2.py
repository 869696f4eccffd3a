"""A mission to its end by a real ROS 2: rclpy, Fast DDS, and servers that behave as Nav2's do.

They need the environment that `make ros2` makes; without it these tests are skipped and say so. Nothing here
counts time: a deadline is only the last resort.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import msgspec
import pytest

from stopgo.bridge.link.protocol import encode
from stopgo.bridge.ros2.ros_definitions import ACTIONS, SERVICES, action_types, service_types
from stopgo.mission.document import Mission, RobotSpec, with_digest
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.ports import free_port
from tests.ros2.environment import FOLDER, activated, is_made

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not is_made(), reason="no ROS 2 environment; make it with: make ros2"),
]
HERE = Path(__file__).parent
DEADLINE_S = 60.0
FAST = RobotSpec(radius=0.35, speed=1.5, turn_rate=2.0, acceleration=2.0)
LIFE_CYCLE = "tests.ros2.life_cycle"
SETTINGS = """
[topics]
cmd_vel = "cmd_vel"
[drive]
spin = "spin"
"""


def quick_corridor(*, stops: int, closed: bool) -> Mission:
    made = corridor(stops=stops, closed=closed, settle_s=0.3)
    quick = [
        msgspec.structs.replace(stop, scan=msgspec.structs.replace(stop.scan, duration_s=0.3))
        for stop in made.stops
    ]
    return with_digest(msgspec.structs.replace(made, stops=tuple(quick), robot=FAST))


class Site:
    """The stand-in robot, and stopgo's agent on it, each a process with ROS's Python."""

    def __init__(self, folder: Path, mission: Mission, speed: float, settings: str) -> None:
        self.folder = folder
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.environment = activated({"ROS_DOMAIN_ID": str(random.Random(str(folder)).randint(1, 100))})
        (folder / "scans").mkdir()
        (folder / "ros2.toml").write_text(settings)
        (folder / "mission.json").write_bytes(encode(mission))
        self.processes: list[subprocess.Popen[str]] = []
        self.python("-m", "tests.ros2.stand_in_nav2", str(folder / "scans"), str(speed))

    def robot(self) -> subprocess.Popen[str]:
        return self.python(
            "-m", "stopgo", "robot", "--name", "r1", "--listen", self.endpoint,
            "--state", str(self.folder / "r1.state"),
            "--controller", f"ros2:{self.folder / 'ros2.toml'}",
        )  # fmt: skip

    def python(self, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [str(self.environment["STOPGO_ROS2_PYTHON"]), *arguments], env=self.environment, text=True,
            cwd=HERE.parents[1], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        self.processes.append(process)
        _wait_for_line(process.stdout, "ready")
        return process

    def stopgo(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return stopgo(*arguments, "--robot", "r1", "--connect", self.endpoint)

    def state(self) -> dict[str, object]:
        answer = self.stopgo("status", "--json")
        return dict(json.loads(answer.stdout)) if answer.returncode == 0 else {}

    def until(self, reached: Callable[[dict[str, object]], bool]) -> dict[str, object]:
        end_s = time.monotonic() + DEADLINE_S
        while not reached(state := self.state()):
            assert time.monotonic() < end_s, state
            time.sleep(0.1)
        return state

    def other_node(self, module: str, *arguments: str) -> str:
        """Run another ROS node to its end; what it prints."""
        ended = subprocess.run(
            [str(self.environment["STOPGO_ROS2_PYTHON"]), "-m", module, *arguments],
            env=self.environment, cwd=HERE.parents[1], capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    def reviewed(self) -> dict[str, list[dict[str, Any]]]:
        """The report on the run, once it has ended."""
        recording = str(self.folder / "field.rrd")
        assert self.stopgo("watch", "--rrd", recording).returncode == 0
        answer = stopgo("review", recording, "--json")
        assert answer.returncode == 0, answer.stderr
        return dict(json.loads(answer.stdout))

    def close(self) -> None:
        for process in self.processes:
            process.send_signal(signal.SIGKILL)
            process.wait()


def _wait_for_line(stream: IO[str] | None, begin: str) -> None:
    assert stream is not None
    lines = []
    for line in stream:
        lines.append(line)
        if line.startswith(begin) or f" {begin} " in line:
            return
    raise AssertionError("".join(lines))


@contextmanager
def site_in(folder: Path, mission: Mission, speed: float = 1.5, settings: str = SETTINGS) -> Iterator[Site]:
    site = Site(folder, mission, speed, settings)
    try:
        yield site
    finally:
        site.close()


def test_a_mission_is_driven_to_its_end_and_reviewed(tmp_path: Path) -> None:
    with site_in(tmp_path, quick_corridor(stops=3, closed=True)) as site:
        site.robot()
        assert site.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        assert site.stopgo("start").returncode == 0
        (run,) = site.reviewed()["runs"]
        state = site.state()
        assert (state["state"], state["done"]) == ("FINISHED", ["s1", "s2", "s3"])
        distances = {stop["stop"]: stop["deviation_m"] for stop in run["stops"]}
        print("distances from the stops:", distances)
        assert list(distances) == ["s1", "s2", "s3"]
        assert max(distances.values()) <= 0.05
        scans = [file.read_text().split() for file in sorted((tmp_path / "scans").iterdir())]
        assert [round(float(scan[0])) for scan in scans] == [2, 4, 6]
        assert {scan[3] for scan in scans} == {"False"}, "the robot moved during a scan"


def test_a_mission_that_allows_it_is_driven_on_nav2s_own_way(tmp_path: Path) -> None:
    """Nav2's goals to its own servers are no other client's, and the driven way is compared with the legs."""
    made = quick_corridor(stops=2, closed=False)
    policy = msgspec.structs.replace(made.policy, own_way=True)
    with site_in(tmp_path, with_digest(msgspec.structs.replace(made, policy=policy))) as site:
        site.robot()
        assert site.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        assert site.stopgo("start").returncode == 0
        (run,) = site.reviewed()["runs"]
        assert site.state()["done"] == ["s1", "s2"]
        assert [state["state"] for state in run["states"]].count("HELD") == 0
        assert max(stop["deviation_m"] for stop in run["stops"]) <= 0.05
        assert 0.5 < run["greatest_beside_route_m"] < 1.2


def test_the_robot_drives_only_while_its_lifecycle_node_is_active(tmp_path: Path) -> None:
    """Transitions are those that a lifecycle manager requests."""
    by_hand = f"autostart_node = false\n{SETTINGS}"
    with site_in(tmp_path, quick_corridor(stops=2, closed=False), 0.6, by_hand) as site:
        site.robot()
        assert site.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        assert "unconfigured; configure and activate it" in site.stopgo("start").stderr
        assert site.other_node(LIFE_CYCLE, "configure", "activate") == "ready\nunconfigured active\n"
        manager = site.python("-m", LIFE_CYCLE, "drive", "deactivate")
        assert site.stopgo("start").returncode == 0
        assert manager.stdout is not None
        assert manager.stdout.readline() == "active inactive\n"
        site.until(lambda state: state.get("state") == "HELD")
        assert "inactive" in site.stopgo("retry").stderr
        assert site.other_node(LIFE_CYCLE, "activate") == "ready\ninactive active\n"
        assert site.stopgo("retry").returncode == 0
        assert site.until(lambda state: state.get("state") == "FINISHED")["done"] == ["s1", "s2"]
        (run,) = site.reviewed()["runs"]
        assert "the lifecycle node is inactive; activate it" in " ".join(
            state["why"] for state in run["states"]
        )


def test_a_robot_on_rmw_zenoh_is_read_without_ros(tmp_path: Path) -> None:
    """By keys, tokens and CDR that a library of others has made."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with _zenoh_robot(endpoint):
        asked = stopgo("status", "--ros2", "7/r1", "--connect", endpoint, "--json")
        assert asked.returncode == 0, asked.stderr
        found = json.loads(asked.stdout)
        assert (found["state"], found["stop"], found["battery"]) == ("RUNNING", "s2", 0.75)
        assert found["pose"] == {"x": 1.5, "y": 2.0, "heading": 0.0}
        checked = json.loads(stopgo("doctor", "--ros2", "7/r1", "--connect", endpoint, "--json").stdout)
        said = {check["name"]: check for check in checked["checks"]}
        assert said["/r1/odom"]["ok"] and said["frames"]["ok"] and said["clock"]["ok"]
        assert "best effort is published, reliable is subscribed" in said["qos"]["told"]
    with _zenoh_robot(endpoint, "wrong"):
        asked = stopgo("status", "--ros2", "7/r1", "--connect", endpoint)
        assert "two versions of nav_msgs/msg/Odometry: RIHS01_" in asked.stderr


def test_hashes_without_ros_are_those_that_rosidl_has_written() -> None:
    written: dict[str, str] = {}
    for file in [*FOLDER.glob("types/share/*/*/*.json"), *FOLDER.glob("venv/share/*/*/*.json")]:
        found = json.loads(file.read_text())
        written |= {one["type_name"]: one["hash_string"] for one in found.get("type_hashes", ())}
    for name in SERVICES:
        assert service_types(name)[0].hash == written[name], name
    for name in ACTIONS:
        newest = action_types(name)[-1]
        for one in (newest.send_goal, newest.get_result, newest.feedback):
            assert one.hash == written[one.name], one.name


def test_a_mission_is_driven_over_zenoh_with_types_of_real_ros_and_a_foreign_scanner(tmp_path: Path) -> None:
    """Nav2 is played with CDR and hashes of real ROS; the scanner and a client are of others' library."""
    router, endpoint = (f"tcp/127.0.0.1:{free_port()}" for _ in range(2))
    (tmp_path / "scans").mkdir()
    (tmp_path / "mission.json").write_bytes(encode(quick_corridor(stops=2, closed=True)))
    (tmp_path / "ros2.toml").write_text(
        f'{SETTINGS}[scan]\nname = "peer_scan"\n[zenoh]\nrouter = "{router}"\ndomain = 9\nnamespace = "r1"\n'
    )
    python, robot = activated({})["STOPGO_ROS2_PYTHON"], ("--robot", "r1", "--connect", endpoint)
    with _processes(
        [sys.executable, "-m", "tests.bridge.router", router],
        [python, "-m", "tests.bridge.ros2.zenoh_nav2", router, "9", str(tmp_path / "scans"), "1.5"],
        [python, "-m", "tests.ros2.zenoh_peers", router, "9"],
        [
            sys.executable, "-m", "stopgo", "robot", "--name", "r1", "--listen", endpoint, "--state",
            str(tmp_path / "r1.state"), "--controller", f"ros2-zenoh:{tmp_path / 'ros2.toml'}",
        ],
    ) as started:  # fmt: skip
        assert stopgo("push", str(tmp_path / "mission.json"), *robot).returncode == 0
        assert stopgo("start", *robot).returncode == 0
        recording = str(tmp_path / "field.rrd")
        assert stopgo("watch", "--rrd", recording, *robot).returncode == 0
        (run,) = json.loads(stopgo("review", recording, "--json").stdout)["runs"]
        distances = {stop["stop"]: stop["deviation_m"] for stop in run["stops"]}
        print("distances from the stops, over zenoh:", distances)
        assert list(distances) == ["s1", "s2"] and max(distances.values()) <= 0.05
        stream = started[2].stdout
        assert stream is not None
        seen = json.loads(next(line for line in stream if line.startswith("{")))
        assert seen["state"] in ("IDLE", "READY", "RUNNING", "FINISHED")
        assert seen["resume"] == "resume is not taken from ROS; set commands = true in ros2.toml"


@contextmanager
def _zenoh_robot(endpoint: str, *more: str) -> Iterator[None]:
    """A zenoh router, and a robot of pyzeros at it."""
    python = activated({})["STOPGO_ROS2_PYTHON"]
    with _processes(
        [sys.executable, "-m", "tests.bridge.router", endpoint],
        [python, "-m", "tests.ros2.rmw_zenoh_peer", endpoint, "7", *more],
    ):
        yield


@contextmanager
def _processes(*commands: list[str]) -> Iterator[list[subprocess.Popen[str]]]:
    """Processes, each started once the one before it is ready."""
    started: list[subprocess.Popen[str]] = []
    try:
        for command in commands:
            environment = None if command[0] == sys.executable else activated({})
            process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=HERE.parents[1],
                env=environment,
            )  # fmt: skip
            started.append(process)
            _wait_for_line(process.stdout, "ready")
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def test_a_killed_agent_takes_up_its_run_and_another_clients_goal_holds_it(tmp_path: Path) -> None:
    with site_in(tmp_path, quick_corridor(stops=2, closed=False), speed=0.6) as site:
        robot = site.robot()
        assert site.stopgo("push", str(tmp_path / "mission.json")).returncode == 0
        assert site.stopgo("start").returncode == 0
        watching = site.python("-m", "tests.ros2.goal_left")  # returns when it drives to the second stop
        robot.send_signal(signal.SIGKILL)
        robot.wait()
        assert watching.stdout is not None
        assert watching.stdout.readline() == "4 5\n", "the guard has cancelled the goal"
        site.robot()
        assert site.until(lambda state: "state" in state)["state"] == "PAUSED"
        seen = json.loads(site.other_node("tests.ros2.run_observer"))
        assert (seen["state"]["state"], seen["state"]["done"]) == ("PAUSED", ["s1"])
        assert seen["plan"][-1] == [4.0, 0.0]
        assert (seen["frame"], seen["stops"], seen["diagnostics"]) == ("map", ["s1", "s2"], "PAUSED")
        assert seen["resume"] == "resume is not taken from ROS; set commands = true in ros2.toml"
        assert "PAUSED" in seen["pause"]
        site.python("-m", "tests.ros2.foreign_client")
        assert site.stopgo("resume").returncode == 0
        site.until(lambda state: state.get("state") == "HELD")
        assert site.stopgo("retry").returncode == 0
        assert site.until(lambda state: state.get("state") == "FINISHED")["done"] == ["s1", "s2"]
        (run,) = site.reviewed()["runs"]
        assert "another client" in " ".join(state["why"] for state in run["states"])
