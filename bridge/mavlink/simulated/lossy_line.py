"""A link to the simulated vehicle that loses, doubles and delays frames by chance."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
import time

from stopgo.bridge.mavlink.simulated.vehicle_faults import VehicleFaultKind, VehicleFaults
from stopgo.bridge.mavlink.vehicle_link.transport import Address, End, Transport


class LossyLine:
    """A transport whose frames are lost, doubled and delayed by chance, in both directions.

    Two threads use it: one reads, another writes.
    """

    def __init__(self, transport: Transport, faults: VehicleFaults) -> None:
        self.datagrams, self.disconnected = transport.datagrams, transport.disconnected
        self._transport = transport
        self._loss = _fraction(faults, "loss")
        self._twice = _fraction(faults, "duplicates")
        self._late_s = _fraction(faults, "jitter") / 10
        seed = sum(int(fault.amount) for fault in faults.all if fault.kind in LINE)
        self._coming, self._going = random.Random(2 * seed), random.Random(2 * seed + 1)
        self._count = itertools.count()
        self._waiting: list[tuple[float, int, Address, bytes]] = []
        self._leaving: list[tuple[float, int, Address | None, bytes]] = []
        self._lock = threading.Lock()

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """Frames that came and are due; frames that wait to leave are sent as well."""
        pause = timeout_s if not self._late_s else min(timeout_s, 0.01)
        for address, data in self._transport.read(pause):
            for due in self._times(self._coming):
                heapq.heappush(self._waiting, (due, next(self._count), address, data))
        self._send_due()
        self.disconnected = self._transport.disconnected
        came = []
        while self._waiting and self._waiting[0][0] <= time.monotonic():
            _, _, address, data = heapq.heappop(self._waiting)
            came.append((address, data))
        return came

    def write(self, data: bytes, to: Address | None = None) -> None:
        with self._lock:
            for due in self._times(self._going):
                heapq.heappush(self._leaving, (due, next(self._count), to, data))
        self._send_due()

    def ends(self, to: Address | None = None) -> list[End]:
        return self._transport.ends(to)

    def close(self) -> None:
        self._transport.close()

    def _send_due(self) -> None:
        with self._lock:
            while self._leaving and self._leaving[0][0] <= time.monotonic():
                _, _, to, data = heapq.heappop(self._leaving)
                self._transport.write(data, to)

    def _times(self, chance: random.Random) -> list[float]:
        """Arrival time of each copy of a frame; none if it is lost."""
        if chance.random() < self._loss:
            return []
        copies = 2 if chance.random() < self._twice else 1
        return [time.monotonic() + chance.uniform(0.0, self._late_s) for _ in range(copies)]


LINE: frozenset[VehicleFaultKind] = frozenset({"loss", "duplicates", "jitter"})


def on_line(transport: Transport, faults: VehicleFaults) -> Transport:
    """The transport with the link faults among `faults`, if there are any."""
    return LossyLine(transport, faults) if any(fault.kind in LINE for fault in faults.all) else transport


def _fraction(faults: VehicleFaults, kind: VehicleFaultKind) -> float:
    fault = faults.any(kind)
    return fault.at / 100 if fault else 0.0
