"""Measures the link: commands per second, large missions on a slow link, and the load of an idle robot.

Run: python -m benchmarks.bridge [--keys]; one line per figure, medians and p99. With --far instead: pushes
and pauses on a line of long round trips, several chunks in flight and, as formerly, one. With --stops: how
long `pause` and `abort` take, alone, during a push of 10 MB by another process, and on a full disk; --former
DIR has a former version's checkout measured in the same run.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path

import msgspec

from benchmarks.table import lines_put
from stopgo.bridge.commands.spawn import end_robot, robot_process, start_robot
from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import now_utc
from stopgo.bridge.station.station import Station, connect
from stopgo.bridge.station.window import Window
from stopgo.mission.console.ports import free_port
from stopgo.mission.document import Mission, with_digest
from stopgo.mission.run.run_commands import Verb
from tests.bridge.proxy import Proxy
from tests.bridge.world import corridor
from tests.faults.full_disk import fill

ORDERS = 1000
THIS = (sys.executable, "-m", "benchmarks.bridge")
ALONE = 100
"""Bytes of each stop alone."""
STOPS_OF_10_MB = 9_000
POINTS_BETWEEN = 50
FAR_BITS_PER_S, FAR_S = 8e6, 0.3
FAR_STOPS = (2_000, 9_000)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--keys", action="store_true", help="measure mTLS with signed orders")
    options.add_argument("--far", action="store_true", help="measure a line of 8 Mbit/s and 300 ms")
    options.add_argument("--stops", action="store_true", help="measure `pause` and `abort`")
    options.add_argument("--former", type=Path, help="checkout of a former version, for --stops")
    options.add_argument("--disk", nargs=3, help=argparse.SUPPRESS)
    options.add_argument("--push", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.disk is not None:
        stops_on_a_full_disk(*given.disk)
        return
    if given.push is not None:
        push_of_10_mb(given.push)
        return
    with tempfile.TemporaryDirectory() as folder:
        if given.stops:
            stops(Path(folder), given.former)
        elif given.far:
            far(Path(folder))
        else:
            with lines_put("bridge"):
                measure(Path(folder), with_keys=given.keys)


def measure(folder: Path, *, with_keys: bool) -> None:
    extra, keys, protocol = ["--endurance", "0"], None, "tcp"
    if with_keys:
        init_site(folder / "keys", now=now_utc())
        issue(folder / "keys", "robot", "r1", now=now_utc())
        issue(folder / "keys", "station", "alice", now=now_utc())
        extra, keys, protocol = (
            [*extra, "--keys", str(folder / "keys" / "r1")],
            folder / "keys" / "alice",
            "tls",
        )
    port = free_port()
    robot = start_robot("r1", folder / "state", listen=f"{protocol}/127.0.0.1:{port}", extra=extra)
    try:
        print(f"link: {protocol}")
        with connect(f"{protocol}/127.0.0.1:{port}", robot="r1", keys=keys) as station:
            station.push(corridor())
            tell("info", [timed(station.info) for _ in range(ORDERS)])
            tell("order, refused and journalled", [order_time(station) for _ in range(ORDERS)])
        at_rest(robot.pid)
        with Proxy(port, bits_per_s=8e6) as proxy:
            endpoint = f"{protocol}/127.0.0.1:{proxy.port}"
            with connect(endpoint, robot="r1", keys=keys, timeout_s=20) as station:
                slow_push(station)
    finally:
        end_robot(robot)


def order_time(station: Station) -> float:
    """Seconds from sending a command to its stored answer; `retry` in READY is refused, and stored."""
    order = station.order("retry")
    payload = msgspec.json.encode(order)
    return timed(lambda: station.link.ask(station.keys.command("retry"), payload, timeout_s=1))


def winding(mission: Mission) -> Mission:
    """The same with paths of many points, because no mission may extend beyond 20 km."""
    stops = tuple(
        msgspec.structs.replace(
            stop,
            approach=tuple(
                (stop.approach[0][0] + 2.0 * step / POINTS_BETWEEN, 0.0) for step in range(POINTS_BETWEEN + 1)
            ),
        )
        for stop in mission.stops
    )
    return with_digest(msgspec.structs.replace(mission, stops=stops))


def slow_push(station: Station) -> None:
    """A document of about 10 MB at 8 Mbit/s, with queries during the transfer."""
    mission = winding(corridor(stops=STOPS_OF_10_MB, revision=2))
    size = len(msgspec.json.encode(mission))
    latencies: list[float] = []
    reading: list[float] = []
    sent, pushed = threading.Event(), threading.Event()

    def ask_now_and_then() -> None:
        while not pushed.wait(0.05):
            (reading if sent.is_set() else latencies).append(timed(station.info))

    asking = threading.Thread(target=ask_now_and_then)
    asking.start()
    began = time.monotonic()
    station.push(mission, progress=lambda held, size: sent.set() if held == size else None)
    seconds = time.monotonic() - began
    pushed.set()
    asking.join()
    print(f"push of {size / 1e6:.1f} MB at 8 Mbit/s: {seconds:.1f} s; the line alone {size * 8 / 8e6:.1f} s")
    tell("info meanwhile", latencies)
    tell("info while the robot reads the document", reading)


@contextmanager
def one_by_one() -> Iterator[None]:
    """Every chunk waits for the answer to the previous one, as in the former version."""
    size = Window.size
    Window.size = property(lambda window: 1)  # type: ignore[assignment, method-assign]
    try:
        yield
    finally:
        Window.size = size  # type: ignore[method-assign]


def far(folder: Path) -> None:
    """Rows of the table in benchmarks/SURVEYS.md."""
    revisions = count(2)
    print("| document | under way | pieces s | of the line | pause: n | median ms | p99 ms | greatest ms |")
    print("|---|---|---|---|---|---|---|---|")
    with robot_process("r1", folder / "state", extra=["--endurance", "0"]) as endpoint:
        with connect(endpoint, robot="r1") as station:
            station.push(corridor())
        with (
            Proxy(int(endpoint.rpartition(":")[2]), bits_per_s=FAR_BITS_PER_S, delay_s=FAR_S / 2) as proxy,
            connect(proxy.endpoint, robot="r1", timeout_s=30) as station,
        ):
            for stops in FAR_STOPS:
                with one_by_one():
                    far_push(station, stops, next(revisions), "one")
                far_push(station, stops, next(revisions), "several")


def far_push(station: Station, stops: int, revision: int, under_way: str) -> None:
    """One push, with pause commands while its chunks are in transit."""
    mission = winding(corridor(stops=stops, revision=revision))
    size = len(msgspec.json.encode(mission))
    pauses: list[float] = []
    sent, began, ended = threading.Event(), [0.0], [0.0]

    def told(held: int, whole: int) -> None:
        began[0] = began[0] or time.monotonic()
        ended[0] = time.monotonic()
        if held == whole:
            sent.set()

    def pause_now_and_then() -> None:
        while not sent.wait(0.05):
            pauses.append(timed(lambda: station.link.ask(*pause(station), timeout_s=10)))

    pausing = threading.Thread(target=pause_now_and_then)
    pausing.start()
    station.push(mission, progress=told)
    pausing.join()
    took, alone = ended[0] - began[0], size * 8 / FAR_BITS_PER_S
    ordered = sorted(pauses)
    p99, median = ordered[min(len(ordered) - 1, int(len(ordered) * 0.99))], statistics.median(ordered)
    print(
        f"| {size / 1e6:.1f} MB | {under_way} | {took:.1f} | {alone / took:.0%} | {len(ordered)}"
        f" | {median * 1e3:.0f} | {p99 * 1e3:.0f} | {ordered[-1] * 1e3:.0f} |"
    )


def stops(folder: Path, former: Path | None) -> None:
    """Rows of another table in benchmarks/SURVEYS.md: the former version and this one, in turn."""
    print("| version | line | beside | order | n | median ms | p99 ms | greatest ms |", flush=True)
    print("|---|---|---|---|---|---|---|---|", flush=True)
    for name, checkout in (("former", former), ("present", Path.cwd())):
        if checkout is None:
            continue
        for line, delay_s in (("no delay", None), ("8 Mbit/s, 300 ms", FAR_S / 2)):
            stops_on(folder / f"{name}-{delay_s}", f"{name} | {line}", checkout, delay_s)
        full = folder / f"{name}-full"
        full.mkdir()
        measuring = ["unshare", "-rm", *THIS, "--disk", str(full), name, str(checkout)]
        subprocess.run(measuring, check=True)


@contextmanager
def running_from(checkout: Path, state: Path) -> Iterator[str]:
    """A robot of this checkout's version; yields its endpoint."""
    here = Path.cwd()
    os.chdir(checkout)
    try:
        with robot_process("r1", state, extra=["--endurance", "3e6"]) as endpoint:
            os.chdir(here)
            yield endpoint
    finally:
        os.chdir(here)


def stops_on(folder: Path, row: str, checkout: Path, delay_s: float | None) -> None:
    """`pause` and `abort` alone and during a push, over one link."""
    with running_from(checkout, folder) as endpoint:
        with connect(endpoint, robot="r1") as station:
            station.push(corridor())
        port = int(endpoint.rpartition(":")[2])
        bits = None if delay_s is None else FAR_BITS_PER_S
        with (
            Proxy(port, bits_per_s=bits, delay_s=delay_s or 0.0) as proxy,
            connect(proxy.endpoint, robot="r1", timeout_s=30) as station,
        ):
            alone = iter(range(ALONE))
            tell_stops(f"{row} | alone", stopping(station, lambda: next(alone, None) is None))
            with subprocess.Popen(
                [*THIS, "--push", proxy.endpoint], stdout=subprocess.PIPE, text=True
            ) as pushing:
                assert pushing.stdout is not None
                pushing.stdout.readline()
                tell_stops(f"{row} | push of 10 MB", stopping(station, lambda: pushing.poll() is not None))
            assert pushing.returncode == 0


def push_of_10_mb(endpoint: str) -> None:
    """Report the start."""
    mission = winding(corridor(stops=STOPS_OF_10_MB, revision=2))
    with connect(endpoint, robot="r1", commander="another", timeout_s=60) as station:
        print("begins", flush=True)
        station.push(mission, take_over=True)


def stopping(station: Station, over: Callable[[], bool]) -> dict[str, list[float]]:
    """Seconds of pause commands, one after the other, until the transfer ends."""
    took: dict[str, list[float]] = {"pause": [], "abort": []}
    while not over():
        for verb, seconds in took.items():
            seconds.append(timed(lambda verb=verb: station.link.ask(*a_stop(station, verb), timeout_s=20)))
            time.sleep(0.02)
    return took


def tell_stops(row: str, took: dict[str, list[float]]) -> None:
    for verb, seconds in took.items():
        ordered = sorted(seconds)
        p99 = ordered[min(len(ordered) - 1, int(len(ordered) * 0.99))]
        middle, greatest = statistics.median(ordered), ordered[-1]
        print(
            f"| {row} | `{verb}` | {len(ordered)} | {middle * 1e3:.0f} | {p99 * 1e3:.0f}"
            f" | {greatest * 1e3:.0f} |", flush=True,
        )  # fmt: skip


def stops_on_a_full_disk(at: str, name: str, checkout: str) -> None:
    """The same in a namespace of its own, on a disk of 16 MB that is filled to the last byte."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", at], check=True)
    with (
        running_from(Path(checkout), Path(at) / "state") as endpoint,
        connect(endpoint, robot="r1", timeout_s=30.0) as station,
    ):
        station.push(corridor())
        asked = iter(range(2 * ALONE))

        def over() -> bool:
            """Fill the space that a pause command, or the space reserved for these, left free."""
            fill(Path(at) / "ballast")
            return next(asked, None) is None

        for _ in range(3):
            over()
            station.link.ask(*a_stop(station, "pause"), timeout_s=20)
        tell_stops(f"{name} | no delay | full disk", stopping(station, over))


def a_stop(station: Station, verb: Verb) -> tuple[str, bytes]:
    return station.keys.command(verb), msgspec.json.encode(station.stop_order(verb))


def pause(station: Station) -> tuple[str, bytes]:
    """Key expression and payload of a pause; in READY it is refused, and stored."""
    return a_stop(station, "pause")


def at_rest(pid: int, seconds: float = 10.0) -> None:
    before, began = cpu_s(pid), time.monotonic()
    time.sleep(seconds)
    share = (cpu_s(pid) - before) / (time.monotonic() - began)
    memory = int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * resource.getpagesize() / 1e6
    print(f"robot at rest: {share:.2%} of a core, {memory:.0f} MB")


def cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timed(act: Callable[[], object]) -> float:
    began = time.perf_counter()
    act()
    return time.perf_counter() - began


def tell(what: str, seconds: list[float]) -> None:
    ordered = sorted(seconds)
    p99 = ordered[min(len(ordered) - 1, int(len(ordered) * 0.99))]
    print(
        f"{what}: n {len(ordered)}, median {statistics.median(ordered) * 1e3:.2f} ms, p99 {p99 * 1e3:.2f} ms,"
        f" greatest {ordered[-1] * 1e3:.1f} ms"
    )


if __name__ == "__main__":
    main()
