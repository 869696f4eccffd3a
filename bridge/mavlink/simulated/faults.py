"""What is to go wrong with the simulated vehicle, and the line that loses, doubles and delays its frames."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
import time
from dataclasses import dataclass
from typing import Literal

import msgspec

from bridge.mavlink.transport import Address, Transport
from mission.errors import InputError

FaultKind = Literal[
    "loss", "duplicates", "jitter", "lostack", "nack", "silent", "reboot-upload", "reboot-mission",
    "beside", "finish", "scanner", "unsigned",
]  # fmt: skip


@dataclass(frozen=True)
class VehicleFault:
    """Something that goes wrong; what `at` and `amount` mean is in `FAULTS`."""

    kind: FaultKind
    at: int
    amount: float = 0.0


FAULTS: dict[FaultKind, str] = {
    "loss": "N percent of the frames are lost, each way; AMOUNT is the seed",
    "duplicates": "N percent of the frames come twice, each way; AMOUNT is the seed",
    "jitter": "frames are late by up to N ms, each way, and overtake each other; AMOUNT is the seed",
    "lostack": "the last ACK of upload N is not sent",
    "nack": "item N of an upload is refused once, with MAV_MISSION_RESULT AMOUNT (0: ERROR)",
    "silent": "once, from item N of an upload on, nothing is said or heard, for AMOUNT seconds (0: for good)",
    "reboot-upload": "the vehicle reboots once, when item N of an upload has come",
    "reboot-mission": "the vehicle reboots once, on the way to item N",
    "beside": "the vehicle stands AMOUNT metres to the left of item N's waypoint, and says it is reached",
    "finish": "item N's waypoint is said to be reached AMOUNT metres before it, in passing",
    "scanner": "scan N fails",
    "unsigned": "nothing is signed, though there is a key (N means nothing)",
}


@dataclass(frozen=True)
class VehicleFaults:
    all: tuple[VehicleFault, ...] = ()

    def due(self, kind: FaultKind, at: int) -> VehicleFault | None:
        return next((fault for fault in self.all if (fault.kind, fault.at) == (kind, at)), None)

    def any(self, kind: FaultKind) -> VehicleFault | None:
        """The first fault of a kind, wherever it is due."""
        return next((fault for fault in self.all if fault.kind == kind), None)


NO_FAULTS = VehicleFaults()


class Mishaps:
    """The faults of one vehicle, and which of them have happened."""

    def __init__(self, faults: VehicleFaults) -> None:
        self._faults = faults
        self._happened: set[VehicleFault] = set()

    def due(self, kind: FaultKind, at: int) -> VehicleFault | None:
        """A fault that happens whenever it is due."""
        return self._faults.due(kind, at)

    def once(self, kind: FaultKind, at: int) -> VehicleFault | None:
        """A fault that happens the first time it is due."""
        fault = self._faults.due(kind, at)
        if fault is None or fault in self._happened:
            return None
        self._happened.add(fault)
        return fault


def read_vehicle_fault(text: str) -> VehicleFault:
    """A fault from KIND@N or KIND@N=AMOUNT, such as `beside@3=0.4`."""
    kind, _, rest = text.partition("@")
    at, _, amount = rest.partition("=")
    try:
        fault = VehicleFault(msgspec.convert(kind, FaultKind), int(at), float(amount or 0.0))
    except (ValueError, msgspec.ValidationError):
        kinds = ", ".join(FAULTS)
        raise InputError(f"--fault {text}: write it KIND@N or KIND@N=AMOUNT, KIND of {kinds}") from None
    if not (fault.at >= 0 and 0 <= fault.amount < 1e9):
        raise InputError(f"--fault {text}: N and AMOUNT must be 0 or more")
    return fault


class RoughLine:
    """A transport whose frames are lost, doubled and delayed by chance, in both directions.

    Two threads use it: one reads, another writes.
    """

    def __init__(self, transport: Transport, faults: VehicleFaults) -> None:
        self.datagrams, self.gone = transport.datagrams, transport.gone
        self._transport = transport
        self._loss = _share(faults, "loss")
        self._twice = _share(faults, "duplicates")
        self._late_s = _share(faults, "jitter") / 10
        seed = sum(int(fault.amount) for fault in faults.all if fault.kind in LINE)
        self._coming, self._going = random.Random(2 * seed), random.Random(2 * seed + 1)
        self._count = itertools.count()
        self._waiting: list[tuple[float, int, Address, bytes]] = []
        self._leaving: list[tuple[float, int, Address | None, bytes]] = []
        self._lock = threading.Lock()

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        """What has come and is due; what waits to leave is sent on the way."""
        pause = timeout_s if not self._late_s else min(timeout_s, 0.01)
        for address, data in self._transport.read(pause):
            for due in self._times(self._coming):
                heapq.heappush(self._waiting, (due, next(self._count), address, data))
        self._send_due()
        self.gone = self._transport.gone
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

    def close(self) -> None:
        self._transport.close()

    def _send_due(self) -> None:
        with self._lock:
            while self._leaving and self._leaving[0][0] <= time.monotonic():
                _, _, to, data = heapq.heappop(self._leaving)
                self._transport.write(data, to)

    def _times(self, chance: random.Random) -> list[float]:
        """When each copy of a frame arrives; none if it is lost."""
        if chance.random() < self._loss:
            return []
        copies = 2 if chance.random() < self._twice else 1
        return [time.monotonic() + chance.uniform(0.0, self._late_s) for _ in range(copies)]


LINE: frozenset[FaultKind] = frozenset({"loss", "duplicates", "jitter"})


def on_line(transport: Transport, faults: VehicleFaults) -> Transport:
    """The transport, made rough where the faults say so."""
    return RoughLine(transport, faults) if any(fault.kind in LINE for fault in faults.all) else transport


def _share(faults: VehicleFaults, kind: FaultKind) -> float:
    fault = faults.any(kind)
    return fault.at / 100 if fault else 0.0
