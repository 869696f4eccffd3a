"""Measures the page of `stopgo site`: delay of poses, of STOP, and the load of server and page.

Run: python -m benchmarks.site [--robots 20] [--hertz 10] [--seconds 20]; the robots only report and answer.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

from benchmarks.table import put, table, versions
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Info, KeyExpressions, encode
from stopgo.bridge.link.zenoh_link import listening
from stopgo.mission.console.ports import free_port
from stopgo.mission.run.events import Pose, PoseReport, StateReport
from stopgo.mission.run.run_commands import Answer
from tests.site.chromium import browser

TICKS = os.sysconf("SC_CLK_TCK")
HOOK = """
window.delays = []; window.stops = [];
import('/pages/store.js').then((store) => store.onChange((kinds) => { if (kinds.has('pose'))
  for (const { value } of store.all('pose')) if (value.x !== window[value.heading]) {
    window[value.heading] = value.x; window.delays.push(Date.now() % 1e6 - value.x); } }))
"""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--robots", type=int, default=20)
    options.add_argument("--hertz", type=float, default=10.0)
    options.add_argument("--seconds", type=float, default=20.0)
    given = options.parse_args()
    endpoint, stopped = f"tcp/127.0.0.1:{free_port()}", threading.Event()
    with tempfile.TemporaryDirectory() as folder, listening(endpoint) as link:
        answered: list[float] = []
        for number in range(given.robots):
            threading.Thread(
                target=report, args=(link, number, given.hertz, stopped, answered), daemon=True
            ).start()
        site = subprocess.Popen(
            [sys.executable, "-m", "stopgo", "site", folder, "--connect", endpoint],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env={**os.environ, "XDG_STATE_HOME": folder},
        )  # fmt: skip
        try:
            assert site.stdout is not None
            measure(site.stdout.readline().split(": ", 1)[1].strip(), site.pid, given, answered)
        finally:
            site.terminate()
            site.wait()
            stopped.set()


def report(link: Any, number: int, hertz: float, stopped: threading.Event, answered: list[float]) -> None:
    """Be a robot that stands, reports, and answers."""
    keys, boot = KeyExpressions(f"r{number:02}"), "b1"
    seq = 0

    def state() -> StateReport:
        nonlocal seq
        seq += 1
        return StateReport(
            robot=keys.robot, boot_id=boot, seq=seq, robot_ns=time.time_ns(), state="RUNNING", run_id=None,
            mission_id=None, revision=None, stop=None, stop_state=None, done=(), skipped=(), battery=0.9,
            last_event=0,
        )  # fmt: skip

    def info(request: Request) -> bytes:
        about = Info(
            protocol=1, stopgo="0", robot=keys.robot, boot_id=boot, clock_ns=time.time_ns(), state=state(),
            lease=None, chunk_bytes=32768, document_bytes=10**7, profiles=None, to_map=None,
        )  # fmt: skip
        return encode(about)

    def pause(request: Request) -> bytes:
        answered.append(time.time())
        return encode(Answer(
            cmd_id="", verb="pause", outcome="ok", reason=None, message="", run_id=None, state="PAUSED"
        ))  # fmt: skip

    for key, answer in ((keys.info, info), (keys.keep, info), (keys.command("pause"), pause)):
        link.serve(key, answer)
    link.announce(keys.alive)
    poses, states = link.publisher(keys.pose, bulk=True), link.publisher(keys.state)
    count = 0
    while not stopped.wait(1 / hertz):
        count += 1
        pose = Pose(x=round(time.time() * 1000) % 1e6, y=0.0, heading=float(number))
        poses(encode(PoseReport(
            robot=keys.robot, boot_id=boot, seq=count, robot_ns=time.time_ns(), run_id=None,
            mission_time_s=None, pose=pose, speed=0.0,
        )))  # fmt: skip
        if count % round(hertz) == 0:
            states(encode(state()))


def measure(address: str, pid: int, given: argparse.Namespace, answered: list[float]) -> None:
    """Print the table."""
    with browser() as chromium:
        tab = chromium.tab(address)
        tab.until(f"document.querySelectorAll('.card').length == {given.robots}")
        tab.run(HOOK)
        time.sleep(2)
        tab.run("window.delays.length = 0")
        busy, began = cpu(pid), time.monotonic()
        time.sleep(given.seconds)
        load = (cpu(pid) - busy) / (time.monotonic() - began)
        delays = sorted(tab.run("window.delays"))
        presses = [press(tab, answered, given.robots) for _ in range(10)]
        heap = tab.run("performance.memory.usedJSHeapSize") / 1e6
        head = ["robots", "Hz", "poses shown/s", "delay median, 99 % ms", "STOP median, worst ms",
                "server, % of a core", "server MB", "page MB"]  # fmt: skip
        row = [
            given.robots, given.hertz, len(delays) / given.seconds,
            f"{statistics.median(delays):.0f}, {delays[int(0.99 * len(delays))]:.0f}",
            f"{statistics.median(presses):.0f}, {max(presses):.0f}", 100 * load, memory(pid), heap,
        ]  # fmt: skip
        told = versions("starlette", "uvicorn", "eclipse-zenoh")
        put(
            "site",
            f"{told}; load {os.getloadavg()[0]:.1f}; {given.seconds:g} s, once\n\n{table(head, [row])}",
        )


def press(tab: Any, answered: list[float], robots: int) -> float:
    """Press STOP; return the milliseconds until the last robot had it."""
    before = len(answered)
    pressed = tab.run("(document.getElementById('stop').click(), Date.now())") / 1000
    while len(answered) < before + robots:
        time.sleep(0.005)
    time.sleep(0.5)
    return 1000 * (max(answered[before:]) - pressed)


def cpu(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def memory(pid: int) -> float:
    """Resident memory of a process, MB."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


if __name__ == "__main__":
    main()
