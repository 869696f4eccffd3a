"""Tells the person at the robot, or its service's log, of everything that was refused, and to whom."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import datetime

from stopgo.bridge.link.protocol import Rejected, Reply
from stopgo.mission.run.orders import Answer

AGAIN_S = 60.0
"""The same refusal is told so often at most, with how often it was given: a log must not fill a disk."""
MOST_KINDS = 1000


class RefusalLog:
    """Says each refusal once a minute, in a line with its time."""

    def __init__(self, say: Callable[[str], None], now: Callable[[], datetime]) -> None:
        self._say = say
        self._now = now
        self._lock = threading.Lock()
        self._told: dict[str, tuple[datetime, int]] = {}

    def note(self, what: str, who: str, why: str) -> None:
        """`what` was refused to `who`."""
        line = f"refused {what} by {who}: {why}"
        with self._lock:
            now = self._now()
            since, unsaid = self._told.get(line, (None, 0))
            if since is not None and (now - since).total_seconds() < AGAIN_S:
                self._told[line] = (since, unsaid + 1)
                return
            if len(self._told) >= MOST_KINDS:
                self._told.clear()
            self._told[line] = (now, 0)
        again = f" ({unsaid} times more since {since:%H:%M:%S})" if since is not None and unsaid else ""
        self._say(f"{now:%Y-%m-%d %H:%M:%S} UTC {line}{again}")

    def note_reply(self, what: str, who: str, reply: Reply) -> None:
        """The same of what was answered, if that is a refusal."""
        if isinstance(reply, Rejected):
            self.note(what, who, f"{reply.reason}: {'; '.join(reply.messages)[:200]}")
        elif isinstance(reply, Answer) and reply.outcome == "refused":
            self.note(what, who, f"{reply.reason}: {reply.message}")
