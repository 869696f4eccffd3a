"""The process that stops a vehicle: after a kill, a freeze, and not otherwise."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.driving.stop_guard import is_available
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
from stopgo.mission.mavlink.telemetry import Message
from tests.waiting import wait_until

pytestmark = [
    pytest.mark.skipif(not is_available(), reason="no descriptors over sockets here"),
    pytest.mark.skipif(sys.platform != "linux", reason="signals of Linux"),
]

DRIVER = """
import sys, time
from types import SimpleNamespace
from stopgo.bridge.mavlink.driving import stop_guard
from stopgo.bridge.mavlink.driving.stop_guard import StopGuard
from stopgo.bridge.mavlink.vehicle_link.url import read_url
from stopgo.bridge.mavlink.vehicle_link.wire import Who, wire
from stopgo.mission.mavlink.autopilots.ardupilot import ARDUPILOT
def scarce(started, name):
    # The first new process cannot be started.
    stop_guard._started = started
    raise OSError(24, "Too many open files")

drives, key = sys.argv[2] == "drives", bytes.fromhex(sys.argv[3]) or None
with wire(read_url(sys.argv[1]), me=Who(253, 191), signing_key=key) as opened:
    if sys.argv[1].startswith("udpin"):
        while not opened._transport._peers:
            time.sleep(0.01)
    peer = SimpleNamespace(who=Who(1, 1), autopilot=ARDUPILOT, wire=opened)
    guard = StopGuard(peer, lambda: drives, lambda: print("stopped", flush=True))
    time.sleep(0.3)
    print("ready", flush=True)
    for line in sys.stdin:
        if line == "scarce\\n":
            stop_guard._started, started = lambda name: scarce(started, name), stop_guard._started
            print("scarce", flush=True)
            continue
        if line == "close\\n":
            guard.close()
            print("closed", flush=True)
            break
        print(guard.pid, flush=True)
"""


@contextmanager
def driver(url: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-c", DRIVER, url, *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.kill()


def ready(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"


def answer(process: subprocess.Popen[str], line: str) -> str:
    """The next line of output, after a line of input."""
    assert process.stdin is not None and process.stdout is not None
    process.stdin.write(line + "\n")
    process.stdin.flush()
    return process.stdout.readline()


def guard_of(process: subprocess.Popen[str]) -> int:
    return int(answer(process, "pid"))


@pytest.fixture
def vehicle() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(10.0)
        yield listening


def url_of(vehicle: socket.socket) -> str:
    return f"udpout:127.0.0.1:{vehicle.getsockname()[1]}"


def holds(vehicle: socket.socket, coder: dialect.MAVLink) -> list[Message]:
    """The messages of the next datagram."""
    return list(coder.parse_buffer(bytearray(vehicle.recv(2048))) or ())


def is_hold(message: Message) -> bool:
    params = (message.param1, message.param2, message.param3)
    return message.command == dialect.MAV_CMD_DO_SET_MODE and params == ARDUPILOT.modes.hold.params


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_program_that_is_killed_or_frozen_while_it_drives_leaves_a_vehicle_on_hold(
    vehicle: socket.socket, how: signal.Signals
) -> None:
    coder = dialect.MAVLink(None)
    with driver(url_of(vehicle), "drives", "") as process:
        ready(process)
        os.kill(process.pid, how)
        messages = [message for _ in range(3) for message in holds(vehicle, coder)]
        assert len(messages) == 3 and all(map(is_hold, messages))
        assert {message.get_srcSystem() for message in messages} == {253}
        if how == signal.SIGSTOP:
            os.kill(process.pid, signal.SIGCONT)
            assert process.stdout is not None and process.stdout.readline() == "stopped\n"


def test_the_next_program_is_ready_once_the_former_guard_has_sent_its_last_hold(
    vehicle: socket.socket,
) -> None:
    with driver(url_of(vehicle), "drives", "") as former:
        ready(former)
        former.kill()
        former.wait()
        assert is_hold(holds(vehicle, dialect.MAVLink(None))[0])
        with driver(url_of(vehicle), "stands", "") as process:
            ready(process)
            while select.select([vehicle], [], [], 0)[0]:
                vehicle.recv(2048)
            vehicle.settimeout(1.0)
            with pytest.raises(TimeoutError):
                vehicle.recv(2048)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_guard_that_was_killed_or_frozen_is_replaced(vehicle: socket.socket, how: signal.Signals) -> None:
    with driver(url_of(vehicle), "drives", "") as process:
        ready(process)
        first = guard_of(process)
        os.kill(first, how)
        wait_until(lambda: guard_of(process) != first)
        process.kill()
        assert is_hold(holds(vehicle, dialect.MAVLink(None))[0])


def test_a_guard_that_cannot_be_started_again_at_once_is_started_later(vehicle: socket.socket) -> None:
    with driver(url_of(vehicle), "drives", "") as process:
        ready(process)
        first = guard_of(process)
        assert answer(process, "scarce") == "scarce\n"
        os.kill(first, signal.SIGKILL)
        wait_until(lambda: guard_of(process) != first)
        process.kill()
        assert is_hold(holds(vehicle, dialect.MAVLink(None))[0])


def test_a_guard_that_is_frozen_does_not_keep_the_program_from_its_end(vehicle: socket.socket) -> None:
    with driver(url_of(vehicle), "stands", "") as process:
        ready(process)
        frozen = guard_of(process)
        os.kill(frozen, signal.SIGSTOP)
        assert answer(process, "close") == "closed\n"
        with pytest.raises(ProcessLookupError):
            os.kill(frozen, 0)


def test_signed_frames_are_accepted_one_after_another(vehicle: socket.socket) -> None:
    coder = dialect.MAVLink(None)
    coder.signing.secret_key = bytes(range(32))
    with driver(url_of(vehicle), "drives", bytes(range(32)).hex()) as process:
        ready(process)
        process.kill()
        messages = [message for _ in range(3) for message in holds(vehicle, coder)]
    assert [message.get_type() for message in messages] == ["COMMAND_LONG"] * 3
    assert all(message.get_link_id() == 1 for message in messages)


@pytest.mark.parametrize(("drives", "end"), [("stands", "kill"), ("drives", "close")])
def test_nothing_is_sent_for_a_vehicle_that_stands_or_after_a_orderly_end(
    vehicle: socket.socket, drives: str, end: str
) -> None:
    with driver(url_of(vehicle), drives, "") as process:
        ready(process)
        if end == "kill":
            process.kill()
        else:
            process.communicate("close\n", timeout=10.0)
        vehicle.settimeout(1.0)
        with pytest.raises(TimeoutError):
            vehicle.recv(2048)


def test_a_listening_end_sends_to_the_vehicle_of_its_last_message(
    vehicle: socket.socket, tmp_path: Path
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with driver(f"udpin:127.0.0.1:{port}", "drives", "") as process:
        beat = dialect.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3).pack(dialect.MAVLink(None, 1, 1))
        vehicle.settimeout(0.2)
        while process.poll() is None:
            vehicle.sendto(beat, ("127.0.0.1", port))
            with pytest.raises(TimeoutError):
                vehicle.recv(2048)
            if process.stdout is not None and select_ready(process):
                break
        ready(process)
        process.kill()
        vehicle.settimeout(10.0)
        assert is_hold(holds(vehicle, dialect.MAVLink(None))[0])


def select_ready(process: subprocess.Popen[str]) -> bool:
    assert process.stdout is not None
    return bool(select.select([process.stdout], [], [], 0.0)[0])
