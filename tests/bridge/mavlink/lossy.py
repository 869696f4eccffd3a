"""A UDP line between station and vehicle that is slow, loses, doubles and overtakes, from a seed."""

from __future__ import annotations

import heapq
import random
import select
import socket
import threading
import time
from dataclasses import dataclass
from typing import Any

from bridge.mavlink.line.url import Url

WAIT_S = 0.05


@dataclass(frozen=True)
class Roughness:
    """What happens to a datagram, in each direction."""

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
        self._chance = random.Random(seed)
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self._far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._far.connect(("127.0.0.1", target))
        self.port: int = self._near.getsockname()[1]
        self.url = Url("udpout", "127.0.0.1", self.port)
        self._station: Any = None
        self._due: list[tuple[float, int, bool, bytes]] = []
        self._carried = 0
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)

    def __enter__(self) -> Lossy:
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._closing.set()
        self._thread.join()
        self._near.close()
        self._far.close()

    def _work(self) -> None:
        while not self._closing.is_set():
            wait_s = min(WAIT_S, self._due[0][0] - time.monotonic()) if self._due else WAIT_S
            ready, _, _ = select.select([self._near, self._far], [], [], max(0.0, wait_s))
            for line in ready:
                self._take(line)
            while self._due and self._due[0][0] <= time.monotonic():
                self._give(*heapq.heappop(self._due)[2:])

    def _take(self, line: socket.socket) -> None:
        try:
            data, source = line.recvfrom(65536)
        except ConnectionRefusedError:  # the vehicle is not there at the moment
            return
        if line is self._near:
            self._station = source
        chance, rough = self._chance.random, self.roughness
        if chance() < rough.loss:
            return
        for _ in range(2 if chance() < rough.doubled else 1):
            late = rough.delay_s * (2 if chance() < rough.overtaken else 1)
            self._carried += 1
            heapq.heappush(self._due, (time.monotonic() + late, self._carried, line is self._near, data))

    def _give(self, to_vehicle: bool, data: bytes) -> None:
        try:
            if to_vehicle:
                self._far.send(data)
            elif self._station is not None:
                self._near.sendto(data, self._station)
        except ConnectionRefusedError:
            pass
