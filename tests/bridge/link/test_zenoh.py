"""Station and robot in two processes, over zenoh on loopback."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from stopgo.bridge.commands.spawn import end_robot, robot_process, start_robot
from stopgo.bridge.link.link import Request, Unanswered
from stopgo.bridge.link.protocol import PosePage, decode
from stopgo.bridge.link.zenoh_link import Guard, ZenohLink, check_endpoint, connecting, joining, listening
from stopgo.bridge.station.follow import Followed
from stopgo.bridge.station.station import connect
from stopgo.mission.document import with_digest
from stopgo.mission.errors import InputError, RobotUnreachable
from stopgo.mission.run.events import Event, Finished, PoseReport, Scanned, StateReport
from tests.bridge.world import corridor
from tests.called import stopgo
from tests.ports import free_port


def run_of(reports: list[Followed]) -> str:
    return next(report.run_id for report in reports if isinstance(report, StateReport) and report.run_id)


def test_a_mission_is_pushed_started_and_followed_to_its_end(tmp_path: Path) -> None:
    with robot_process("r1", tmp_path, speed_up=100) as endpoint, connect(endpoint, robot="r1") as station:
        station.push(corridor())
        station.command("start")
        reports: list[Followed] = list(station.reports())
        again = list(station.reports())
        kept = station.link.ask(
            station.keys.poses, timeout_s=5.0, parameters={"since": "0", "run": run_of(again)}
        )
    events = [report for report in reports if isinstance(report, Event)]
    assert [event.stop for event in events if isinstance(event, Scanned)] == ["s1", "s2", "s3"]
    assert isinstance(events[-1], Finished)
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    states = [report for report in reports if isinstance(report, StateReport)]
    assert states[-1].state == "FINISHED"
    poses = [report for report in reports if isinstance(report, PoseReport)]
    assert [pose.seq for pose in poses] == sorted({pose.seq for pose in poses})
    # The poses from before the station listened come too, so the whole run is there.
    assert kept is not None
    assert poses[0].seq == decode(kept, PosePage).poses[0].seq
    assert [event for event in again if isinstance(event, Finished)]


def test_the_commands_do_it_too(tmp_path: Path) -> None:
    document = tmp_path / "mission.json"
    document.write_bytes(msgspec.json.encode(corridor()))
    with robot_process("r1", tmp_path / "state", speed_up=100) as endpoint:
        reach = ("--robot", "r1", "--connect", endpoint)
        assert stopgo("push", str(document), *reach).returncode == 0
        started = stopgo("start", *reach, "--json")
        assert started.returncode == 0, started.stderr
        assert stopgo("watch", *reach).returncode == 0
        status = json.loads(stopgo("status", *reach, "--json").stdout)
        assert list(status) == [
            *("robot", "boot_id", "state", "run_id", "mission_id", "revision", "stop"),
            *("done", "skipped", "outside", "battery"),
            *("battery_ok", "position_ok", "fence_ok", "age_s"),
        ]
        assert (status["state"], status["done"]) == ("FINISHED", ["s1", "s2", "s3"])
        refused = stopgo("start", *reach)
        assert (refused.returncode, refused.stdout) == (1, "")
        assert "start --again" in refused.stderr


def test_a_watch_that_comes_first_waits_for_the_run_and_ends_with_1_when_it_is_aborted(
    tmp_path: Path,
) -> None:
    with robot_process("r1", tmp_path, speed_up=10) as endpoint, connect(endpoint, robot="r1") as station:
        station.push(corridor())
        command = [sys.executable, "-m", "stopgo", "watch", "--robot", "r1", "--connect", endpoint]
        watch = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert watch.stdout is not None
        assert "waiting" in watch.stdout.readline()
        station.command("start")
        # A watch that has received no pose asks for those of the past, with much patience.
        assert any(isinstance(report, PoseReport) for report in station.reports())
        station.command("abort")
        said = watch.communicate(timeout=120)[0]
    assert watch.returncode == 1
    assert "Aborted" in said


def test_a_killed_robot_comes_back_paused_and_finishes_after_resume(tmp_path: Path) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    robot = start_robot("r1", tmp_path, listen=endpoint, speed_up=100)
    try:
        with connect(endpoint, robot="r1") as station:
            station.push(corridor())
            station.command("start")
            for report in station.reports():
                if isinstance(report, Scanned):
                    break
            robot.kill()
            robot.wait()
            robot = start_robot("r1", tmp_path, listen=endpoint, speed_up=100)
            station.reach(endpoint)
            assert station.status().state == "PAUSED"
            station.command("resume")
            events = [report for report in station.reports() if isinstance(report, Scanned)]
            assert [event.stop for event in events] == ["s1", "s2", "s3"]
    finally:
        end_robot(robot)


def test_sigterm_ends_the_robot_cleanly(tmp_path: Path) -> None:
    robot = start_robot("r1", tmp_path, listen=f"tcp/127.0.0.1:{free_port()}")
    robot.terminate()
    assert robot.wait(60) == 0


def test_a_robot_that_is_not_there_is_unreachable_and_nothing_is_sent() -> None:
    unreached = connect(f"tcp/127.0.0.1:{free_port()}", robot="r1", timeout_s=0.3)
    with pytest.raises(RobotUnreachable, match=r"robot r1 not found within 0\.3 s"), unreached:
        pass


def test_a_slow_station_knows_that_nothing_was_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ZenohLink.ask

    def slowly(link: ZenohLink, *given: Any, timeout_s: float, **details: Any) -> bytes | None:
        time.sleep(timeout_s)
        return asked(link, *given, timeout_s=timeout_s, **details)

    monkeypatch.setattr(ZenohLink, "ask", slowly)
    with connect("tcp/127.0.0.1:1", robot="r1", timeout_s=0.2, at_once=True) as station:
        with pytest.raises(RobotUnreachable, match="nothing was sent"):
            station.command("pause")
        assert not station.link.may_be_sent


def test_one_attempt_to_connect_outlasts_the_time_in_which_it_is_needed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Closing waits for the attempt that is under way: a second one doubled the time of a command."""
    opened, configs = zenoh.open, []

    def opening(config: zenoh.Config) -> zenoh.Session:
        configs.append(config)
        return opened(config)

    monkeypatch.setattr(zenoh, "open", opening)
    for open_s in (2.0, 600.0):
        with connecting("tcp/127.0.0.1:1", open_s=open_s):
            pass
    usual_s, long_s = (int(one.get_json("transport/unicast/open_timeout")) / 1e3 for one in configs)
    assert 2.0 < usual_s <= 2.5
    assert long_s < 20.0, "a robot that is back after minutes would be found minutes later"


@pytest.mark.parametrize("lost", [False, True])
def test_a_question_that_left_may_be_sent(lost: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint, arrived = f"tcp/127.0.0.1:{free_port()}", threading.Event()
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    kept = []
    with zenoh.open(config) as other, connecting(endpoint) as link:
        link.await_others(1, 20.0)
        link.ask("a/b", timeout_s=20.0)
        assert not link.may_be_sent  # the other end serves nothing

        def keep(query: zenoh.Query) -> None:
            kept.append(query)  # never answered
            arrived.set()

        def ask_until_it_arrives() -> None:
            while not arrived.is_set():
                link.ask("a/b", timeout_s=20.0 if lost else 0.5)

        served = other.declare_queryable("a/b", keep, complete=True)
        asking = threading.Thread(target=ask_until_it_arrives)
        asking.start()
        assert arrived.wait(20.0)
        if lost:
            # The replies may end before zenoh drops the other end from its list.
            linked = link._others()
            monkeypatch.setattr(link, "_others", lambda: linked)
            other.close()
        asking.join()
        assert served and link.may_be_sent


@pytest.mark.parametrize("behind_router", [False, True])
def test_a_question_that_arrived_unanswered_may_be_sent(behind_router: bool) -> None:
    arrived = threading.Event()

    def refuse(request: Request) -> bytes:
        arrived.set()
        raise Unanswered

    with ExitStack() as stack:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        if behind_router:
            stack.enter_context(listening(endpoint))
        robot = stack.enter_context((joining if behind_router else listening)(endpoint))
        robot.serve("a/b", refuse)
        link = stack.enter_context(connecting(endpoint))
        link.await_others(1, 20.0)
        while not arrived.is_set():  # the router may not know the robot yet
            assert link.ask("a/b", timeout_s=20.0) is None
        assert link.may_be_sent


def test_a_question_ends_quietly_if_its_link_closes() -> None:
    endpoint, arrived, ended = f"tcp/127.0.0.1:{free_port()}", threading.Event(), threading.Event()
    kept = []

    def keep(query: zenoh.Query) -> None:
        kept.append(query)
        arrived.set()

    config = zenoh.Config()
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as other, connecting(endpoint) as link:
        served = other.declare_queryable("a/b", keep, complete=True)
        link.await_others(1, 20.0)

        def ask() -> None:
            while not arrived.is_set():
                link.ask("a/b", timeout_s=0.5)
            ended.set()

        threading.Thread(target=ask).start()
        assert arrived.wait(20.0)
        link.close()
        assert served and ended.wait(20.0)


def test_a_session_that_is_open_does_not_keep_the_interpreter() -> None:
    code = (
        "from stopgo.bridge.link.zenoh_link import listening\n"
        f"with listening('tcp/127.0.0.1:{free_port()}') as link:\n"
        "    link.serve('a/b', lambda request: b'')\n"
        "    raise SystemExit(7)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], timeout=120, check=False).returncode == 7


@pytest.mark.parametrize("endpoint", ["tcp/0.0.0.0:7447", "tcp/10.1.2.3:7447", "udp/[::]:7447"])
def test_addresses_beyond_this_machine_are_refused_unless_insecure(endpoint: str) -> None:
    with pytest.raises(InputError, match="--insecure"):
        check_endpoint(endpoint, Guard(), option="--listen")
    check_endpoint(endpoint, Guard(insecure=True), option="--listen")


@pytest.mark.parametrize("endpoint", ["", "127.0.0.1:7447", "tcp/127.0.0.1", "serial//dev/ttyS0"])
def test_what_is_no_endpoint_is_named(endpoint: str) -> None:
    with pytest.raises(InputError, match="not an endpoint"):
        check_endpoint(endpoint, Guard(insecure=True), option="--connect")


def test_threads_end_with_the_link() -> None:
    before = threading.active_count()
    unreached = connect(f"tcp/127.0.0.1:{free_port()}", robot="r1", timeout_s=0.1)
    with pytest.raises(RobotUnreachable), unreached:
        pass
    assert threading.active_count() <= before + 1


def test_watch_records_the_run(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    with robot_process("r1", tmp_path / "state", speed_up=100) as endpoint:
        with connect(endpoint, robot="r1") as station:
            station.push(corridor())
            station.command("start")
        watched = stopgo(
            "watch", "--robot", "r1", "--connect", endpoint, "--rrd", str(tmp_path / "field.rrd")
        )
    assert watched.returncode == 0, watched.stderr
    assert (tmp_path / "field.rrd").stat().st_size > 1000


def test_another_commander_needs_to_take_over(tmp_path: Path) -> None:
    document = tmp_path / "mission.json"
    document.write_bytes(msgspec.json.encode(corridor()))
    with robot_process("r1", tmp_path / "state") as endpoint:
        reach = ("--robot", "r1", "--connect", endpoint)
        assert stopgo("push", str(document), *reach, "--as", "alice").returncode == 0
        denied = stopgo("push", str(document), *reach, "--as", "bob")
        assert (denied.returncode, "alice commands it" in denied.stderr) == (1, True)
        assert stopgo("push", str(document), *reach, "--as", "bob", "--take-over").returncode == 0
        assert stopgo("start", *reach, "--as", "alice").returncode == 1
        assert stopgo("start", *reach, "--as", "alice", "--take-over").returncode == 0
        assert stopgo("pause", *reach, "--as", "bob").returncode == 0
        assert stopgo("resume", *reach, "--as", "bob").returncode == 1
        assert stopgo("resume", *reach, "--as", "alice").returncode == 0


def test_the_first_pose_of_a_run_is_where_the_robot_was_put(tmp_path: Path) -> None:
    """Its mission puts a robot that stands nowhere yet at its start; the run gets no pose of before."""
    start = msgspec.structs.replace(corridor().start, x=1.0)
    first = msgspec.structs.replace(corridor().stops[0], approach=((1.0, 0.0), (2.0, 0.0)))
    mission = with_digest(msgspec.structs.replace(corridor(), start=start, stops=(first,), return_=None))
    with robot_process("r1", tmp_path, speed_up=20) as endpoint, connect(endpoint, robot="r1") as station:
        station.push(mission)
        station.command("start")
        poses = [report for report in station.reports() if isinstance(report, PoseReport)]
    assert min(report.pose.x for report in poses) >= 1.0 - 0.01
