"""Log of refusals, for the person at the robot or its service's log."""

from __future__ import annotations

import threading
from collections.abc import Callable
from datetime import datetime

from stopgo.bridge.link.protocol import Rejected, Reply
from stopgo.mission.run.orders import Answer

AGAIN_S = 60.0
"""Interval at which a repeated refusal is printed again, with its count: a log must not fill a disk."""
MOST_KINDS = 1000


class RefusalLog:
    """Prints each refusal at most once a minute, in a line with its time."""

    def __init__(self, say: Callable[[str], None], now: Callable[[], datetime]) -> None:
        self._say = say
        self._now = now
        self._lock = threading.Lock()
        self._printed: dict[str, tuple[datetime, int]] = {}

    def note(self, what: str, who: str, why: str) -> None:
        """Print that `what` was refused to `who`, and why."""
        line = f"refused {what} by {who}: {why}"
        with self._lock:
            now = self._now()
            since, unprinted = self._printed.get(line, (None, 0))
            if since is not None and (now - since).total_seconds() < AGAIN_S:
                self._printed[line] = (since, unprinted + 1)
                return
            if len(self._printed) >= MOST_KINDS:
                self._printed.clear()
            self._printed[line] = (now, 0)
        again = f" ({unprinted} times more since {since:%H:%M:%S})" if since is not None and unprinted else ""
        self._say(f"{now:%Y-%m-%d %H:%M:%S} UTC {line}{again}")

    def note_reply(self, what: str, who: str, reply: Reply) -> None:
        """Do the same for a reply, if it is a refusal."""
        if isinstance(reply, Rejected):
            self.note(what, who, f"{reply.reason}: {'; '.join(reply.messages)[:200]}")
        elif isinstance(reply, Answer) and reply.outcome == "refused":
            self.note(what, who, f"{reply.reason}: {reply.message}")
