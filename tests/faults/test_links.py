"""The line between station and robot is slow, silent, cut, or shared by two commanders."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link.protocol import KeyExpressions, encode
from stopgo.bridge.station.follow import Report
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import Finished, PoseReport, Scanned, StateReport
from tests.bridge.proxy import Proxy
from tests.bridge.world import corridor
from tests.ports import free_port


@contextmanager
def line(folder: Path, *, speed_up: float = 50.0, **proxied: float) -> Iterator[Proxy]:
    """A robot behind a proxy, with a battery for the longest mission."""
    port = free_port()
    extra = ("--battery-life", "0")
    robot = start_robot("r1", folder, listen=f"tcp/127.0.0.1:{port}", speed_up=speed_up, extra=extra)
    try:
        with Proxy(port, **proxied) as proxy:
            yield proxy
    finally:
        end_robot(robot)


def follow_through(station: Station, trouble: threading.Thread) -> list[Report]:
    """All reports of the run, with the trouble beginning at the first scan."""
    reports: list[Report] = []
    for report in station.reports():
        reports.append(report)
        if isinstance(report, Scanned) and not trouble.is_alive() and trouble.ident is None:
            trouble.start()
    trouble.join()
    return reports


def check_whole(reports: list[Report]) -> None:
    """Every event once and in order, to the end, and the last state."""
    events = [
        item for item in reports if not isinstance(item, StateReport | PoseReport) and hasattr(item, "number")
    ]
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert isinstance(events[-1], Finished)
    states = [item.state for item in reports if isinstance(item, StateReport)]
    assert states[-1] == "FINISHED"


@pytest.mark.parametrize("seconds", [1.0, 5.0])
def test_a_blackhole_while_watching_loses_no_event(tmp_path: Path, seconds: float) -> None:
    """5 s is longer than the lease, so the transport is closed and opened again; 1 s is not."""
    with line(tmp_path, speed_up=40) as proxy, connect(proxy.endpoint, robot="r1") as station:

        def blackhole() -> None:
            proxy.swallow(True)
            time.sleep(seconds)
            proxy.swallow(False)

        station.push(corridor())
        station.command("start")
        check_whole(follow_through(station, threading.Thread(target=blackhole)))


def test_a_line_that_is_cut_again_and_again_loses_no_event(tmp_path: Path) -> None:
    with line(tmp_path, speed_up=40) as proxy, connect(proxy.endpoint, robot="r1") as station:

        def cut() -> None:
            for _ in range(4):
                proxy.cut()
                time.sleep(0.6)

        station.push(corridor())
        station.command("start")
        check_whole(follow_through(station, threading.Thread(target=cut)))


def test_a_push_over_a_slow_line_that_is_cut_goes_on_where_it_was(tmp_path: Path) -> None:
    mission = corridor(stops=4000)
    with (
        line(tmp_path, bits_per_s=8e6) as proxy,
        connect(proxy.endpoint, robot="r1", timeout_s=10) as station,
    ):
        for moment in (0.3, 0.9):
            threading.Timer(moment, proxy.cut).start()
        station.push(mission)
        assert station.mission(mission.id, 1) == mission


def test_a_command_into_a_blackhole_is_unknown_and_comes_to_nothing_when_it_is_late(tmp_path: Path) -> None:
    with line(tmp_path) as proxy, connect(proxy.endpoint, robot="r1", timeout_s=30.0) as station:
        station.push(corridor())
        station.timeout_s = 1.5
        start = station.order("start")
        proxy.swallow(True)
        with pytest.raises(OutcomeUnknown, match="unknown"):
            station.give(start)
        time.sleep(1.0)
        proxy.swallow(False)
        station.timeout_s = 10.0
        assert station.status().state in ("READY", "RUNNING", "FINISHED")
        with_answer = None
        try:
            with_answer = station.give(start)
        except NegativeResult as refused:
            assert "expired" in str(refused)
        # Either it had arrived in time and ran once, or it never will.
        states = {station.status().run_id for _ in range(3)}
        assert len(states) == 1
        assert (states == {None}) == (with_answer is None)


def test_a_line_with_delay_carries_a_whole_run(tmp_path: Path) -> None:
    with line(tmp_path, speed_up=200, delay_s=0.15) as proxy, connect(proxy.endpoint, robot="r1") as station:
        station.push(corridor())
        station.command("start")
        check_whole(list(station.reports()))


@pytest.fixture(scope="module")
def shared_line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Proxy]:
    """A robot for several tests, of which one drives it."""
    with line(tmp_path_factory.mktemp("shared"), speed_up=20) as proxy:
        yield proxy


def test_of_two_stations_at_once_one_commands(shared_line: Proxy) -> None:
    with connect(shared_line.endpoint, robot="r1", commander="alice") as station:
        station.push(corridor())
    outcomes: dict[str, str] = {}

    def start(who: str) -> None:
        with connect(shared_line.endpoint, robot="r1", commander=who) as mine:
            try:
                outcomes[who] = mine.command("start").outcome
            except NegativeResult as refused:
                outcomes[who] = str(refused)

    threads = [threading.Thread(target=start, args=(who,)) for who in ("alice", "bob")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    with connect(shared_line.endpoint, robot="r1", commander="alice") as station:
        started = [event for event in station.log() if type(event).__name__ == "Started"]
    assert outcomes["alice"] == "ok"
    assert "not_the_commander" in outcomes["bob"] or "wrong_state" in outcomes["bob"]
    assert len(started) == 1


def test_an_oversize_message_is_not_taken_and_the_robot_stays(shared_line: Proxy) -> None:
    with connect(shared_line.endpoint, robot="r1") as station:
        key = KeyExpressions("r1").mission("x", "begin")
        assert station.link.ask(key, b"x" * 3_000_000, timeout_s=1.0) is None
        station.timeout_s = 10.0
        assert station.status().mission_id in (None, corridor().id)
        small = station.link.ask(key, encode({"is": "Manifest"}), timeout_s=2.0)
        assert small is not None
        assert msgspec.json.decode(small)["is"] == "Malformed"
