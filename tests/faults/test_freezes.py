"""A robot's process is frozen and thawed (SIGSTOP, SIGCONT), for shorter and longer than a link lives."""

from __future__ import annotations

import random
import signal
import threading
from pathlib import Path

from tests.faults.sizes import size
from tests.faults.test_kill import (
    SPEED_UP,
    USUAL,
    Outcome,
    Supervisor,
    begin,
    check,
    mission,
    reached,
    see_through,
    stubbornly,
)

LONGEST_S = 5.0
"""A link that is silent for 2 s is closed."""


class Freezing:
    """Freezes a robot's process now and then until it is left; the process is thawed then."""

    def __init__(self, supervisor: Supervisor, chance: random.Random) -> None:
        self._supervisor = supervisor
        self._times = [(chance.uniform(0.1, 1.5), chance.uniform(0.05, LONGEST_S)) for _ in range(3)]
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._freeze)
        self.freezes = 0

    def __enter__(self) -> Freezing:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._over.set()
        self._thread.join()

    def _freeze(self) -> None:
        for after_s, frozen_s in self._times:
            if self._over.wait(after_s):
                return
            self._supervisor.robot.send_signal(signal.SIGSTOP)
            self.freezes += 1
            self._over.wait(frozen_s)
            self._supervisor.robot.send_signal(signal.SIGCONT)


def trial_of_freezes(seed: int, folder: Path) -> tuple[Outcome, int]:
    chance, outcome = random.Random(seed), Outcome()
    with (
        Supervisor(folder, [], speed_up=SPEED_UP / 4) as supervisor,
        Freezing(supervisor, chance) as freezing,
        reached(supervisor.endpoint, outcome, timeout_s=20.0) as station,
    ):
        stubbornly(lambda: station.push(mission()), outcome)
        begin(station, outcome)
        paused = see_through(station, chance, outcome, pauses=USUAL.pauses)
    assert supervisor.kills == 0
    check(folder, mission(), paused)
    return outcome, freezing.freezes


def test_freezes_of_the_robot_lose_nothing_and_repeat_nothing(tmp_path: Path) -> None:
    seeds = range(2000, 2000 + size(short=1, full=100))
    outcomes = [trial_of_freezes(seed, tmp_path / str(seed)) for seed in seeds]
    freezes, orders = sum(frozen for _, frozen in outcomes), sum(one.orders for one, _ in outcomes)
    print(f"{len(outcomes)} trials: {freezes} freezes, {orders} orders, each given twice")
    assert freezes >= len(outcomes)
