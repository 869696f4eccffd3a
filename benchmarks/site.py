"""Measures the page of `stopgo site`: delays of poses, events and STOP, load, and a run of four hours.

Run: python -m benchmarks.site [load|links|run]; without a name all three. In `load` 20 robots only report and
answer. In `links` a simulated robot drives at real time behind a line of some rate and delay. In `run` one
drives for four hours of its own time in two minutes, while its page sleeps and its server is killed.
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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.table import put, table, versions
from stopgo.bridge.link.link import Request
from stopgo.bridge.link.protocol import Info, KeyExpressions, encode
from stopgo.bridge.link.zenoh_link import listening
from stopgo.bridge.station.station import connect
from stopgo.mission.console.ports import free_port
from stopgo.mission.document import Mission, Scan
from stopgo.mission.run.events import Pose, PoseReport, StateReport
from stopgo.mission.run.run_commands import Answer
from tests.bridge.proxy import Proxy
from tests.bridge.world import corridor
from tests.site.chromium import Browser, Tab, browser

TICKS = os.sysconf("SC_CLK_TCK")
HOOK = """
window.delays = []; window.stops = [];
import('/pages/store.js').then((store) => store.onChange((kinds) => { if (kinds.has('pose'))
  for (const { value } of store.all('pose')) if (value.x !== window[value.heading]) {
    window[value.heading] = value.x; window.delays.push(Date.now() % 1e6 - value.x); } }))
"""


EVENTS = """
window.shown = new Map();
import('/pages/store.js').then((store) => { window.store = store; const note = () => {
  for (const { value } of store.all('event', 'r1')) {
    const name = `${value.run_id} ${value.number}`;
    if (!window.shown.has(name)) window.shown.set(name, [value.event, value.robot_ns / 1e6, Date.now()]);
  } }; store.onChange(note); note(); })
"""
NUMBERS = "store.all('event', 'r1').map((one) => one.value.number).sort((a, b) => a - b)"
LINKS = (("this machine", None, 0.0), ("1 Mbit/s, 300 ms round trip", 1e6, 0.15))
PRESSES = 10
LONG_SPEED_UP = 120.0
LONG_STOPS = 320
ASLEEP_S = 30.0
"""An hour of the long run."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("name", nargs="?", choices=("load", "links", "run"))
    given = options.parse_args()
    texts = {}
    for name, work in (("load", load_table), ("links", links_table), ("run", run_table)):
        if given.name in (None, name):
            texts[name] = work()
            print(texts[name], flush=True)
    if given.name is None:
        told = f"{versions('starlette', 'uvicorn', 'eclipse-zenoh')}; load {os.getloadavg()[0]:.1f}; once"
        put("site", "\n\n".join([told, *texts.values()]))


@contextmanager
def site_process(folder: Path, endpoint: str, *more: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`stopgo site` in a process of its own, and the address that it prints."""
    site = subprocess.Popen(
        [sys.executable, "-m", "stopgo", "site", str(folder), "--connect", endpoint, "--as", "anna", *more],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, "XDG_STATE_HOME": str(folder / "state")},
    )  # fmt: skip
    try:
        assert site.stdout is not None
        yield site, site.stdout.readline().split(": ", 1)[1].strip()
    finally:
        site.kill()
        site.wait()


@contextmanager
def robot_process(folder: Path, port: int, mission: Mission, *more: str) -> Iterator[subprocess.Popen[bytes]]:
    """A simulated robot in a process of its own, which holds a mission."""
    endpoint = f"tcp/127.0.0.1:{port}"
    command = ["robot", "--name", "r1", "--listen", endpoint, "--state", str(folder / "r1"), *more]
    robot = subprocess.Popen(
        [sys.executable, "-m", "stopgo", *command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        with connect(endpoint, robot="r1", timeout_s=30, commander="anna") as station:
            station.push(mission)
        yield robot
    finally:
        robot.kill()
        robot.wait()


def links_table() -> str:
    """Delays of events and of STOP over each line."""
    head = ["line", "events", "told until shown: median, 99 % ms", "STOP pressed until stored: median, worst ms",
            "until the page shows the answer: median, worst ms", "allowed ms"]  # fmt: skip
    rows = []
    for name, bits_per_s, delay_s in LINKS:
        with tempfile.TemporaryDirectory() as place, browser() as chromium:
            port, scan = free_port(), Scan(profile="default", duration_s=0.5, timeout_s=9.0)
            mission = corridor(stops=200, settle_s=0.2, scan=scan)
            with (
                robot_process(Path(place), port, mission),
                Proxy(port, bits_per_s=bits_per_s, delay_s=delay_s) as line,
                site_process(Path(place), line.endpoint) as (_, address),
            ):
                tab = chromium.tab(address)
                rows.append([name, *_on_the_line(tab), f"{2e3 * delay_s + 100:.0f}"])
    return table(head, rows)


def _on_the_line(tab: Tab) -> list[object]:
    """Drive, press STOP and resume ten times, and return the delays."""
    tab.until("document.querySelector('.card .state')?.textContent === 'ready'")
    tab.run(EVENTS)
    tab.until(
        "store.get('mission', 'r1')"
    )  # its transfer, once for each revision, would delay the first event
    tab.press("Start")
    pressed, heard = [], []
    for _ in range(PRESSES):
        tab.until("document.querySelector('.card .state')?.textContent === 'running'")
        time.sleep(4)
        pressed.append(tab.run("(document.getElementById('stop').click(), Date.now())"))
        heard.append(tab.until(
            f"(() => {{ const one = store.get('stop', 'r1'); return one?.outcome === 'ok' && "
            f"one.sent_at * 1000 >= {pressed[-1] - 50} && Date.now(); }})()"
        ))  # fmt: skip
        tab.until("document.querySelector('.card .state')?.textContent === 'paused'")
        tab.press("Resume")
    shown = tab.run("[...window.shown.values()]")
    stored = [at for kind, at, _ in shown if kind == "Paused"]
    stops = [at - began for at, began in zip(stored, pressed, strict=True)]
    answers = [at - began for at, began in zip(heard, pressed, strict=True)]
    delays = sorted(seen - at for _, at, seen in shown)
    return [
        len(delays), f"{statistics.median(delays):.0f}, {delays[int(0.99 * len(delays))]:.0f}",
        f"{statistics.median(stops):.0f}, {max(stops):.0f}",
        f"{statistics.median(answers):.0f}, {max(answers):.0f}",
    ]  # fmt: skip


def run_table() -> str:
    """A run of four hours: one page sleeps for an hour of it, the server is killed, the robot is off."""
    with tempfile.TemporaryDirectory() as place, browser() as chromium:
        folder, port, page = Path(place), free_port(), ("--port", str(free_port()))
        mission, endpoint = corridor(stops=LONG_STOPS, scan=LONG_SCAN), f"tcp/127.0.0.1:{port}"
        fast = ("--speed-up", str(LONG_SPEED_UP), "--endurance", "0")
        with robot_process(folder, port, mission, *fast) as robot:
            with site_process(folder, endpoint, *page) as (_, address):
                awake = chromium.tab(address)
                awake.until("document.querySelector('.card .state')?.textContent === 'ready'")
                awake.run(EVENTS)
                awake.press("Start")
                sleeper = chromium.tab(address.partition("#")[0])
                sleeper.until("document.querySelectorAll('.events li').length > 9")
                sleeper.run(EVENTS)
                sleep = _sleep(sleeper)
                missed = len(awake.run(NUMBERS))
            time.sleep(3)
            with site_process(folder, endpoint, *page) as (site, _):
                restarted = time.monotonic()
                awake.until(f"document.getElementById('offline').hidden && {NUMBERS}.length > {missed}")
                caught_up_s = time.monotonic() - restarted
                busy, began = cpu(site.pid), time.monotonic()
                awake.until(FINISHED, within_s=600)
                load = 100 * (cpu(site.pid) - busy) / (time.monotonic() - began)
                sleeper.until(FINISHED, within_s=60)
                numbers = [tab.run(NUMBERS) for tab in (awake, sleeper)]
                awake.run(POSES.replace("COUNT", str(4 * 3600 * 10)))
                page_mb = private_mb(chromium)
                off = _robot_off(awake, robot)
        gaps = [len(range(found[0], found[-1] + 1)) - len(found) for found in numbers]
        rows = [
            ["events of the run, in both tabs", f"{len(numbers[0])}, {len(numbers[1])}; missing {gaps[0]}, {gaps[1]}"],
            ["one tab frozen for an hour of the run: events missed, then shown after", sleep],
            ["server killed, started again after 3 s: page caught up after its start", f"{caught_up_s:.1f} s"],
            ["load of the server at 120 times real time", f"{load:.0f} % of one core"],
            ["memory of the largest page after it, and after 144 000 poses more", f"{page_mb:.0f} MB"],
            ["robot switched off: shown as old after, STOP shown as unknown after", off],
        ]  # fmt: skip
        return table(["four hours", "figure"], rows)


LONG_SCAN = Scan(profile="default", duration_s=24.0, timeout_s=60.0)
FINISHED = "document.querySelector('.card .state')?.textContent === 'finished' && store.all('event', 'r1').some((one) => one.value.event === 'Finished')"
POSES = """(() => { for (let k = 0; k < COUNT; k++) store.take({ fresh: false, items: [
  { key: ['pose', 'r1'], age_ms: 0, value: { x: k / 1e4, y: 0, heading: 0, speed: 0.5 } }] }); })()"""


def _sleep(tab: Tab) -> str:
    """Freeze a tab as a browser does with one that is not looked at, and wake it."""
    before = len(tab.run(NUMBERS))
    tab.call("Page.setWebLifecycleState", state="frozen")
    time.sleep(ASLEEP_S)
    tab.call("Page.setWebLifecycleState", state="active")
    woken = time.monotonic()
    tab.until(f"Date.now() - Math.max(...[...window.shown.values()].map((one) => one[2])) < 300 "
              f"&& {NUMBERS}.length > {before} + 20")  # fmt: skip
    took = time.monotonic() - woken
    return f"{len(tab.run(NUMBERS)) - before}, {1000 * took:.0f} ms"


def _robot_off(tab: Tab, robot: subprocess.Popen[bytes]) -> str:
    """Kill the robot; return when the page shows its state as old, and STOP as unknown."""
    robot.kill()
    began = time.monotonic()
    tab.until("document.querySelector('.card.old')")
    old_s = time.monotonic() - began
    pressed = time.monotonic()
    tab.run("document.getElementById('stop').click()")
    tab.until("document.querySelector('#stopped .bad')")
    return f"{old_s:.1f} s, {time.monotonic() - pressed:.1f} s"


def private_mb(chromium: Browser) -> float:
    """Memory of the largest renderer process that no other process shares, MB."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if chromium.profile.encode() in path.read_bytes() and b"--type=renderer" in path.read_bytes():
                rollup = path.with_name("smaps_rollup").read_text()
                found.append(
                    sum(int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Private_"))
                )
        except OSError:
            continue
    return max(found) / 1e3


def load_table() -> str:
    """20 robots that report at 10 Hz."""
    given = argparse.Namespace(robots=20, hertz=10.0, seconds=20.0)
    endpoint, stopped = f"tcp/127.0.0.1:{free_port()}", threading.Event()
    with tempfile.TemporaryDirectory() as folder, listening(endpoint) as link:
        answered: list[float] = []
        for number in range(given.robots):
            threading.Thread(
                target=report, args=(link, number, given.hertz, stopped, answered), daemon=True
            ).start()
        try:
            with site_process(Path(folder), endpoint) as (site, address):
                return measure(address, site.pid, given, answered)
        finally:
            stopped.set()


def report(link: Any, number: int, hertz: float, stopped: threading.Event, answered: list[float]) -> None:
    """Be a robot that stands, reports, and answers."""
    keys, boot, seq = KeyExpressions(f"r{number:02}"), "b1", 0

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


def measure(address: str, pid: int, given: argparse.Namespace, answered: list[float]) -> str:
    """Return the table of the load."""
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
        head = ["robots", "Hz", "poses shown/s", "pose told until shown: median, 99 % ms",
                "STOP pressed until the last has it: median, worst ms", "server, % of a core", "server MB",
                "page MB"]  # fmt: skip
        row = [
            given.robots, given.hertz, len(delays) / given.seconds,
            f"{statistics.median(delays):.0f}, {delays[int(0.99 * len(delays))]:.0f}",
            f"{statistics.median(presses):.0f}, {max(presses):.0f}", 100 * load, memory(pid),
            private_mb(chromium),
        ]  # fmt: skip
        return table(head, [row])


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
