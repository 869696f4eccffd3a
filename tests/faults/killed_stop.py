"""Kills a robot between every two steps of a stop: before each line of the robot's own code that it runs.

Run as a process of its own, for it forks: python -m tests.faults.killed_stop FOLDER VERB AT_S EVERY. Each
child pushes and starts a mission, and kills itself at one line of the stop that comes after AT_S seconds: 1
while the robot drives, 30 while it scans. Its journal is then booted and judged.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from stopgo.bridge.robot.journal import Journal
from stopgo.bridge.robot.journal_file import open_journal
from stopgo.mission.run.events import Aborted, Finished, Paused
from stopgo.mission.run.run_commands import RunCommand, Verb
from tests.bridge.world import Field, corridor

ROBOT = f"{os.sep}bridge{os.sep}robot{os.sep}"


def main(folder: Path, verb: Verb, at_s: float, every: int) -> None:
    lines = stopped(folder / "undisturbed", verb, at_s, 0)
    killed = range(1, lines + 1, every)
    for step in killed:
        state = folder / f"{verb}-{step}"
        child = os.fork()
        if child == 0:
            stopped(state, verb, at_s, step)
            os._exit(0)  # the kill comes first, else the next line fails
        _, status = os.waitpid(child, 0)
        assert os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL, (step, status)
        judge(state, verb, step)
    print(verb, len(killed), lines)


def stopped(state: Path, verb: Verb, at_s: float, step: int) -> int:
    """Stop a robot, and kill this process before line `step` of that; return the number of lines."""
    with open_journal(state, "r1") as journal:
        field = driving(journal)
        order, lines = stop_order(field, verb), 0

        def traced(frame: FrameType, event: str, argument: object) -> Callable[..., Any] | None:
            nonlocal lines
            if ROBOT not in frame.f_code.co_filename:
                return None
            if event == "line":
                lines += 1
                if lines == step:
                    os.kill(os.getpid(), signal.SIGKILL)
            return traced

        def stop() -> None:
            sys.settrace(traced)
            field.controller.execute(order)
            sys.settrace(None)

        field.clock.at(at_s, stop)
        field.work()
    return lines


def driving(journal: Journal) -> Field:
    """A robot that has started a mission."""
    field = Field(journal=journal)
    field.station().push(corridor(stops=2))
    field.order("start")
    return field


def stop_order(field: Field, verb: Verb) -> RunCommand:
    return field.command(verb, cmd_id="stop", issued_ns=0)


def judge(state: Path, verb: Verb, step: int) -> None:
    """Boot the robot with what is left: it stands, and the stop takes effect once though it is sent again."""
    with open_journal(state, "r1") as journal:
        field = Field(journal=journal)
        assert field.work() == 0, step
        answer = field.controller.execute(stop_order(field, verb))
        assert field.controller.execute(stop_order(field, verb)) == answer, step
        events = journal.events()
        assert [event.number for event in events] == list(range(1, len(events) + 1)), step
        paused = sum(isinstance(event, Paused) and event.reason == "pause by test" for event in events)
        aborted = sum(isinstance(event, Aborted) for event in events)
        if verb == "abort":
            assert (field.controller.run.state, answer.outcome, aborted) == ("ABORTED", "ok", 1), step
            return
        # A stop that was not stored finds a robot that its reboot has paused.
        assert (field.controller.run.state, paused) == ("PAUSED", answer.outcome == "ok"), step
        assert answer.reason in (None, "wrong_state"), step
        assert field.order("resume", cmd_id="after").outcome == "ok", step
        field.work()
        assert sum(isinstance(event, Finished) for event in journal.events()) == 1, step


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]), int(sys.argv[4]))  # type: ignore[arg-type]
