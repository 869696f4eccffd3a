"""Connections of pages: idle ones make room, so that a STOP is answered however many there are."""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 128
"""Connections, requests and streams at the same time; above them requests are refused."""
SPARE = 16
"""Connections that are kept free for new ones."""
FIRST_REQUEST_S = 10.0
"""Longest wait for a connection's first request."""


class PageConnection(H11Protocol):
    """A connection that is closed if it asks nothing, for long or while others wait.

    Anyone who reaches the port can open connections before signing in. A page whose idle connection is closed
    opens another.
    """

    _opened = 0

    def connection_made(self, transport: Any) -> None:
        """Take a connection, and close the oldest idle one if there are too many."""
        super().connection_made(transport)
        PageConnection._opened += 1
        self._number = PageConnection._opened
        self.loop.call_later(FIRST_REQUEST_S, self._close_unused)
        if len(self.connections) > MOST_CONNECTIONS - SPARE:
            idle = [one for one in self.connections if one is not self and _is_idle(one)]
            if idle:
                oldest = min(idle, key=_use_and_age)
                oldest.transport.close()
                self.connections.discard(oldest)

    def _close_unused(self) -> None:
        """Close the connection if its first request has not come."""
        if self.cycle is None and not self.transport.is_closing():
            self.transport.close()


def _is_idle(one: Any) -> bool:
    """Return True if no request of a connection is being answered."""
    return one.cycle is None or one.cycle.response_complete


def _use_and_age(one: Any) -> tuple[bool, int]:
    """Return a key by which connections that never asked come first, the oldest of them first."""
    return one.cycle is not None, one._number
