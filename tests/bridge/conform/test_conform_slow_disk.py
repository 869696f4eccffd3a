"""The kit shows whether a pause stands before it is stored, on a disk that is made slow."""

from __future__ import annotations

import pytest

from stopgo.bridge.conform.conform_robot import slowing
from stopgo.bridge.conform.requirements import ConformVerdict, tried
from stopgo.bridge.conform.robot_slow_disk import SLOW_DISK
from stopgo.bridge.robot.controller import Controller
from stopgo.mission.errors import InputError
from stopgo.mission.run.run_commands import Answer, RunCommand
from tests.bridge.conform.robot_under_test import RobotUnderTest, booted

pytestmark = pytest.mark.usefixtures("own_time")


def verdict(robot: RobotUnderTest, *, offers_slow_disk: bool = True) -> ConformVerdict:
    with booted(robot):
        bench = robot.bench()
        bench.slow_disk = bench.slow_disk if offers_slow_disk else None
        return next(iter(tried(SLOW_DISK, bench, drive=True)))


class StoresFirst(Controller):
    """Stores a byte before it stops the base."""

    def execute(self, order: RunCommand) -> Answer:
        if order.verb == "pause":
            self._store.journal.store_nonce(order.cmd_id, "")
        return super().execute(order)


class RobotThatStoresFirst(RobotUnderTest):
    controller = StoresFirst


class RobotWithAFastDisk(RobotUnderTest):
    def slow_disk(self, seconds: float) -> None:
        pass


def test_our_own_robot_stands_before_it_stores() -> None:
    assert verdict(RobotUnderTest()).outcome == "passed"


def test_a_robot_that_stores_a_stop_first_is_found() -> None:
    found = verdict(RobotThatStoresFirst())
    assert (found.outcome, "still drove" in found.reason) == ("failed", True)


def test_a_disk_that_was_not_slow_shows_nothing() -> None:
    found = verdict(RobotWithAFastDisk())
    assert (found.outcome, "the disk was not slow" in found.reason) == ("not tried", True)


def test_without_a_slow_disk_nothing_is_shown() -> None:
    found = verdict(RobotUnderTest(), offers_slow_disk=False)
    assert (found.outcome, "--slow-disk" in found.reason) == ("not tried", True)


@pytest.mark.parametrize("command", ["'", "no-such-program-here", "false"])
def test_a_command_that_cannot_be_run_is_named(command: str) -> None:
    with pytest.raises(InputError, match="--slow-disk"):
        slowing(command)(1.0)
