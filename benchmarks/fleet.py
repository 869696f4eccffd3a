"""Measures one station that receives many robots: lost poses, and processor load.

Run: python -m benchmarks.fleet [--robots 50] [--seconds 20]; every robot is a process of its own.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import msgspec

from benchmarks.table import lines_put
from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.zenoh_link import connecting
from stopgo.bridge.station.fleet import fleet
from stopgo.mission.console.ports import free_port
from stopgo.mission.run.events import PoseReport
from tests.bridge.station.test_fleet import router


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robots", type=int, default=50)
    options.add_argument("--seconds", type=float, default=20.0)
    given = options.parse_args()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(router(endpoint))
        with ThreadPoolExecutor(4) as pool:
            booted = pool.map(lambda n: robot(folder, endpoint, n), range(given.robots))
            for process in booted:
                stack.callback(end_robot, process)
        stack.enter_context(lines_put("fleet"))
        print(f"{sum(member.state is not None for member in fleet(endpoint))} robots tell their state")
        listen(endpoint, given.seconds)


def robot(folder: Path, endpoint: str, number: int):
    name = f"r{number:02}"
    return start_robot(name, folder / name, listen=None, extra=("--connect", endpoint))


def listen(endpoint: str, seconds: float) -> None:
    """Count every pose of every robot for so long."""
    heard: dict[str, list[int]] = defaultdict(list)
    decoder = msgspec.json.Decoder(PoseReport)

    def take(key: str, payload: bytes) -> None:
        report = decoder.decode(payload)
        heard[report.robot].append(report.seq)

    with connecting(endpoint) as link:
        link.hear(KeyExpressions.of_every_robot(None).pose, take)
        time.sleep(2.0)
        for seqs in heard.values():
            seqs.clear()
        began, cpu = time.monotonic(), time.process_time()
        time.sleep(seconds)
        took, used = time.monotonic() - began, time.process_time() - cpu
        poses = {name: list(seqs) for name, seqs in heard.items()}
    count = sum(map(len, poses.values()))
    lost = sum(max(seqs) - min(seqs) + 1 - len(set(seqs)) for seqs in poses.values())
    print(f"{len(poses)} robots, {count / took:.0f} poses a second, {lost} lost of {count}")
    print(f"station: {used / took:.1%} of a core, {used / count * 1e6:.0f} µs a pose")


if __name__ == "__main__":
    main()
