"""A TCP line between station and robot that can be slow, late, silent, or cut.

It takes what it is given no faster than it carries it, and then it is on its way for as long as the delay:
what finds no room on the line waits in the buffers of whoever sends. All connections share one line, which
carries as much each way.
"""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
import time

PIECE = 4096
BUFFER_BYTES = 8192
"""Of the operating system, before the line."""
ON_THE_WAY = 2048
"""Pieces: more than any of these lines holds."""


class Lane:
    """One direction of the line, for all connections together."""

    def __init__(self, bits_per_s: float | None) -> None:
        self._bits_per_s = bits_per_s
        self._free_at = 0.0
        self._lock = threading.Lock()

    def take(self, size: int) -> None:
        """Wait until so many bytes have gone onto the line."""
        if not self._bits_per_s:
            return
        with self._lock:
            # What the last wait took too long is made up for, unless the line was idle.
            self._free_at = max(self._free_at, time.monotonic() - 0.005) + size * 8 / self._bits_per_s
            free_at = self._free_at
        time.sleep(max(0.0, free_at - time.monotonic()))


class Proxy:
    """Carries everything between its own port and the robot's, as slowly and unreliably as it is set."""

    def __init__(self, target: int, *, bits_per_s: float | None = None, delay_s: float = 0.0) -> None:
        self._target = target
        self._lanes = (Lane(bits_per_s), Lane(bits_per_s))
        self._delay_s = delay_s
        self._carries = threading.Event()
        self._carries.set()
        self._open: list[socket.socket] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        self.port: int = self._listener.getsockname()[1]
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._closing = threading.Event()

    def __enter__(self) -> Proxy:
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.set()
        self._listener.close()
        self.cut()

    def cut(self) -> None:
        """End every connection; new ones are taken."""
        lines, self._open = self._open, []
        for line in lines:
            _end(line)

    def swallow(self, silent: bool) -> None:
        """While true nothing is carried, and neither end is informed (a blackhole)."""
        (self._carries.clear if silent else self._carries.set)()

    def _accept(self) -> None:
        while not self._closing.is_set():
            try:
                near, _ = self._listener.accept()
                far = socket.socket()
                far.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
                far.connect(("127.0.0.1", self._target))
            except OSError:
                continue
            for line in (near, far):
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._open += [near, far]
            for source, sink, lane in zip((near, far), (far, near), self._lanes, strict=True):
                threading.Thread(target=self._carry, args=(source, sink, lane), daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket, lane: Lane) -> None:
        """Read at the line's rate on one thread, and write on another when the delay is over."""
        pending: queue.Queue[tuple[float, bytes]] = queue.Queue(maxsize=ON_THE_WAY)
        threading.Thread(target=self._write, args=(pending, sink), daemon=True).start()
        with contextlib.suppress(OSError):
            while data := source.recv(PIECE):
                lane.take(len(data))
                pending.put((time.monotonic() + self._delay_s, data))
        pending.put((0.0, b""))

    def _write(self, pending: queue.Queue[tuple[float, bytes]], sink: socket.socket) -> None:
        while True:
            due, data = pending.get()
            if not data:
                _end(sink)
                return
            self._carries.wait()
            time.sleep(max(0.0, due - time.monotonic()))
            try:
                sink.sendall(data)
            except OSError:
                return


def _end(line: socket.socket) -> None:
    with contextlib.suppress(OSError):
        line.shutdown(socket.SHUT_RDWR)
    line.close()
