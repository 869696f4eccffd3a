"""A TCP line between station and robot that can be slow, late, silent, or cut."""

from __future__ import annotations

import contextlib
import queue
import socket
import threading
import time

PIECE = 4096


class Proxy:
    """Carries everything between its own port and the robot's, as slowly and unreliably as it is told."""

    def __init__(self, target: int, *, bits_per_s: float | None = None, delay_s: float = 0.0) -> None:
        self._target = target
        self._bits_per_s = bits_per_s
        self._delay_s = delay_s
        self._carries = threading.Event()
        self._carries.set()
        self._open: list[socket.socket] = []
        self._listener = socket.create_server(("127.0.0.1", 0))
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
        """While true nothing is carried, and neither end is told (a blackhole)."""
        (self._carries.clear if silent else self._carries.set)()

    def _accept(self) -> None:
        while not self._closing.is_set():
            try:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._target))
            except OSError:
                continue
            for line in (near, far):
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._open += [near, far]
            for source, sink in ((near, far), (far, near)):
                threading.Thread(target=self._carry, args=(source, sink), daemon=True).start()

    def _carry(self, source: socket.socket, sink: socket.socket) -> None:
        """Read on one thread and write on another, so that a delay does not slow the line."""
        pending: queue.Queue[tuple[float, bytes]] = queue.Queue(maxsize=64)
        threading.Thread(target=self._write, args=(pending, sink), daemon=True).start()
        with contextlib.suppress(OSError):
            while data := source.recv(PIECE):
                pending.put((time.monotonic() + self._delay_s, data))
        pending.put((0.0, b""))

    def _write(self, pending: queue.Queue[tuple[float, bytes]], sink: socket.socket) -> None:
        free_at = time.monotonic()
        while True:
            due, data = pending.get()
            if not data:
                _end(sink)
                return
            self._carries.wait()
            time.sleep(max(0.0, due - time.monotonic()))
            if self._bits_per_s:
                # What the last wait took too long is made up for, unless the line was idle.
                free_at = max(free_at, time.monotonic() - 0.005) + len(data) * 8 / self._bits_per_s
                time.sleep(max(0.0, free_at - time.monotonic()))
            try:
                sink.sendall(data)
            except OSError:
                return


def _end(line: socket.socket) -> None:
    with contextlib.suppress(OSError):
        line.shutdown(socket.SHUT_RDWR)
    line.close()
