"""A UDP line between station and vehicle that is slow, loses, doubles and overtakes, from a seed."""

from __future__ import annotations

import heapq
import random
import threading
import time
from dataclasses import dataclass

from stopgo.bridge.mavlink.vehicle_link.transport import Transport, open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url
from tests.ports import free_port

WAIT_S = 0.05


@dataclass(frozen=True)
class Roughness:
    """Faults of a datagram's transport, in each direction."""

    delay_s: float = 0.0
    loss: float = 0.0
    """Share of datagrams that never arrive."""
    doubled: float = 0.0
    overtaken: float = 0.0
    """Share that is late by once more the delay, and so arrives after others."""


class Lossy:
    """Carries between whoever sends to `url` and the vehicle's port, until the block ends."""

    def __init__(self, target: int, roughness: Roughness, *, seed: int) -> None:
        self.roughness = roughness
        self.url = Url("udpout", "127.0.0.1", free_port())
        self._chance = random.Random(seed)
        self._near = open_transport(Url("udpin", "127.0.0.1", self.url.number))
        self._far = open_transport(Url("udpout", "127.0.0.1", target))
        self._due: list[tuple[float, int, Transport, bytes]] = []
        self._carried = 0
        self._stalled_until_s = 0.0
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._threads = [
            threading.Thread(target=self._work, args=ends, daemon=True)
            for ends in ((self._near, self._far), (self._far, self._near))
        ]

    def __enter__(self) -> Lossy:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.set()
        for thread in self._threads:
            thread.join()
        self._near.close()
        self._far.close()

    def stall(self, seconds: float) -> None:
        """Hold everything back for so long; then all of it arrives at once."""
        self._stalled_until_s = time.monotonic() + seconds

    def _work(self, source: Transport, sink: Transport) -> None:
        """Take what comes in at one end, and give what is due at either."""
        while not self._closing.is_set():
            with self._lock:
                wait_s = min(WAIT_S, self._due[0][0] - time.monotonic()) if self._due else WAIT_S
            for _, data in source.read(max(0.0, wait_s)):
                self._take(sink, data)
            with self._lock:
                while self._due and self._due[0][0] <= time.monotonic():
                    _, _, to, data = heapq.heappop(self._due)
                    to.write(data)

    def _take(self, sink: Transport, data: bytes) -> None:
        with self._lock:
            chance, rough = self._chance.random, self.roughness
            if chance() < rough.loss:
                return
            for _ in range(2 if chance() < rough.doubled else 1):
                late = rough.delay_s * (2 if chance() < rough.overtaken else 1)
                self._carried += 1
                at_s = max(time.monotonic() + late, self._stalled_until_s)
                heapq.heappush(self._due, (at_s, self._carried, sink, data))
