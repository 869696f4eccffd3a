"""Measures the time from `pause` until the robot brakes and until the answer, by version, session and fault.

Run: python -m benchmarks.stop_latency [--former DIR] [--sessions open,shared,one-shot] [--faults none,...]; DIR
is a former version's checkout, measured in the same run. Robot and station have keys. It needs strace, and a
user who may mount a small disk (`unshare -rm`). *shared* is `stopgo pause` through `stopgo session`. Poses come
every 50 ms, so braking is that exact.
"""

from __future__ import annotations

import argparse
import os
import socket
import ssl
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from benchmarks.slow_disk import SLOWER, one_leg, pose_in, slow_syncs, until
from stopgo.bridge.commands.spawn import end_robot, start_robot
from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.station.station import Station, connect
from stopgo.mission.console.ports import free_port
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.errors import NegativeResult, OutcomeUnknown
from stopgo.mission.run.events import PoseReport
from tests.bridge.proxy import Proxy
from tests.bridge.world import corridor
from tests.faults.full_disk import fill

THIS = (sys.executable, "-m", "benchmarks.stop_latency")
FLOOD_PER_S = 200
MOST_HELD = 500
"""Connections that the flood holds open at a time."""
PUSHED_STOPS = 9_000
LEG_M = 500.0
"""No trial reaches the end of the leg."""


@dataclass(frozen=True)
class Fault:
    """Disturbance while a robot is paused, and the number of trials."""

    name: str
    trials: int
    sync_s: float = 0.0
    delay_s: float = 0.0
    """Delay of the link, each way."""
    floods: str = ""
    """Connections a stranger opens: `silent` or `half-open`."""
    pushes: bool = False
    full: bool = False


FAULTS = (
    Fault("none", 30),
    Fault("push of 10 MB", 15, pushes=True),
    Fault("full disk", 15, full=True),
    Fault("300 ms round trip", 15, delay_s=0.15),
    Fault("200 silent connects a second", 30, floods="silent"),
    Fault("200 half-open handshakes a second", 30, floods="half-open"),
    Fault("sync 0.5 s", 10, sync_s=0.5),
    Fault("sync 5 s", 3, sync_s=5.0),
)
Trial = tuple[float, float, float] | None
"""Seconds until the robot brakes, metres until it stands, seconds until the answer; `None` without answer."""


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--sessions", default="open,shared,one-shot")
    options.add_argument("--faults", default=",".join(fault.name for fault in FAULTS))
    options.add_argument("--former", type=Path, help="checkout of a former version")
    options.add_argument("--push", nargs=2, help=argparse.SUPPRESS)
    options.add_argument("--flood", nargs=2, help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.push:
        push_again_and_again(*given.push)
    if given.flood:
        flood(int(given.flood[0]), given.flood[1])
    print("| fault | version | session | n | no answer | brakes after, s | driven, m | answered after, s |")
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for fault in (fault for fault in FAULTS if fault.name in given.faults.split(",")):
        for name, checkout in (("former", given.former), ("present", Path.cwd())):
            for session in given.sessions.split(",") if checkout is not None else ():
                if (name, session) != ("former", "shared"):
                    row = f"| {fault.name} | {name} | {session}"
                    tell(row, Robot(checkout, session, fault).trials())


def tell(row: str, trials: Sequence[Trial]) -> None:
    """Print a row: median, p99 and greatest of each figure."""
    answered = [trial for trial in trials if trial is not None]
    cells = []
    for column in zip(*answered, strict=True):
        ordered = sorted(column)
        shown = (ordered[len(ordered) // 2], ordered[int(len(ordered) * 0.99)], ordered[-1])
        cells.append(" / ".join(f"{value:.2f}" for value in shown))
    cells = cells or ["-"] * 3
    print(f"{row} | {len(trials)} | {len(trials) - len(answered)} | {' | '.join(cells)} |", flush=True)


@dataclass
class Robot:
    """A robot of a version, and the session and fault with which it is paused."""

    checkout: Path
    session: str
    fault: Fault

    @property
    def count(self) -> int:
        """Number of trials; fewer of a former version."""
        return self.fault.trials if self.checkout == Path.cwd() else max(3, self.fault.trials // 3)

    def trials(self) -> list[Trial]:
        """Pause the robot again and again."""
        with ExitStack() as opened:
            folder = Path(opened.enter_context(tempfile.TemporaryDirectory()))
            os.environ["XDG_STATE_HOME"] = str(folder)
            self.disk = opened.enter_context(small_disk(folder / "disk", used=self.fault.full))
            self.keys = keys_in(folder / "keys")
            endpoint, number = opened.enter_context(self.running())
            station = opened.enter_context(connect(endpoint, robot="r1", keys=self.keys / "bench"))
            station.push(one_leg(LEG_M))
            self.endpoint, used = endpoint, station
            port = int(endpoint.rpartition(":")[2])
            if self.fault.delay_s:
                proxy = opened.enter_context(Proxy(port, delay_s=self.fault.delay_s))
                self.endpoint = proxy.endpoint.replace("tcp/", "tls/")
                used = opened.enter_context(connect(self.endpoint, robot="r1", keys=self.keys / "bench"))
            if self.session == "shared":
                opened.enter_context(self.shared_session())
            poses: list[tuple[float, PoseReport]] = []
            station.link.hear(
                station.keys.pose, lambda key, raw: poses.append((time.monotonic(), pose_in(raw)))
            )
            station.command("start")
            if self.fault.floods:
                opened.enter_context(beside("--flood", str(port), self.fault.floods))
            if self.fault.pushes:
                opened.enter_context(beside("--push", endpoint, str(self.keys / "other")))
            return [self.trial(station, used, number, poses) for _ in range(self.count)]

    def trial(
        self, station: Station, used: Station, number: int, poses: list[tuple[float, PoseReport]]
    ) -> Trial:
        until(lambda: bool(poses) and poses[-1][1].speed > 0.49)
        if self.fault.full:
            fill(self.disk / "ballast")
        with slow_syncs(number, self.fault.sync_s):
            sent_s = time.monotonic()
            is_answered = self.pause(used)
            answered_s = time.monotonic()
            if not is_answered:
                station.give(station.stop_order("pause"), within_s=60.0)
            until(lambda: poses[-1][1].speed < 0.001)
        after = [(at_s, report) for at_s, report in poses if at_s >= sent_s]
        if self.fault.full:
            (self.disk / "ballast").unlink()
        self.go_on(station)
        if not is_answered:
            return None
        brakes_s = next(at_s for at_s, report in after if report.speed < SLOWER) - sent_s
        return brakes_s, after[-1][1].pose.x - after[0][1].pose.x, answered_s - sent_s

    def pause(self, used: Station) -> bool:
        """Pause the robot by the session; true if it was answered."""
        if self.session == "open":
            used.give(used.stop_order("pause"), within_s=60.0)
            return True
        command = [sys.executable, "-m", "stopgo", "pause", "--robot", "r1", "--connect", self.endpoint]
        slow = ["--timeout", "60"] if self.fault.sync_s else []
        result = subprocess.run(
            [*command, "--keys", str(self.keys / "bench"), *slow], cwd=self.checkout, check=False,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return result.returncode == 0

    def go_on(self, station: Station) -> None:
        """Resume the run."""
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            with suppress(NegativeResult, OutcomeUnknown):
                station.command("resume")
                return
            time.sleep(0.2)

    @contextmanager
    def running(self) -> Iterator[tuple[str, int]]:
        """The robot's process: its endpoint and number."""
        here, endpoint = Path.cwd(), f"tls/127.0.0.1:{free_port()}"
        os.chdir(self.checkout)
        try:
            process = start_robot(
                "r1", self.disk / "r1", listen=endpoint, extra=["--keys", str(self.keys / "r1")]
            )
        finally:
            os.chdir(here)
        try:
            yield endpoint, process.pid
        finally:
            end_robot(process)

    @contextmanager
    def shared_session(self) -> Iterator[None]:
        """Hold a session open, which the command uses."""
        command = [sys.executable, "-m", "stopgo", "session", "--robot", "r1", "--connect", self.endpoint]
        with subprocess.Popen(
            [*command, "--keys", str(self.keys / "bench")], stdout=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            try:
                yield
            finally:
                process.terminate()


def keys_in(folder: Path) -> Path:
    """Keys of a robot and two stations."""
    init_site(folder, now=now_utc())
    issue(folder, "robot", "r1", now=now_utc())
    for name in ("bench", "other"):
        issue(folder, "station", name, now=now_utc())
    return folder


@contextmanager
def small_disk(folder: Path, *, used: bool) -> Iterator[Path]:
    """A folder, with a disk of 16 MB of its own if it is used."""
    folder.mkdir()
    if not used:
        yield folder
        return
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@contextmanager
def beside(*arguments: str) -> Iterator[None]:
    """Run a part of this program in a process of its own."""
    with subprocess.Popen([*THIS, *arguments], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        try:
            yield
        finally:
            process.terminate()


def push_again_and_again(endpoint: str, keys: str) -> None:
    """Push revisions of 10 MB until the process is ended."""
    revision = 1
    with connect(endpoint, robot="r1", keys=Path(keys), timeout_s=60) as station:
        print("begins", flush=True)
        while True:
            revision += 1
            with suppress(NegativeResult, OutcomeUnknown):
                station.push(extended(revision))


def extended(revision: int) -> Mission:
    """The mission of one stop, and thousands more after it."""
    first = one_leg(LEG_M)
    more = corridor(stops=PUSHED_STOPS, closed=False).stops[1:]
    x = first.stops[0].x
    stops = [
        msgspec.structs.replace(stop, x=stop.x + x, approach=tuple((at + x, y) for at, y in stop.approach))
        for stop in more
    ]
    stops[0] = msgspec.structs.replace(stops[0], approach=((x, 0.0), stops[0].approach[-1]))
    return with_digest(msgspec.structs.replace(first, revision=revision, stops=(first.stops[0], *stops)))


def flood(port: int, kind: str) -> None:
    """Open connections from many loopback addresses, and hold them, until the process is ended."""
    hello = client_hello() if kind == "half-open" else b""
    held: list[socket.socket] = []
    unsent: list[socket.socket] = []
    began_s, count = time.monotonic(), 0
    print("begins", flush=True)
    while True:
        while count < (time.monotonic() - began_s) * FLOOD_PER_S:
            count += 1
            one = socket.socket()
            one.setblocking(False)
            one.bind((f"127.0.{1 + count // 250 % 250}.{1 + count % 250}", 0))
            one.connect_ex(("127.0.0.1", port))
            held.append(one)
            unsent.append(one)
            if len(held) > MOST_HELD:
                held.pop(0).close()
        while unsent:
            with suppress(OSError):
                unsent.pop().send(hello)
        time.sleep(0.01)


def client_hello() -> bytes:
    """Return the first message of a TLS handshake."""
    sent, received = ssl.MemoryBIO(), ssl.MemoryBIO()
    context = ssl.create_default_context()
    with suppress(ssl.SSLWantReadError):
        context.wrap_bio(received, sent, server_hostname="localhost").do_handshake()
    return sent.read()


if __name__ == "__main__":
    main()
