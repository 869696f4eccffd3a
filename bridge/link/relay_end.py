"""One end of a relayed connection: a socket that never blocks, with TLS or without."""

from __future__ import annotations

import socket
import ssl

NOTHING_YET = (BlockingIOError, InterruptedError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class RelayEnd:
    """A socket and the data that it has not taken yet; with TLS, a handshake comes first."""

    def __init__(self, connected: socket.socket) -> None:
        connected.setblocking(False)
        self.socket = connected
        self.is_ready = not isinstance(connected, ssl.SSLSocket)
        """True once the handshake is over."""
        self.waiting = b""
        """Data that the socket has not taken."""
        self.events = 0
        """Events for which a selector watches this socket."""

    def shake_hands(self) -> bool:
        """Take the next step of the handshake; true once it is over.

        Raises
        ------
        OSError
            If it fails.
        """
        if isinstance(self.socket, ssl.SSLSocket) and not self.is_ready:
            try:
                self.socket.do_handshake()
            except (ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return False
            self.is_ready = True
        return True

    def receive(self, most: int) -> bytes | None:
        """Return data; nothing at the end of the connection, `None` if there is none at present."""
        try:
            return self.socket.recv(most)
        except NOTHING_YET:
            return None

    def send(self, data: bytes) -> None:
        """Send data after the waiting data; what the socket does not take waits."""
        self.waiting += data
        while self.waiting:
            try:
                sent = self.socket.send(self.waiting)
            except NOTHING_YET:
                return
            self.waiting = self.waiting[sent:]
