"""Requirements on the state that outlives a restart of the robot's program."""

from __future__ import annotations

from stopgo.bridge.conform.command_requirements import ready
from stopgo.bridge.conform.requirements import Nonconforming, NotTried, Requirement, must
from stopgo.bridge.conform.robot_bench import RobotBench
from stopgo.bridge.link.protocol import Info, encode

BOOT_S = 60.0
"""Longest time until a restarted robot answers again."""


def _restarted(bench: RobotBench) -> Info:
    """Restart the robot, and return its info after that."""
    if bench.restart is None:
        raise NotTried("needs a restart of the robot: --restart COMMAND, or a person at a terminal")
    before = bench.info().boot_id
    bench.restart()

    def back() -> Info | None:
        try:
            info = bench.info()
        except Nonconforming:
            return None
        return info if info.boot_id != before else None

    return bench.wait(back, BOOT_S, "the robot did not come back with a new boot_id")


def a_boot_has_an_id_of_its_own(bench: RobotBench) -> None:
    ready(bench)
    before = bench.info()
    after = _restarted(bench)
    told = after.state.state, after.state.mission_id, after.state.revision
    must(told == ("READY", before.state.mission_id, before.state.revision), f"after a restart it is {told}")
    must(after.state.last_event >= before.state.last_event, "after a restart events are missing")
    must(after.lease == before.lease, "after a restart the lease is another")


def answers_outlive_a_restart(bench: RobotBench) -> None:
    ready(bench)
    order, key = bench.commands.order("skip"), bench.keys.command("skip")
    first = bench.ask_raw(key, encode(order))
    late = bench.commands.order("skip")
    _restarted(bench)
    must(bench.ask_raw(key, encode(order)) == first, "the same command after a restart got another answer")
    bench.commands.must_refuse(late, "expired")


def a_run_waits_after_a_restart(bench: RobotBench) -> None:
    ready(bench)
    answer = bench.commands.must_execute("start")
    after = _restarted(bench)
    must(after.state.state == "PAUSED", f"restarted during a run it is {after.state.state}")
    must(after.state.run_id == answer.run_id, "restarted during a run it reports another run")


RESTARTS: tuple[Requirement[RobotBench], ...] = (
    Requirement("Events", "a boot has an id; mission, lease, events outlive it", a_boot_has_an_id_of_its_own,
                needed=True),
    Requirement("Commands", "answers outlive a restart; commands of the boot before do not",
                answers_outlive_a_restart, needed=True),
    Requirement("States of a run", "nothing moves by itself after a restart: PAUSED",
                a_run_waits_after_a_restart, drives=True),
)  # fmt: skip
