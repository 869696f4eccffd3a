"""Measures how far a robot drives after `pause` while each sync of its disk takes 0, 0.5 or 5 s.

Run: python -m benchmarks.slow_disk [--former DIR] (a former version's checkout, in the same run); needs strace.
One line per version, session and disk. Poses come every 50 ms, so times are that exact.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec

from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.console.ports import free_port
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.events import PoseReport
from tests.bridge.world import corridor

SYNCS_S = (0.0, 0.5, 5.0)
TRIALS = 3
LEG_M = 30.0
SLOWER = 0.45
"""Speed, m/s, below which a robot of 0.5 m/s has begun to brake."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--former", type=Path, help="checkout of a former version")
    former = options.parse_args().former
    print(
        "| version | session | disk | n | brakes after, ms, greatest | driven, m, greatest | answered after, s |"
    )
    print("|---|---|---|---|---|---|---|", flush=True)
    for name, checkout in (("former", former), ("present", Path.cwd())):
        for session in ("open", "one-shot"):
            for sync_s in SYNCS_S if checkout is not None else ():
                row = [trial(checkout, session, sync_s) for _ in range(TRIALS)]
                brakes, driven, answered = (max(column) for column in zip(*row, strict=True))
                print(f"| {name} | {session} | {sync_s:g} s | {TRIALS} | {1e3 * brakes:.0f} | {driven:.2f} |"
                      f" {answered:.1f} |", flush=True)  # fmt: skip


def trial(checkout: Path, session: str, sync_s: float) -> tuple[float, float, float]:
    """Seconds until the robot brakes, metres until it stands, and seconds until the answer."""
    with (
        tempfile.TemporaryDirectory() as folder,
        robot_of(checkout, Path(folder)) as (endpoint, number),
        connect(endpoint, robot="r1", commander="bench") as station,
    ):
        station.push(one_leg())
        poses: list[tuple[float, PoseReport]] = []
        station.link.hear(station.keys.pose, lambda key, raw: poses.append((time.monotonic(), pose_in(raw))))
        station.command("start")
        until(lambda: bool(poses) and poses[-1][1].speed > 0.49)
        with slow_syncs(number, sync_s):
            sent_s = time.monotonic()
            stop_by(session, station, endpoint)
            answered_s = time.monotonic()
            until(lambda: poses[-1][1].speed < 0.001)
    after = [(at_s, report) for at_s, report in poses if at_s >= sent_s]
    brakes_s = next(at_s for at_s, report in after if report.speed < SLOWER) - sent_s
    return brakes_s, after[-1][1].pose.x - after[0][1].pose.x, answered_s - sent_s


def stop_by(session: str, station: Station, endpoint: str) -> None:
    if session == "open":
        station.give(station.stop_order("pause"), within_s=60.0)
        return
    command = [sys.executable, "-m", "stopgo", "pause", "--robot", "r1", "--as", "bench", "--timeout", "60"]
    subprocess.run([*command, "--connect", endpoint], check=True, stdout=subprocess.DEVNULL)


def pose_in(raw: bytes) -> PoseReport:
    return msgspec.json.decode(raw, type=PoseReport)


def one_leg(length_m: float = LEG_M) -> Mission:
    """A mission with one stop at the end of a long leg."""
    made = corridor(stops=1, closed=False)
    stop = msgspec.structs.replace(made.stops[0], x=length_m, approach=((0.0, 0.0), (length_m, 0.0)))
    return with_digest(msgspec.structs.replace(made, stops=(stop,)))


@contextmanager
def robot_of(checkout: Path, state: Path) -> Iterator[tuple[str, int]]:
    """A robot of this checkout's version: its endpoint and the number of its process."""
    here, endpoint = Path.cwd(), f"tcp/127.0.0.1:{free_port()}"
    os.chdir(checkout)
    try:
        process = start_robot("r1", state, listen=endpoint)
    finally:
        os.chdir(here)
    try:
        yield endpoint, process.pid
    finally:
        end_robot(process)


@contextmanager
def slow_syncs(process: int, seconds: float) -> Iterator[None]:
    """Make each sync of a process take that time."""
    if not seconds:
        yield
        return
    slow = f"inject=fsync,fdatasync:delay_enter={round(seconds * 1e6)}"
    command = ["strace", "-f", "-qq", "-o", os.devnull, "-e", "trace=fsync,fdatasync", "-e", slow]
    with subprocess.Popen([*command, "-p", str(process)]) as tracing:
        time.sleep(0.5)
        try:
            yield
        finally:
            tracing.terminate()


def until(reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 90
    while not reached():
        if time.monotonic() > deadline:
            raise TimeoutError
        time.sleep(0.01)


if __name__ == "__main__":
    main()
