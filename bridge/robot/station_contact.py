"""Contact of a robot with its commander: the time since the holder of the lease asked or watched.

Only the commander's own messages count against link loss. Others may ask and watch: their messages leave the
robot alone.

Invariants:
- A question counts if it is fresh and its sender is the commander. With keys the sender is the station that
  signed it, without keys the name in it. A question without a name then has no sender.
- A token counts only under the name that its commander gave in such a question, and for `TOKEN_S` after it.
- A new commander begins with its own contact; the former commander's tokens count no more.
- `_lock` guards all fields; the link's threads and the agent's call this class.
- At most `MOST_TOKENS` names are kept.
"""

from __future__ import annotations

import threading

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.link.link import Request

TOKEN_S = 15.0
"""Time that a token counts after its station's last question; one that watches asks every 5 s."""
MOST_TOKENS = 16
"""Tokens of one commander that are kept: of each of its sessions, the newest."""


class StationContact:
    """The commander's tokens, and the time of its last contact."""

    def __init__(self, command_clock: Clock) -> None:
        self._command_clock = command_clock
        self._lock = threading.Lock()
        self._commander: str | None = None
        self._contact_ns = command_clock.now_ns()
        self._asked_ns: dict[str, int] = {}
        """Names of the commander's tokens, and the time of the last question that named each."""

    def on_request(
        self, request: Request, commander: str | None, *, sender: str | None = None, token: str | None = None
    ) -> None:
        """Note a question if `commander` asked it; `sender` is the name in it, `token` that of its token."""
        with self._lock:
            now_ns = self._lasting(commander)
            if commander is None or not request.fresh or _sender(request, sender) != commander:
                return
            self._contact_ns = now_ns
            if token is not None:
                self._asked_ns.pop(token, None)
                self._asked_ns[token] = now_ns
                while len(self._asked_ns) > MOST_TOKENS:
                    del self._asked_ns[next(iter(self._asked_ns))]

    def on_presence(self, token: str, alive: bool) -> None:
        """End the session of a token that has disappeared; one that appears is nobody's until it is named."""
        with self._lock:
            if not alive and token in self._asked_ns:
                self._lasting(self._commander)
                del self._asked_ns[token]

    def silent_s(self, commander: str | None) -> float:
        """Return the seconds since `commander`, the holder of the lease, last watched or asked."""
        with self._lock:
            return (self._lasting(commander) - self._contact_ns) / 1e9

    def _lasting(self, commander: str | None) -> int:
        """Extend the contact while a token counts, and return the present time (ns)."""
        now_ns = self._command_clock.now_ns()
        if commander != self._commander:
            self._commander, self._contact_ns = commander, now_ns
            self._asked_ns.clear()
        until_ns = max(self._asked_ns.values(), default=self._contact_ns - round(TOKEN_S * 1e9))
        self._contact_ns = max(self._contact_ns, min(now_ns, until_ns + round(TOKEN_S * 1e9)))
        return now_ns


def _sender(request: Request, sender: str | None) -> str | None:
    """Return the station that sent a question; `None` if that is not known, or it is no station."""
    holder = request.holder
    if holder is None:
        return sender
    return holder.name if holder.role == "station" and sender in (None, holder.name) else None
