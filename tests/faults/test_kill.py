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
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import pytest

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.link.protocol import encode
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.bridge.robot.storage_watchdog import LATE
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.document import Mission, Scan
from stopgo.mission.errors import NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.run.events import Finished, Held, Paused, RevisionTaken, RevisionWaits, Scanned, Started
from stopgo.mission.run.run_commands import FREE_VERBS, RunCommand, Verb
from tests.bridge.world import corridor
from tests.faults.sizes import size
from tests.ports import free_port

SPEED_UP = 50.0
ENTRIES = 45
"""Journal entries of an undisturbed trial, roughly."""
T = TypeVar("T")


def mission(*, stops: int = 3, revision: int = 1) -> Mission:
    scan = Scan(profile="default", duration_s=5.0, timeout_s=60.0)
    return corridor(stops=stops, revision=revision, settle_s=1.0, scan=scan)


@dataclass
class Supervisor:
    """Starts the robot again whenever it has died; each boot may carry a fault of its own."""

    state: Path
    faults: list[str]
    endpoint: str = field(default_factory=lambda: f"tcp/127.0.0.1:{free_port()}")
    extra: Sequence[str] = ()
    speed_up: float = SPEED_UP
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
            extra = ["--battery-life", "0", *self.extra, *fault]
            try:
                return start_robot(
                    "r1", self.state, listen=self.endpoint, speed_up=self.speed_up, extra=extra
                )
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


@contextmanager
def reached(
    endpoint: str, outcome: Outcome, *, keys: Path | None = None, timeout_s: float = 3.0
) -> Iterator[Station]:
    """A station that has reached the robot, however long it takes to be started again."""
    with ExitStack() as stack:
        yield stubbornly(
            lambda: stack.enter_context(
                connect(endpoint, robot="r1", commander="trial", keys=keys, timeout_s=timeout_s)
            ),
            outcome,
        )


def give(station: Station, order: RunCommand, outcome: Outcome) -> bool:
    """Give the order twice, each time until it is answered; whether it was carried out."""
    outcome.orders += 1
    carried_out = []
    for _ in range(2):
        try:
            stubbornly(lambda: station.give(order), outcome)
            carried_out.append(True)
        except NegativeResult:
            carried_out.append(False)
    assert carried_out[0] == carried_out[1], "a repeated order was answered differently"
    return carried_out[0]


def begin(station: Station, outcome: Outcome) -> None:
    """Order the start; again if the robot was started again in between, which refuses the old order."""
    while not give(station, stubbornly(lambda: station.order("start", valid_for_s=60.0), outcome), outcome):
        assert stubbornly(station.status, outcome).state == "READY"


def see_through(station: Station, chance: random.Random, outcome: Outcome, *, pauses: float) -> int:
    """Resume, and now and then pause, until the run is finished; how many pauses were carried out.

    A robot whose journal did not answer in time, on a busy machine, is held, and tries again by command.
    """
    paused = 0
    while True:
        state = stubbornly(station.status, outcome)
        if state.state == "FINISHED":
            return paused
        if state.state == "RUNNING" and chance.random() < pauses:
            order = stubbornly(lambda: station.order("pause", valid_for_s=60.0), outcome)
            paused += give(station, order, outcome)
        elif state.state == "PAUSED":
            give(station, stubbornly(lambda: station.order("resume", valid_for_s=60.0), outcome), outcome)
        elif state.state == "HELD":
            give(station, stubbornly(lambda: station.order("retry", valid_for_s=60.0), outcome), outcome)
        time.sleep(0.05)


@dataclass(frozen=True)
class Severity:
    """Number of kills of a trial, and their delay after a boot."""

    crashes: tuple[int, int] = (0, 3)
    """Least and greatest number of boots that die at a journal entry."""
    entries: int = ENTRIES
    """Entry of a boot at which it dies at the latest."""
    timers: tuple[int, int] = (0, 2)
    """Least and greatest number of kills at random times."""
    pauses: float = 0.15


USUAL = Severity()
HARSH = Severity(crashes=(4, 8), entries=12, timers=(1, 3), pauses=0.4)


def faults_of(chance: random.Random, severity: Severity) -> list[str]:
    """Crashes at journal entries for the first boots."""
    kinds = [chance.choice(["crash", "crashed"]) for _ in range(chance.randint(*severity.crashes))]
    return [f"{kind}@{chance.randint(1, severity.entries)}" for kind in kinds]


@dataclass(frozen=True)
class Site:
    """Link of robot and station: open, or by mTLS with signed commands."""

    protocol: str = "tcp"
    robot: tuple[str, ...] = ()
    station: Path | None = None


OPEN = Site()


def guarded(folder: Path) -> Site:
    """A site's keys for the robot and for the station that gives the orders."""
    init_site(folder, now=now_utc())
    robot = issue(folder, "robot", "r1", now=now_utc())
    station = issue(folder, "station", "trial", now=now_utc())
    return Site("tls", ("--keys", str(robot.folder)), station.folder)


def trial(seed: int, folder: Path, site: Site = OPEN, severity: Severity = USUAL) -> Outcome:
    """Start, pause and resume until the run is finished, with kills at any time; check what is left of it."""
    chance, outcome = random.Random(seed), Outcome()
    endpoint = f"{site.protocol}/127.0.0.1:{free_port()}"
    with Supervisor(folder, faults_of(chance, severity), endpoint, extra=site.robot) as supervisor:
        timers = [
            threading.Timer(chance.uniform(0.1, 3.0), supervisor.kill)
            for _ in range(chance.randint(*severity.timers))
        ]
        for timer in timers:
            timer.start()
        with reached(endpoint, outcome, keys=site.station) as station:
            stubbornly(lambda: station.push(mission()), outcome)
            begin(station, outcome)
            paused = see_through(station, chance, outcome, pauses=severity.pauses)
        for timer in timers:
            timer.cancel()
        outcome.kills = supervisor.kills
    check(folder, mission(), paused)
    return outcome


def trial_of_a_revision(seed: int, folder: Path) -> Outcome:
    """A revision is pushed during the run; the robot is killed while it waits, or at a journal entry."""
    chance, outcome = random.Random(seed), Outcome()
    at_an_entry = seed % 2 == 1
    faults = [f"{chance.choice(['crash', 'crashed'])}@{chance.randint(10, ENTRIES)}"] if at_an_entry else []
    revised = mission(stops=4, revision=2)
    with (
        Supervisor(folder, faults, speed_up=SPEED_UP / 4) as supervisor,
        reached(supervisor.endpoint, outcome) as station,
    ):
        stubbornly(lambda: station.push(mission()), outcome)
        begin(station, outcome)
        accepted = stubbornly(lambda: station.push(revised), outcome)
        if not at_an_entry:
            assert accepted.waits
            supervisor.kill()
        see_through(station, chance, outcome, pauses=0.0)
        outcome.kills = supervisor.kills
    check(folder, revised, paused=0)
    with open_journal(folder, "r1") as journal:
        events = journal.events()
    for kind in (RevisionWaits, RevisionTaken):
        assert sum(isinstance(event, kind) for event in events) == 1
    assert {event.revision for event in events if isinstance(event, Finished)} == {2}
    return outcome


def check(folder: Path, ran: Mission, paused: int) -> None:
    """Compare the journal with the scanner's record."""
    with open_journal(folder, "r1") as journal:
        events = journal.events()
        stored = journal.missions.read(ran.id, ran.revision)
    stops = [stop.id for stop in ran.stops]
    assert stored is not None
    assert stored[1] == encode(ran)
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert sum(isinstance(event, Started) for event in events) == 1
    assert sum(isinstance(event, Finished) for event in events) == 1
    assert [event.stop for event in events if isinstance(event, Scanned)] == stops
    ordered = [event for event in events if isinstance(event, Paused) and event.reason == "pause by trial"]
    assert len(ordered) == paused
    assert {event.reason for event in events if isinstance(event, Held)} <= {LATE}
    # A boot that died before it could say so leaves no event, but it has scanned nothing either.
    reboots = sum(isinstance(event, Paused) and event.reason == "reboot" for event in events)
    scans = Counter(
        line.split("-")[1] for line in (folder / "scans.log").read_text().splitlines() if "end" in line
    )
    assert set(scans) == set(stops)
    assert sum(scans.values()) - len(stops) <= reboots, "a stop was scanned twice without a reboot in between"


def count(outcomes: list[Outcome]) -> None:
    kills, orders = sum(item.kills for item in outcomes), sum(item.orders for item in outcomes)
    unknown = sum(item.unknown for item in outcomes)
    print(f"{len(outcomes)} trials: {kills} kills, {orders} orders, each given twice; {unknown} unknown")
    assert kills >= len(outcomes) // 2
    assert orders >= len(outcomes)


def test_kills_of_the_robot_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    count([trial(seed, tmp_path / str(seed)) for seed in range(size(short=1, full=300))])


def test_kills_of_a_robot_with_keys_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    site = guarded(tmp_path / "keys")
    count([trial(seed, tmp_path / str(seed), site) for seed in range(1000, 1000 + size(short=1, full=100))])


def test_kills_while_a_revision_waits_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    seeds = range(size(short=1, full=100))
    count([trial_of_a_revision(seed, tmp_path / str(seed)) for seed in seeds])


@pytest.mark.parametrize("at_s", [1.0, 30.0])
@pytest.mark.parametrize("verb", FREE_VERBS)
def test_a_kill_between_any_two_steps_of_a_stop_leaves_a_robot_that_stands(
    tmp_path: Path, verb: Verb, at_s: float
) -> None:
    """While it drives, and while it scans."""
    every = str(size(short=60, full=1))
    command = [sys.executable, "-m", "tests.faults.killed_stop", str(tmp_path), verb, str(at_s), every]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert int(result.stdout.split()[1]) >= size(short=5, full=300)


@pytest.mark.parametrize("seed", range(size(short=1, full=40)))
def test_a_killed_station_leaves_a_robot_that_the_next_one_commands(tmp_path: Path, seed: int) -> None:
    """A station dies while it pushes a large mission; pushing again sends the rest."""
    chance = random.Random(seed)
    large = tmp_path / "mission.json"
    large.write_bytes(encode(corridor(stops=4000)))
    with Supervisor(tmp_path / "state", []) as supervisor:
        command = [sys.executable, "-m", "stopgo", "push", str(large), "--robot", "r1", "--as", "trial"]
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
