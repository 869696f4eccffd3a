"""Verdicts of the guard on a program's signs of life."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from queue import Queue

import pytest

from stopgo.bridge.ros2.goal_guard import DRIVES, ENDED, SILENT_S, STANDS, GoalGuard, Signs

LAST_RESORT_S = 60.0


def test_a_program_that_ends_while_it_drives_is_stopped_once() -> None:
    signs = Signs(0.0)
    signs.take(STANDS + DRIVES, 1.0)
    assert not signs.must_stop(1.0)
    signs.take(b"", 1.1)
    assert signs.must_stop(1.1)
    assert not signs.must_stop(1.2)


def test_a_program_that_hangs_while_it_drives_is_stopped() -> None:
    signs = Signs(0.0)
    signs.take(DRIVES, 1.0)
    assert not signs.must_stop(1.0 + SILENT_S)
    assert signs.must_stop(1.1 + SILENT_S)


def test_a_program_that_stands_may_end_or_hang() -> None:
    signs = Signs(0.0)
    signs.take(DRIVES + STANDS, 1.0)
    assert not signs.must_stop(9.0)
    signs.take(b"", 9.0)
    assert signs.ended and not signs.must_stop(9.1)


def test_nothing_drives_before_the_guard_is_ready(tmp_path: Path) -> None:
    reports: Queue[str] = Queue()
    mark = tmp_path / "ready"
    guard = GoalGuard(
        {"marks": str(mark)}, lambda: True, reports.put, module="tests.bridge.ros2.idle_guard"
    )  # fmt: skip
    try:
        assert mark.exists() and reports.empty()
    finally:
        guard.close()


def assert_replaced(guard: GoalGuard, first: int, reports: Queue[str]) -> None:
    """The end of the first process is reported, and then that another one is ready."""
    assert reports.get(timeout=LAST_RESORT_S) == ENDED
    while reports.get(timeout=LAST_RESORT_S):
        pass
    assert guard.pid != first


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_guard_that_was_killed_or_frozen_is_reported_and_replaced(how: signal.Signals) -> None:
    reports: Queue[str] = Queue()
    guard = GoalGuard({}, lambda: True, reports.put, module="tests.bridge.ros2.idle_guard")
    try:
        first = guard.pid
        os.kill(first, how)
        assert_replaced(guard, first, reports)
    finally:
        guard.close()


def test_a_guard_that_cannot_be_started_again_at_once_is_started_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    reports: Queue[str] = Queue()
    guard = GoalGuard({}, lambda: True, reports.put, module="tests.bridge.ros2.idle_guard")
    first, started = guard.pid, GoalGuard._started

    def scarce(self: GoalGuard) -> None:
        monkeypatch.setattr(GoalGuard, "_started", started)
        raise OSError(24, "Too many open files")

    try:
        monkeypatch.setattr(GoalGuard, "_started", scarce)
        os.kill(first, signal.SIGKILL)
        assert_replaced(guard, first, reports)
    finally:
        guard.close()


def test_a_guard_that_is_frozen_does_not_keep_the_program_from_its_end() -> None:
    guard = GoalGuard({}, lambda: False, lambda why: None, module="tests.bridge.ros2.idle_guard")
    os.kill(guard.pid, signal.SIGSTOP)
    guard.close()
    with pytest.raises(ProcessLookupError):
        os.kill(guard.pid, 0)
