"""An order that comes again gets its old answer; another one under the same id is refused."""

from __future__ import annotations

import msgspec
import pytest

from stopgo.bridge.robot.answers import answer_to, answered, remember_answer
from stopgo.bridge.robot.journal_file import memory_journal
from stopgo.mission.run.run_commands import RunCommand
from stopgo.mission.run.states import Run

START = RunCommand(cmd_id="once", verb="start", commander="alice", issued_ns=1, valid_for_s=5.0)
RUN = Run(state="RUNNING", run_id="r")


def test_the_same_command_gets_the_same_answer() -> None:
    journal = memory_journal()
    assert answered(journal, START, RUN) is None
    answer = answer_to(START, None, RUN)
    remember_answer(journal, START, answer)
    assert answered(journal, START, Run()) == answer


@pytest.mark.parametrize("other", [{"verb": "abort"}, {"commander": "bob"}, {"from_here": True}])
def test_a_command_that_differs_in_anything_is_refused_under_a_used_id(other: dict[str, object]) -> None:
    journal = memory_journal()
    remember_answer(journal, START, answer_to(START, None, RUN))
    again = answered(journal, msgspec.structs.replace(START, **other), RUN)
    assert again is not None and (again.outcome, again.reason) == ("refused", "id_reused")


def test_as_many_answers_are_kept_as_are_to_be_kept() -> None:
    journal = memory_journal()
    orders = [msgspec.structs.replace(START, cmd_id=f"c{n}") for n in range(5)]
    for order in orders:
        remember_answer(journal, order, answer_to(order, None, RUN), keep=3)
    assert [answered(journal, order, RUN) is not None for order in orders] == [False] * 2 + [True] * 3
