"""Commands to an autopilot, and the reason it gives when it refuses one."""

from __future__ import annotations

import time

from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.mavlink.telemetry import is_arming_refusal

COMMAND_S = 3.0
"""Longest wait for the answer to one command."""
TEXT_S = 0.5
"""Longest wait for an explanation (STATUSTEXT) after a refusal."""


def refusal(peer: Peer, command: int, *params: float, what: str) -> str:
    """Send a command; return why it was not accepted, empty if it was.

    `what` names the command in the reason, as in "arming".
    """
    with peer.waiting("STATUSTEXT") as waiting:
        try:
            ack = peer.command(command, *params, patience_s=COMMAND_S)
        except OutcomeUnknown:
            return f"the autopilot did not answer {what}{peer.why_silent()}"
        if ack.accepted:
            return ""
        text = _explanation(waiting)
    return f"the autopilot answered {what} with {ack.name}" + (f' (it said "{text}")' if text else "")


def _explanation(waiting: MessageQueue) -> str:
    """The text that explains a refusal: a complaint, else the last text; either may come late."""
    until_s, text = time.monotonic() + TEXT_S, ""
    while (message := waiting.get(until_s - time.monotonic())) is not None:
        text = message.text
        if is_arming_refusal(text):
            break
    return text
