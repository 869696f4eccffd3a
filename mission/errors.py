"""Errors that a user may see, each with the exit code of its command.

A message is one line: the object, its value, the problem and the action. The front door prints it.
"""

from __future__ import annotations


class StopgoError(Exception):
    """Base of every error a user may see."""

    exit_code = 2


class InputError(StopgoError):
    """A file, option or document that cannot be used as it is."""

    exit_code = 2


class OtherFloor(InputError):
    """A floor's file on which the mission was not planned."""


class MissingExtra(StopgoError):
    """A command needs an optional part that is not installed."""

    exit_code = 2


class RobotUnreachable(StopgoError):
    """The robot was not reached and nothing was sent to it."""

    exit_code = 2


class NegativeResult(StopgoError):
    """Everything worked, and the result is negative: refused, no candidate, coverage not reached."""

    exit_code = 1

    def __init__(self, message: str = "", *, reason: str | None = None) -> None:
        super().__init__(message)
        self.reason = reason
        """Reason code of the robot's refusal, if it is one of the protocol's."""


AnswerIsNo = NegativeResult
"""Former name of `NegativeResult`, until 0.1; removed with 0.3."""


class Undecided(StopgoError):
    """A question was asked, and the evidence allows neither yes nor no."""

    exit_code = 3


class OutcomeUnknown(StopgoError):
    """A command was sent and no answer came: it may or may not have taken effect."""

    exit_code = 3
