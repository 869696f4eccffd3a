"""Bytes in and out of UDP sockets, TCP streams and serial ports, for `wire` and `tunnel`.

A transport that was opened never fails afterwards. While it is disconnected (refused, closed by the other
end, unplugged) it returns no data, gives the reason in `disconnected`, and reconnects by itself. Whoever
waits for an answer decides what missing data mean.

One thread reads, any may write. If a connection breaks under a writer, the reader closes it: a reader that
waits on a closed connection would fail in other ways.
"""

from __future__ import annotations

import contextlib
import select
import socket
import time
from collections.abc import Callable
from typing import Any, Protocol

from stopgo.bridge.mavlink.vehicle_link.url import Url, UrlKind
from stopgo.mission.errors import InputError, RobotUnreachable

Address = Any
"""A sender: an IP address and port, or a serial port; hashable."""

End = tuple[int, Address | None]
"""A descriptor, and the address to send to; `None` if the descriptor itself leads there."""
READ_BYTES = 65536
BUFFER_BYTES = 4 * 1024 * 1024
"""Buffer requested from the system for datagrams: a burst of telemetry should not be lost here."""
MAX_PEERS = 16
"""Number of latest senders that a listening end remembers."""
CONNECT_S = 5.0
RETRY_S = 0.5


class Transport(Protocol):
    datagrams: bool
    """True if each chunk read holds whole frames."""
    disconnected: str
    """Reason why it is disconnected; empty if it is connected."""

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Chunks of data with their senders; empty when the time is up."""

    def write(self, data: bytes, to: Address | None = None) -> None:
        """Send to one known sender, or to all of them."""

    def ends(self, to: Address | None = None) -> list[End]:
        """Descriptors by which another process may write to that sender, or to all of them."""

    def close(self) -> None: ...


def open_transport(url: Url) -> Transport:
    """The transport that `url` names.

    Raises
    ------
    InputError
        If an address or device cannot be opened here.
    RobotUnreachable
        If a TCP peer does not accept the connection; nothing was sent.
    """
    return OPENING[url.kind](url)


class UdpOut:
    """Sends to one address, and receives only from it."""

    datagrams = True

    def __init__(self, url: Url) -> None:
        self.disconnected = ""
        self._peer = (url.host, url.number)
        self._socket = _datagrams(url)
        try:
            self._socket.connect(self._peer)
        except OSError as error:
            self._socket.close()
            raise InputError(f"{url}: cannot be reached ({error.strerror or error})") from None

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        if not _ready(self._socket, timeout_s):
            return []
        try:
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:  # what was ready was an error, and a writer has met it
            return []
        except OSError as error:
            self.disconnected = _why(error)
            return []
        self.disconnected = ""
        return [(self._peer, data)]

    def write(self, data: bytes, to: Address | None = None) -> None:
        try:
            self._socket.send(data)
        except BlockingIOError:  # there is no room: it is lost, as on any link
            pass
        except OSError as error:
            self.disconnected = _why(error)

    def ends(self, to: Address | None = None) -> list[End]:
        return [(self._socket.fileno(), None)]

    def close(self) -> None:
        self._socket.close()


class UdpIn:
    """Receives from everyone on a port, and sends to those senders."""

    datagrams = True

    def __init__(self, url: Url) -> None:
        self.disconnected = ""
        self._peers: dict[Address, None] = {}
        self._socket = _datagrams(url)
        _bind(self._socket, url)

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        if not _ready(self._socket, timeout_s):
            return []
        try:
            data, peer = self._socket.recvfrom(READ_BYTES)
        except OSError:  # an earlier datagram came back refused, or the network went down
            return []
        self._peers.pop(peer, None)
        self._peers[peer] = None
        if len(self._peers) > MAX_PEERS:
            del self._peers[next(iter(self._peers))]
        return [(peer, data)]

    def write(self, data: bytes, to: Address | None = None) -> None:
        for peer in list(self._peers) if to is None else [to]:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, peer)

    def ends(self, to: Address | None = None) -> list[End]:
        return [(self._socket.fileno(), peer) for peer in (list(self._peers) if to is None else [to])]

    def close(self) -> None:
        self._socket.close()


class TcpOut:
    """A connection to one address, made again whenever it is lost."""

    datagrams = False

    def __init__(self, url: Url) -> None:
        self.disconnected = ""
        self._peer = (url.host, url.number)
        self._tried = time.monotonic()
        try:
            self._socket: socket.socket | None = self._connected()
        except OSError as error:
            raise RobotUnreachable(
                f"{url}: no connection ({error.strerror or error}); nothing was sent. Is it running?"
            ) from None

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        if self._socket is None:
            self._reconnect(timeout_s)
            return []
        try:
            data = self._socket.recv(READ_BYTES) if _ready(self._socket, timeout_s) else None
        except OSError:
            data = b""
        if data == b"":
            self._lose("the other end closed the connection")
        return [(self._peer, data)] if data else []

    def write(self, data: bytes, to: Address | None = None) -> None:
        stream = self._socket
        if stream is not None:
            try:
                stream.sendall(data)
            except OSError as error:
                self.disconnected = error.strerror or str(error)
                _end(stream)

    def ends(self, to: Address | None = None) -> list[End]:
        stream = self._socket
        return [] if stream is None or stream.fileno() < 0 else [(stream.fileno(), None)]

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def _connected(self) -> socket.socket:
        made = socket.create_connection(self._peer, CONNECT_S)
        made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        return made

    def _lose(self, why: str) -> None:
        stream, self._socket, self.disconnected = self._socket, None, why
        if stream is not None:
            stream.close()

    def _reconnect(self, timeout_s: float) -> None:
        time.sleep(min(timeout_s, max(0.0, self._tried + RETRY_S - time.monotonic())))
        if time.monotonic() < self._tried + RETRY_S:
            return
        self._tried = time.monotonic()
        try:
            self._socket = self._connected()
            self.disconnected = ""
        except OSError as error:
            self.disconnected = error.strerror or str(error)


class TcpIn:
    """Accepts any number of connections."""

    datagrams = False

    def __init__(self, url: Url) -> None:
        self.disconnected = ""
        self._listening = socket.socket(_family(url), socket.SOCK_STREAM)
        self._listening.setblocking(False)
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        _bind(self._listening, url)
        self._listening.listen()
        self._streams: dict[Address, socket.socket] = {}

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        streams = self._streams.copy()
        ready, _, _ = select.select([self._listening, *streams.values()], [], [], timeout_s)
        if self._listening in ready:
            self._accept()
        came: list[tuple[Address, bytes]] = []
        for peer, stream in streams.items():
            if stream in ready:
                came += self._read_one(peer, stream)
        return came

    def write(self, data: bytes, to: Address | None = None) -> None:
        for peer, stream in list(self._streams.items()):
            if to is None or peer == to:
                try:
                    stream.sendall(data)
                except OSError:
                    _end(stream)

    def ends(self, to: Address | None = None) -> list[End]:
        streams = [stream for peer, stream in list(self._streams.items()) if to in (None, peer)]
        return [(stream.fileno(), None) for stream in streams if stream.fileno() >= 0]

    def close(self) -> None:
        for peer in list(self._streams):
            self._drop(peer)
        self._listening.close()

    def _accept(self) -> None:
        try:
            stream, peer = self._listening.accept()
        except OSError:  # it has disconnected already
            return
        stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        stream.settimeout(CONNECT_S)  # a peer that never reads must not stop the others for good
        self._streams[peer] = stream
        if len(self._streams) > MAX_PEERS:
            self._drop(next(iter(self._streams)))

    def _read_one(self, peer: Address, stream: socket.socket) -> list[tuple[Address, bytes]]:
        try:
            data = stream.recv(READ_BYTES)
        except OSError:
            data = b""
        if not data:
            self._drop(peer)
        return [(peer, data)] if data else []

    def _drop(self, peer: Address) -> None:
        stream = self._streams.pop(peer, None)
        if stream is not None:
            stream.close()


class Serial:
    """A serial port, opened again whenever it is unplugged and plugged in."""

    datagrams = False

    def __init__(self, url: Url) -> None:
        self.disconnected = ""
        self._url = url
        self._tried = time.monotonic()
        self._broken = ""
        """Reason why writing failed, for the reader."""
        self._port = self._opened()

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        import serial

        if self._broken:
            self._lose(self._broken)
        if self._port is None:
            self._reopen(timeout_s)
            return []
        try:
            self._port.timeout = timeout_s
            data = self._port.read(1)
            data += self._port.read(self._port.in_waiting) if data else b""
        except (serial.SerialException, OSError, TypeError) as error:
            self._lose(str(error))
            return []
        return [("serial", data)] if data else []

    def write(self, data: bytes, to: Address | None = None) -> None:
        import serial

        port = self._port
        if port is None or self._broken:
            return
        try:
            port.write(data)
        except (serial.SerialException, OSError, TypeError) as error:  # TypeError: it is being closed
            if port is self._port:
                self._broken = str(error)

    def ends(self, to: Address | None = None) -> list[End]:
        port = self._port
        return [] if port is None or self._broken else [(port.fileno(), None)]

    def close(self) -> None:
        if self._port is not None:
            self._port.close()

    def _opened(self) -> Any:
        import serial

        try:
            return serial.Serial(self._url.host, self._url.number, exclusive=True, write_timeout=CONNECT_S)
        except (serial.SerialException, OSError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise InputError(f"{self._url}: cannot be opened ({why}); is it plugged in, and free?") from None

    def _lose(self, why: str) -> None:
        port, self._port, self._broken = self._port, None, ""
        self.disconnected = f"the serial port is disconnected ({why})"
        if port is not None:
            port.close()

    def _reopen(self, timeout_s: float) -> None:
        time.sleep(min(timeout_s, RETRY_S))
        if time.monotonic() >= self._tried + RETRY_S:
            self._tried = time.monotonic()
            with contextlib.suppress(InputError):
                self._port, self.disconnected = self._opened(), ""


OPENING: dict[UrlKind, Callable[[Url], Transport]] = {
    "udpin": UdpIn,
    "udpout": UdpOut,
    "tcp": TcpOut,
    "tcpin": TcpIn,
    "serial": Serial,
}


def _family(url: Url) -> socket.AddressFamily:
    return socket.AF_INET6 if ":" in url.host else socket.AF_INET


def _datagrams(url: Url) -> socket.socket:
    made = socket.socket(_family(url), socket.SOCK_DGRAM)
    made.setblocking(False)  # what `select` saw may be gone when it is read
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
    return made


def _bind(made: socket.socket, url: Url) -> None:
    try:
        made.bind((url.host, url.number))
    except OSError as error:
        made.close()
        why = error.strerror or str(error)
        raise InputError(f"{url}: cannot listen there ({why}); is the port free, the address ours?") from None


def _why(error: OSError) -> str:
    refused = isinstance(error, ConnectionRefusedError)
    return "nothing listens there" if refused else error.strerror or str(error)


def _end(stream: socket.socket) -> None:
    """End the stream for its reader."""
    with contextlib.suppress(OSError):
        stream.shutdown(socket.SHUT_RDWR)


def _ready(made: socket.socket, timeout_s: float) -> bool:
    return bool(select.select([made], [], [], timeout_s)[0])
