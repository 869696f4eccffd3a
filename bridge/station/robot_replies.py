"""Decoding of a robot's answers: the expected message, a rejection, or an unknown message."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import msgspec

from stopgo.bridge.link.protocol import LogPage, Malformed, Rejected, Reply, decode
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import AnyEvent
from stopgo.mission.run.run_commands import Answer, RunCommand

M = TypeVar("M")


class PastEvents(NamedTuple):
    """Events of a page of the journal, and the number of the newest of all."""

    events: tuple[AnyEvent, ...]
    newest: int


def read_reply(reply: bytes, kind: type[M], *, robot: str, what: str) -> M:
    """Decode an answer of type `kind`.

    Raises
    ------
    NegativeResult
        If the robot rejected the request, or could not read it.
    OutcomeUnknown
        If the answer cannot be decoded, or is one to another request.
    """
    try:
        message: Reply = decode(reply, Reply)  # type: ignore[arg-type]
    except msgspec.DecodeError as error:
        raise _unknown(robot, what, str(error)) from None
    if isinstance(message, Rejected):
        why = f"{message.reason}: {'; '.join(message.messages)}"
        raise NegativeResult(f"{robot} rejected {what}: {why}", reason=message.reason)
    if isinstance(message, Malformed):
        raise NegativeResult(f"{robot}: request not understood ({what}): {message.message}")
    if not isinstance(message, kind):
        raise OutcomeUnknown(
            f"{robot}: {type(message).__name__} is no answer to {what}, its outcome is unknown;"
            " see stopgo status"
        )
    return message


def read_answer(reply: bytes, order: RunCommand, *, robot: str) -> Answer:
    """Decode the answer to a command; raises the errors of `read_reply`, also for that to another command."""
    answer = read_reply(reply, Answer, robot=robot, what=order.verb)
    if (answer.cmd_id, answer.verb) != (order.cmd_id, order.verb):
        raise OutcomeUnknown(
            f"{robot}: the answer is to another command ({answer.verb} {answer.cmd_id[:12]}), the outcome of"
            f" {order.verb} is unknown; see stopgo status"
        )
    return answer


def read_events(reply: bytes, *, since: int, robot: str) -> PastEvents:
    """Decode a page of events, numbered upwards from above `since`; raises the errors of `read_reply`."""
    page = read_reply(reply, LogPage, robot=robot, what="reading its log")
    try:
        events = page.events
    except msgspec.DecodeError as error:
        raise _unknown(robot, "reading its log", str(error)) from None
    for event in events:
        if event.number <= since:
            raise _unknown(robot, "reading its log", f"event {event.number} after {since}")
        since = event.number
    return PastEvents(events, page.newest)


def _unknown(robot: str, what: str, why: str) -> OutcomeUnknown:
    return OutcomeUnknown(f"{robot}: unknown answer ({what}: {why}); update the older stopgo")
