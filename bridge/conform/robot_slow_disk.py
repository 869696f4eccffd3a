"""The requirement that a stop stands before it is stored, on a disk that is made slow for it."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from stopgo.bridge.conform.requirements import NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.link.protocol import encode
from stopgo.mission.run.events import Pose

SLOW_S = 4.0
"""Time that each sync of the robot's disk is made to take."""
BRAKE_S = 2.0
"""Longest time from a pause to a standstill: one second to brake from 0.2 m/s, and one for the link."""
MOVES_M = 0.03
"""Distance that shows that the robot has set out."""
STANDS_M = 0.01
"""Largest difference of two poses at standstill."""
ANSWER_S = 60.0


def a_stop_waits_for_no_disk(bench: RobotBench) -> None:
    """Pause a robot that drives while its disk is slow; it must stand before the pause can be stored."""
    if bench.slow_disk is None:
        raise NotTried("not shown: needs a slow disk: --slow-disk COMMAND")
    bench.missions.store(bench.missions.mission(stops=1))
    bench.wait_for_state("READY")
    start = bench.pose()
    bench.commands.must_execute("start")
    bench.wait(lambda: _apart(bench.pose(), start) > MOVES_M or None, ANSWER_S, "the robot did not set out")
    order = bench.commands.order("pause")
    answers: list[bytes | None] = []

    def pause() -> None:
        answers.append(bench.link.ask(bench.keys.command("pause"), encode(order), timeout_s=ANSWER_S))

    with _slow_disk(bench):
        before, pausing = bench.pose(), threading.Thread(target=pause)
        _must_still_drive(bench, before)
        pausing.start()
        time.sleep(BRAKE_S)
        braked = bench.pose()
        time.sleep(SLOW_S - BRAKE_S - 0.5)
        later, answered_at_once = bench.pose(), any(answers)
        pausing.join()
    if answered_at_once:
        raise NotTried(f"not shown: the disk was not slow: pause answered within {SLOW_S - 0.5:g} s")
    moved = _apart(braked, later)
    must(
        moved < STANDS_M, f"{BRAKE_S:g} s after a pause the robot still drove ({moved:.2f} m) on a slow disk"
    )
    bench.wait_for_state("PAUSED")


@contextmanager
def _slow_disk(bench: RobotBench) -> Iterator[None]:
    """Make the robot's disk slow for the block, and fast again after it."""
    assert bench.slow_disk is not None
    bench.slow_disk(SLOW_S)
    try:
        yield
    finally:
        bench.slow_disk(0.0)


def _must_still_drive(bench: RobotBench, before: Pose) -> None:
    time.sleep(0.3)
    if _apart(before, bench.pose()) < STANDS_M:
        raise NotTried("not shown: the robot had arrived before its disk was slow; make the command faster")


def _apart(one: Pose, other: Pose) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


SLOW_DISK: tuple[Requirement[RobotBench], ...] = (
    Requirement("Commands", "a pause stands before it is stored", a_stop_waits_for_no_disk, drives=True),
)
