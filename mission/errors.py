"""What can go wrong, each with the exit code it ends a command with.

An error's message is one line that names the thing, the value and the way out; the front door prints it.
"""

from __future__ import annotations


class StopgoError(Exception):
    """Base of every error a user may see."""

    exit_code = 2


class InputError(StopgoError):
    """A file, option or document that cannot be used as it is."""

    exit_code = 2


class MissingExtra(StopgoError):
    """A command needs an optional part that is not installed."""

    exit_code = 2


class RobotUnreachable(StopgoError):
    """The robot was never reached and nothing was sent to it."""

    exit_code = 2


class NegativeResult(StopgoError):
    """Everything worked and the answer is no: refused, no candidate, coverage not reached."""

    exit_code = 1

    def __init__(self, message: str = "", *, reason: str | None = None) -> None:
        super().__init__(message)
        self.reason = reason
        """The robot's word for why it refused, if it is one of the protocol's."""


AnswerIsNo = NegativeResult
"""The name of `NegativeResult` until 0.1; goes with 0.3."""


class OutcomeUnknown(StopgoError):
    """Something was sent and no answer came: it may or may not have taken effect."""

    exit_code = 3
