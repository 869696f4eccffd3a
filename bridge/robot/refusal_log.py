"""Log lines for the person at the robot or its service's log, bounded whatever strangers send.

Their words are in the lines, so a line that is new proves nothing. The log therefore has a bound in bytes for
each line, a number of lines for each minute, and a number of lines that it remembers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from datetime import datetime

from stopgo.bridge.link.protocol import Rejected, Reply
from stopgo.mission.run.run_commands import Answer

AGAIN_S = 60.0
"""Interval at which a repeated refusal is printed again, with its count: a log must not fill a disk."""
LINE_BYTES = 400
"""Longest line, in UTF-8."""
LINES_A_MINUTE = 10
"""Most lines a minute: 6 MB a day at most."""


class RefusalLog:
    """Prints each refusal at most once a minute, in a line with its time; in all a few lines a minute."""

    def __init__(self, say: Callable[[str], None], now: Callable[[], datetime]) -> None:
        self._say = say
        self._now = now
        self._lock = threading.Lock()
        self._printed: dict[str, tuple[datetime, int]] = {}
        self._minute: datetime | None = None
        self._lines = 0
        self._left_out = 0

    @property
    def remembered(self) -> int:
        """Number of lines in memory."""
        return len(self._printed)

    def note(self, what: str, who: str, why: str) -> None:
        """Print that `what` was refused to `who`, and why."""
        self.tell(f"refused {what} by {who}: {why}")

    def tell(self, line: str) -> None:
        """Print a line with its time, unless it was printed a moment ago, or too many were."""
        line = _cut(line)
        with self._lock:
            lines = list(self._due(line, self._now()))
        for due in lines:
            self._say(due)

    def _due(self, line: str, now: datetime) -> Iterator[str]:
        """Yield the lines to print: how many were left out, and this one."""
        stamp = f"{now:%Y-%m-%d %H:%M:%S} UTC"
        if self._minute is None or not _is_recent(self._minute, now):
            if self._left_out and self._minute is not None:
                yield f"{stamp} {self._left_out} further lines since {self._minute:%H:%M:%S} were not printed"
            self._minute, self._lines, self._left_out = now, 0, 0
            self._forget(now)
        since, unprinted = self._printed.get(line, (None, 0))
        if since is not None and _is_recent(since, now):
            self._printed[line] = (since, unprinted + 1)
        elif self._lines >= LINES_A_MINUTE:
            self._left_out += 1
        else:
            self._lines += 1
            self._printed[line] = (now, 0)
            times = f" ({unprinted} times more since {since:%H:%M:%S})" if since and unprinted else ""
            yield f"{stamp} {line}{times}"

    def _forget(self, now: datetime) -> None:
        """Forget lines that were not printed in the last two minutes; so at most a few remain."""
        for line, (since, _) in list(self._printed.items()):
            if not _is_recent(since, now, 2 * AGAIN_S):
                del self._printed[line]

    def note_reply(self, what: str, who: str, reply: Reply) -> None:
        """Do the same for a reply, if it is a refusal."""
        if isinstance(reply, Rejected):
            self.note(what, who, f"{reply.reason}: {'; '.join(reply.messages)[:200]}")
        elif isinstance(reply, Answer) and reply.outcome == "refused":
            self.note(what, who, f"{reply.reason}: {reply.message}")


def _is_recent(since: datetime, now: datetime, within_s: float = AGAIN_S) -> bool:
    """True if `since` is a moment ago; a date that was set back makes nothing recent."""
    return 0 <= (now - since).total_seconds() < within_s


def _cut(line: str) -> str:
    """Return the line, cut to its longest size."""
    encoded = line.encode(errors="replace")
    if len(encoded) <= LINE_BYTES:
        return line
    return encoded[:LINE_BYTES].decode(errors="ignore") + "…"
