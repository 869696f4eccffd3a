"""A robot and a station on two network stacks, and a line that loses, delays and reorders packets.

Run in a namespace of its own (`unshare -rn`). The line is this program: it carries the packets from one
TUN device to the other, so that TCP meets what it would meet on a bad radio link. What came of a whole
mission is printed as JSON.
"""

from __future__ import annotations

import ctypes
import fcntl
import heapq
import json
import os
import random
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.run.events import PoseReport, StateReport
from tests.bridge.world import corridor

TUNSETIFF, IFF_TUN, IFF_NO_PI, CLONE_NEWNET = 0x400454CA, 0x0001, 0x1000, 0x40000000
ROBOT, STATION = "10.9.0.1", "10.9.0.2"
SPEED_UP = 60.0


@dataclass
class Direction:
    """One way of the line."""

    source: int
    sink: int
    loss: float
    delay_s: float
    bits_per_s: float
    chance: random.Random
    carried: int = 0
    lost: int = 0
    overtaken: int = 0
    free_at: float = 0.0
    waiting: list[tuple[float, int, bytes]] = field(default_factory=list)
    ready: threading.Condition = field(default_factory=threading.Condition)

    def open(self) -> None:
        for work in (self._take, self._give):
            threading.Thread(target=work, daemon=True).start()

    def _take(self) -> None:
        number = 0
        while True:
            packet = os.read(self.source, 65536)
            if self.chance.random() < self.loss:
                self.lost += 1
                continue
            number += 1
            now = time.monotonic()
            if self.bits_per_s:
                self.free_at = max(self.free_at, now) + len(packet) * 8 / self.bits_per_s
            # Each packet is late by its own amount, so that later ones overtake.
            due = max(now, self.free_at) + self.delay_s * self.chance.uniform(0.5, 1.5)
            with self.ready:
                heapq.heappush(self.waiting, (due, number, packet))
                self.ready.notify()

    def _give(self) -> None:
        newest = 0
        while True:
            with self.ready:
                while not self.waiting or self.waiting[0][0] > time.monotonic():
                    left = self.waiting[0][0] - time.monotonic() if self.waiting else None
                    self.ready.wait(left)
                _, number, packet = heapq.heappop(self.waiting)
            self.overtaken += number < newest
            newest = max(newest, number)
            self.carried += 1
            os.write(self.sink, packet)


def main(folder: Path, loss: float, delay_s: float, bits_per_s: float, stops: int) -> None:
    near = tun("near", ROBOT)
    robot = start_robot("r1", folder, listen=f"tcp/{ROBOT}:7447", speed_up=SPEED_UP, extra=("--insecure",))
    try:
        another_stack()
        far = tun("far", STATION)
        ways = [
            Direction(source, sink, loss, delay_s, bits_per_s, random.Random(seed))
            for seed, (source, sink) in enumerate([(near, far), (far, near)])
        ]
        for way in ways:
            way.open()
        with connect(f"tcp/{ROBOT}:7447", robot="r1", insecure=True, timeout_s=60.0) as station:
            outcome = whole_mission(station, stops)
        counts = {name: sum(getattr(way, name) for way in ways) for name in ("carried", "lost", "overtaken")}
        print(json.dumps(outcome | counts))
    finally:
        end_robot(robot)


def whole_mission(station: Station, stops: int) -> dict[str, object]:
    """A document, then a run, watched to its end."""
    large = corridor(stops=stops)
    began = time.monotonic()
    answered(lambda: station.push(large))
    took_s = time.monotonic() - began
    same = answered(lambda: station.mission(large.id, 1)) == large
    answered(lambda: station.push(corridor(stops=3, revision=2)))
    station.command("start")
    reports = list(station.reports())
    events = [
        item for item in reports if not isinstance(item, StateReport | PoseReport) and hasattr(item, "number")
    ]
    states = [item.state for item in reports if isinstance(item, StateReport)]
    return {
        "same": same,
        "push_s": round(took_s, 1),
        "numbers": [event.number for event in events],
        "told": [f"{type(event).__name__} {getattr(event, 'stop', '')}".strip() for event in events],
        "state": states[-1],
        "journal": len(answered(station.log)),
    }


def answered(question: Callable[[], Any]) -> Any:
    """The answer of the robot, asked until it is known: it may take longer than a station waits."""
    while True:
        try:
            return question()
        except OutcomeUnknown:
            continue


def tun(name: str, address: str) -> int:
    """A device whose packets are read and written here."""
    try:
        device = os.open("/dev/net/tun", os.O_RDWR)
        fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH", name.encode(), IFF_TUN | IFF_NO_PI))
    except OSError as error:
        sys.exit(f"cannot make a line: {error}")
    for words in (f"addr add {address}/24 dev {name}", f"link set {name} up", "link set lo up"):
        subprocess.run(["ip", *words.split()], check=True)
    return device


def another_stack() -> None:
    """From here on this process has a network of its own; devices that are open stay so."""
    if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET):
        raise OSError(ctypes.get_errno(), "unshare")


if __name__ == "__main__":
    loss, delay_s, bits_per_s = map(float, sys.argv[2:5])
    main(Path(sys.argv[1]), loss, delay_s, bits_per_s, int(sys.argv[5]))
