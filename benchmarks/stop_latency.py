"""Measures the time from `pause` until the robot brakes and until the answer, by session and fault.

Run: python -m benchmarks.stop_latency [--sessions open,shared,one-shot]; needs strace. One line per session and
fault. *shared* is `stopgo pause` through `stopgo session`. Poses come every 50 ms, so braking is that exact.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.slow_disk import SLOWER, one_leg, pose_in, robot_of, slow_syncs, stop_by, until
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.run.events import PoseReport
from tests.bridge.proxy import Proxy

FLOOD_PER_S = 200
MOST_HELD = 500
"""Connections that the flood holds open at a time."""


@dataclass(frozen=True)
class Fault:
    """What happens while a robot is paused, and the number of trials."""

    name: str
    trials: int
    sync_s: float = 0.0
    delay_s: float = 0.0
    """Delay of the line, each way."""
    floods: bool = False


FAULTS = (
    Fault("none", 10),
    Fault("300 ms round trip", 6, delay_s=0.15),
    Fault("200 connects a second", 6, floods=True),
    Fault("sync 0.5 s", 5, sync_s=0.5),
    Fault("sync 5 s", 2, sync_s=5.0),
)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--sessions", default="open,shared,one-shot")
    sessions = options.parse_args().sessions.split(",")
    print("| session | fault | n | brakes after, s, median / greatest | driven, m | answered after, s |")
    print("|---|---|---|---|---|---|", flush=True)
    for fault in FAULTS:
        for session in sessions:
            brakes, driven, answered = zip(*trials(session, fault), strict=True)
            print(f"| {session} | {fault.name} | {fault.trials} | {median(brakes):.2f} / {max(brakes):.2f} |"
                  f" {median(driven):.2f} / {max(driven):.2f} |"
                  f" {median(answered):.2f} / {max(answered):.2f} |", flush=True)  # fmt: skip


def trials(session: str, fault: Fault) -> list[tuple[float, float, float]]:
    """Seconds until the robot brakes, metres until it stands, and seconds until the answer, of each pause."""
    with ExitStack() as opened:
        folder = opened.enter_context(tempfile.TemporaryDirectory())
        os.environ["XDG_STATE_HOME"] = folder
        endpoint, number = opened.enter_context(robot_of(Path.cwd(), Path(folder) / "r1"))
        station = opened.enter_context(connect(endpoint, robot="r1", commander="bench"))
        station.push(one_leg())
        port = int(endpoint.rpartition(":")[2])
        line = (
            opened.enter_context(Proxy(port, delay_s=fault.delay_s)).endpoint if fault.delay_s else endpoint
        )
        used = (
            opened.enter_context(connect(line, robot="r1", commander="bench")) if fault.delay_s else station
        )
        if session == "shared":
            opened.enter_context(shared_session(line))
        if fault.floods:
            opened.enter_context(flood(port))
        poses: list[tuple[float, PoseReport]] = []
        station.link.hear(station.keys.pose, lambda key, raw: poses.append((time.monotonic(), pose_in(raw))))
        station.command("start")
        measured = []
        for _ in range(fault.trials):
            until(lambda: bool(poses) and poses[-1][1].speed > 0.49)
            with slow_syncs(number, fault.sync_s):
                measured.append(pause(session, used, line, poses))
            station.command("resume")
        return measured


def pause(
    session: str, station: Station, endpoint: str, poses: list[tuple[float, PoseReport]]
) -> tuple[float, float, float]:
    sent_s = time.monotonic()
    stop_by("open" if session == "open" else "one-shot", station, endpoint)
    answered_s = time.monotonic()
    until(lambda: poses[-1][1].speed < 0.001)
    after = [(at_s, report) for at_s, report in poses if at_s >= sent_s]
    brakes_s = next(at_s for at_s, report in after if report.speed < SLOWER) - sent_s
    return brakes_s, after[-1][1].pose.x - after[0][1].pose.x, answered_s - sent_s


@contextmanager
def shared_session(endpoint: str) -> Iterator[None]:
    """Hold a session open, which the command uses."""
    command = [sys.executable, "-m", "stopgo", "session", "--robot", "r1", "--as", "bench"]
    with subprocess.Popen([*command, "--connect", endpoint], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield
        finally:
            process.terminate()


@contextmanager
def flood(port: int) -> Iterator[None]:
    """Open connections from many loopback addresses that say nothing."""
    over = threading.Event()

    def connects() -> None:
        held: list[socket.socket] = []
        count = 0
        while not over.wait(1 / FLOOD_PER_S):
            count += 1
            one = socket.socket()
            one.setblocking(False)
            one.bind((f"127.0.{1 + count // 250 % 250}.{1 + count % 250}", 0))
            one.connect_ex(("127.0.0.1", port))
            held.append(one)
            if len(held) > MOST_HELD:
                held.pop(0).close()
        for one in held:
            one.close()

    thread = threading.Thread(target=connects)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


if __name__ == "__main__":
    main()
