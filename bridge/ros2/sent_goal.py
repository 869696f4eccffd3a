"""Goals and calls that were sent; the node's thread changes what is known of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from stopgo.bridge.ros2.ros_port import GoalStatus
from stopgo.bridge.ros2.ros_types import plain_fields

ENDED: dict[int, GoalStatus] = {4: "succeeded", 5: "canceled", 6: "aborted"}
"""Final values of action_msgs/msg/GoalStatus."""
ACTIVE = (1, 2, 3)
CANCELING = 3


class SentGoal:
    """A goal of an action that drives (`RosGoal`)."""

    def __init__(self, cancel: Callable[[], None]) -> None:
        """`cancel` asks the server to cancel it, and waits for nothing."""
        self.status: GoalStatus = "sent"
        self.detail = ""
        self._cancel = cancel
        self._dropped = False
        self._answered = False

    def accepted(self, yes: bool) -> None:
        """Take the server's answer to the goal."""
        self._answered = True
        if self.status == "sent":
            self.status = "active" if yes else "rejected"
        if self._dropped and self.status == "active":
            self._cancel()

    def ended(self, status: int, result: Any) -> None:
        self.detail = error_text(result)
        self.status = ENDED.get(status, "aborted")

    def told(self, status: int) -> None:
        """Take a status that the server has published; it may be all that is known if an answer was lost."""
        if status in ACTIVE:
            self.status = "active" if self.status == "sent" else self.status
            if self._dropped and status != CANCELING:
                self._cancel()
        elif status in ENDED and not self._answered:
            self.status = ENDED[status]

    def drop(self) -> None:
        self._dropped = True
        if self.status == "active":
            self._cancel()


class SentCall:
    """A call of the scanner's service or action (`RosCall`)."""

    def __init__(self, cancel: Callable[[], None] = lambda: None) -> None:
        self.fields: Mapping[str, Any] | None = None
        self.error = ""
        self._cancel = cancel
        self._accepted = False
        self._dropped = False

    def answered(self, response: Any) -> None:
        """Take the response of a service; with `None` the call has no end that is known."""
        if response is not None:
            self.fields = plain_fields(response)

    def accepted(self, yes: bool) -> None:
        """Take the answer of an action's server to the goal."""
        self._accepted = yes
        if not yes:
            self.error = "the action server has rejected the goal"
        elif self._dropped:
            self._cancel()

    def ended(self, status: int, result: Any) -> None:
        words = ENDED.get(status, "aborted")
        if words == "succeeded":
            self.fields = plain_fields(result)
        else:
            self.error = f"{words}{f': {error_text(result)}' if error_text(result) else ''}"

    def drop(self) -> None:
        self._dropped = True
        if self._accepted and self.fields is None:
            self._cancel()


def error_text(result: Any) -> str:
    """Return the error code and message of an action's result in words; empty if it names none."""
    code, message = getattr(result, "error_code", 0), getattr(result, "error_msg", "")
    names = [name for name in dir(result) if name.isupper() and getattr(result, name) == code]
    return " ".join(filter(None, [names[0] if code and names else "", str(message)]))
