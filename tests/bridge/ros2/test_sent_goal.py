"""Status of a goal by its server's answers, and by what the server publishes when answers are lost."""

from __future__ import annotations

from dataclasses import dataclass

from stopgo.bridge.ros2.sent_goal import SentGoal

EXECUTING, CANCELING, SUCCEEDED = 2, 3, 4


@dataclass
class Result:
    UNKNOWN = 100
    error_code: int = 0
    error_msg: str = ""


def sent() -> tuple[SentGoal, list[str]]:
    cancelled: list[str] = []
    return SentGoal(lambda: cancelled.append("cancel")), cancelled


def test_a_result_names_its_error() -> None:
    goal, _ = sent()
    goal.accepted(True)
    goal.ended(6, Result(100, "no path"))
    assert (goal.status, goal.detail) == ("aborted", "UNKNOWN no path")


def test_a_goal_that_was_given_up_before_its_answer_is_cancelled_by_it() -> None:
    goal, cancelled = sent()
    goal.drop()
    assert cancelled == []
    goal.accepted(True)
    assert cancelled == ["cancel"]


def test_a_goal_whose_answer_was_lost_follows_the_published_status() -> None:
    goal, cancelled = sent()
    goal.told(EXECUTING)
    assert (goal.status, cancelled) == ("active", [])
    goal.told(SUCCEEDED)
    assert goal.status == "succeeded"


def test_a_goal_whose_answer_was_lost_and_that_was_given_up_is_cancelled_once_it_drives() -> None:
    goal, cancelled = sent()
    goal.drop()
    goal.told(EXECUTING)
    goal.told(CANCELING)
    assert cancelled == ["cancel"]


def test_an_answered_goal_ends_with_its_result_which_names_the_error() -> None:
    goal, _ = sent()
    goal.accepted(True)
    goal.told(SUCCEEDED)
    assert goal.status == "active"
