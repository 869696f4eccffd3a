"""Robot and station are killed with SIGKILL in the middle of everything, as processes over zenoh.

Half of the trials kill the robot at a chosen journal entry, the others at a random moment; some kill the
station as well. A supervisor starts the robot again, a stubborn station repeats its orders under their
ids, and at the end the journal and the scanner's own record are counted.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pytest

from bridge.journal import open_journal
from bridge.protocol import Command, encode
from bridge.spawn import end_robot, free_port, start_robot
from bridge.station import Station, connect
from mission.document import Mission, Scan
from mission.errors import AnswerIsNo, OutcomeUnknown, RobotUnreachable
from mission.events import Finished, Paused, Scanned, Started
from tests.bridge.world import corridor
from tests.faults.sizes import size

SPEED_UP = 50.0
ENTRIES = 45
"""Journal entries of an undisturbed trial, roughly."""
T = TypeVar("T")


def mission() -> Mission:
    return corridor(stops=3, settle_s=1.0, scan=Scan(profile="default", duration_s=5.0, timeout_s=60.0))


@dataclass
class Supervisor:
    """Starts the robot again whenever it has died; each boot may carry a fault of its own."""

    state: Path
    faults: list[str]
    endpoint: str = field(default_factory=lambda: f"tcp/127.0.0.1:{free_port()}")
    extra: Sequence[str] = ()
    kills: int = 0
    closing: bool = False

    def __enter__(self) -> Supervisor:
        self.robot = self._boot()
        self._thread = threading.Thread(target=self._supervise)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.closing = True
        end_robot(self.robot)
        self._thread.join()

    def kill(self) -> None:
        self.robot.send_signal(signal.SIGKILL)

    def _boot(self) -> subprocess.Popen[str]:
        """A robot that got ready; one that dies while it boots is started again."""
        while True:
            fault = ["--fault", self.faults.pop()] if self.faults else []
            extra = ["--endurance", "0", *self.extra, *fault]
            try:
                return start_robot("r1", self.state, listen=self.endpoint, speed_up=SPEED_UP, extra=extra)
            except RobotUnreachable:
                self.kills += 1
                assert fault, "a robot without a fault did not start"

    def _supervise(self) -> None:
        while True:
            self.robot.wait()
            if self.closing:
                return
            self.kills += 1
            self.robot = self._boot()
            if self.closing:
                end_robot(self.robot)


@dataclass
class Outcome:
    kills: int = 0
    orders: int = 0
    unknown: int = 0


def stubbornly(act: Callable[[], T], outcome: Outcome) -> T:
    """Do it until it is answered."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            return act()
        except (OutcomeUnknown, RobotUnreachable):
            outcome.unknown += 1
    raise AssertionError("no answer for a minute")


def give(station: Station, order: Command, outcome: Outcome) -> bool:
    """Give the order twice, each time until it is answered; whether it was carried out."""
    outcome.orders += 1
    carried_out = []
    for _ in range(2):
        try:
            stubbornly(lambda: station.give(order), outcome)
            carried_out.append(True)
        except AnswerIsNo:
            carried_out.append(False)
    assert carried_out[0] == carried_out[1], "a repeated order was answered differently"
    return carried_out[0]


def drive(station: Station, chance: random.Random, outcome: Outcome) -> int:
    """Start, pause and resume until the run is finished; how many pauses were carried out."""
    give(station, stubbornly(lambda: station.order("start", valid_for_s=60.0), outcome), outcome)
    paused = 0
    while True:
        state = stubbornly(station.status, outcome)
        if state.state == "FINISHED":
            return paused
        if state.state == "RUNNING" and chance.random() < 0.15:
            order = stubbornly(lambda: station.order("pause", valid_for_s=60.0), outcome)
            paused += give(station, order, outcome)
        elif state.state == "PAUSED":
            give(station, stubbornly(lambda: station.order("resume", valid_for_s=60.0), outcome), outcome)
        time.sleep(0.05)


def faults_of(chance: random.Random) -> list[str]:
    """Crashes at journal entries for the first boots."""
    kinds = [chance.choice(["crash", "crashed"]) for _ in range(chance.randint(0, 3))]
    return [f"{kind}@{chance.randint(1, ENTRIES)}" for kind in kinds]


def trial(seed: int, folder: Path) -> Outcome:
    chance, outcome = random.Random(seed), Outcome()
    with Supervisor(folder, faults_of(chance)) as supervisor:
        timers = [
            threading.Timer(chance.uniform(0.1, 3.0), supervisor.kill) for _ in range(chance.randint(0, 2))
        ]
        for timer in timers:
            timer.start()
        with connect(supervisor.endpoint, robot="r1", commander="trial", timeout_s=3.0) as station:
            stubbornly(lambda: station.push(mission()), outcome)
            paused = drive(station, chance, outcome)
        for timer in timers:
            timer.cancel()
        outcome.kills = supervisor.kills
    check(folder, paused)
    return outcome


def check(folder: Path, paused: int) -> None:
    """What the journal and the scanner's record must agree on."""
    with open_journal(folder, "r1") as journal:
        events = journal.events()
        stored = journal.mission(mission().id, 1)
    assert stored is not None
    assert stored[1] == encode(mission())
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert sum(isinstance(event, Started) for event in events) == 1
    assert sum(isinstance(event, Finished) for event in events) == 1
    assert [event.stop for event in events if isinstance(event, Scanned)] == ["s1", "s2", "s3"]
    ordered = [event for event in events if isinstance(event, Paused) and event.reason == "pause by trial"]
    assert len(ordered) == paused
    # A boot that died before it could say so leaves no event, but it has scanned nothing either.
    reboots = sum(isinstance(event, Paused) and event.reason == "reboot" for event in events)
    scans = Counter(
        line.split("-")[1] for line in (folder / "scans.log").read_text().splitlines() if "end" in line
    )
    assert set(scans) == {"s1", "s2", "s3"}
    assert sum(scans.values()) - 3 <= reboots, "a stop was scanned twice without a reboot in between"


def test_kills_of_the_robot_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    outcomes = [trial(seed, tmp_path / str(seed)) for seed in range(size(short=5, full=300))]
    kills, orders = sum(item.kills for item in outcomes), sum(item.orders for item in outcomes)
    unknown = sum(item.unknown for item in outcomes)
    print(f"{len(outcomes)} trials: {kills} kills, {orders} orders, each given twice; {unknown} unknown")
    assert kills >= len(outcomes) // 2
    assert orders >= len(outcomes)


@pytest.mark.parametrize("seed", range(size(short=2, full=40)))
def test_a_killed_station_leaves_a_robot_that_the_next_one_commands(tmp_path: Path, seed: int) -> None:
    """A station dies while it pushes a large mission; pushing again sends the rest."""
    chance = random.Random(seed)
    large = tmp_path / "mission.json"
    large.write_bytes(encode(corridor(stops=4000)))
    with Supervisor(tmp_path / "state", []) as supervisor:
        command = [sys.executable, "-m", "mission", "push", str(large), "--robot", "r1", "--as", "trial"]
        push = subprocess.Popen([*command, "--connect", supervisor.endpoint], stdout=subprocess.DEVNULL)
        time.sleep(chance.uniform(0.2, 0.9))
        push.kill()
        push.wait()
        with connect(supervisor.endpoint, robot="r1", commander="trial") as station:
            seen: list[int] = []
            station.push(corridor(stops=4000), progress=lambda held, total: seen.append(held))
            assert station.status().state == "READY"
            assert station.mission(mission().id, 1) == corridor(stops=4000)
        assert supervisor.kills == 0
