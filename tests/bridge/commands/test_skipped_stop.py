"""The stop that a skip without `--stop` is meant for: the one that this station showed last."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from stopgo.bridge.commands.run_control_commands import skip_stop
from stopgo.bridge.commands.watch_commands import RememberingDisplay
from stopgo.bridge.link.zenoh_link import listening
from stopgo.bridge.robot.agent import Agent
from stopgo.bridge.station.shown_stop import ShownStop, ShownStopFile
from stopgo.bridge.station.station import Station
from stopgo.bridge.station.watch import EventLines, watch_with
from stopgo.mission.errors import NegativeResult
from tests.bridge.world import Field, corridor
from tests.called import stopgo
from tests.ports import free_port


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def driving() -> tuple[Field, Station]:
    """A robot on its way to the first of four stops, and the station that sent it."""
    field = Field()
    station = field.station()
    station.push(corridor(stops=4))
    station.command("start")
    return field, station


def test_two_who_skip_the_same_stop_skip_one() -> None:
    """Each was shown s1; the second skipped s2, which it never saw."""
    field, alice = driving()
    bob = field.station_at_the_link("bob")
    alice_sees, bob_sees = (ShownStopFile("tcp/10.1.2.3:7447", "r1", who) for who in ("alice", "bob"))
    for shown in (alice_sees, bob_sees):
        shown.remember(field.report().run_id, field.report().stop)
    skip_stop(alice, alice_sees, None, take_over=False)
    with pytest.raises(NegativeResult, match=r"current stop is s2, not s1, which this station showed last;"
                       r" see stopgo status, or name the stop with --stop") as refused:  # fmt: skip
        skip_stop(bob, bob_sees, None, take_over=True)
    assert refused.value.reason == "not_at_stop"
    assert field.report().skipped == ("s1",)
    assert skip_stop(bob, bob_sees, "s2", take_over=True).outcome == "ok"


def test_a_skip_that_is_typed_twice_skips_one_stop() -> None:
    (_field, station), shown = driving(), ShownStopFile("tcp/10.1.2.3:7447", "r1")
    skip_stop(station, shown, None, take_over=False)
    with pytest.raises(NegativeResult, match="current stop is s2, not s1"):
        skip_stop(station, shown, None, take_over=False)


def test_the_stop_of_another_run_does_not_count() -> None:
    (_field, station), shown = driving(), ShownStopFile("tcp/10.1.2.3:7447", "r1")
    shown.remember("the run before", "s4")
    assert skip_stop(station, shown, None, take_over=False).outcome == "ok"
    assert station.meant_stop == "s1"


def test_a_display_remembers_the_stop_before_it_shows_it() -> None:
    (field, station), shown = driving(), ShownStopFile("tcp/10.1.2.3:7447", "r1")
    arrivals: list[tuple[str, str]] = []

    def see(line: str) -> None:
        if "Arrived" in line:
            arrivals.append((line.split()[3], getattr(shown.read(), "stop", "")))

    field.work()
    watch_with(station, None, RememberingDisplay(EventLines(see), shown))
    assert [seen for seen, _ in arrivals] == [f"s{number}" for number in range(1, 5)]
    assert all(seen == remembered for seen, remembered in arrivals)


def test_robots_and_sites_have_memories_of_their_own() -> None:
    shown = ShownStopFile("tcp/10.1.2.3:7447", None, "r1")
    shown.remember("run", "s1")
    assert shown.read() == ShownStop(run_id="run", stop="s1")
    for other in (("tcp/10.1.2.3:7447", None, "r2"), ("tcp/10.1.2.3:7447", "hall", "r1"),
                  ("tcp/10.1.2.4:7447", None, "r1")):  # fmt: skip
        assert ShownStopFile(*other).read() is None


def test_a_folder_that_takes_no_file_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("")
    shown = ShownStopFile("tcp/10.1.2.3:7447", None, "r1")
    shown.remember("run", "s1")
    assert shown.read() is None


def commands(robot: Field) -> Callable[..., str]:
    """Return what gives commands to a robot and returns all that they print."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"

    def give(*words: str) -> str:
        with listening(endpoint) as link, closing(link):
            Agent(
                keys=robot.keys, link=link, journal=robot.journal, runner=robot.controller, clock=robot.clock,
                command_clock=robot.clock,
            ).serve()  # fmt: skip
            link.announce(robot.keys.alive)
            done = stopgo(*words, "--robot", robot.keys.robot, "--connect", endpoint)
        return done.stdout + done.stderr

    return give


def test_the_command_says_which_stop_it_skipped() -> None:
    field, _ = driving()
    give = commands(field)
    assert "at s1" in give("status")
    assert "skip s1 ok; RUNNING" in give("skip", "--take-over")
    assert "current stop is s2, not s1, which this station showed last" in give("skip", "--take-over")
    assert "at s2" in give("status")
    assert "skip s2 ok; RUNNING" in give("skip", "--take-over")
