"""Messages pass every kind of line, lines come back by themselves, and nothing that comes in stops a wire."""

from __future__ import annotations

import hashlib
import os
import pty
import socket
import termios
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.transport import open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url, read_url
from stopgo.bridge.mavlink.vehicle_link.wire import SIGNATURE, MessageQueue, Who, Wire, read_signing_key, wire
from stopgo.mission.errors import InputError, RobotUnreachable
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.hostile import Hostile
from tests.ports import free_port

KEY, OTHER_KEY = bytes(range(32)), bytes(32)
VEHICLE = Who(1, 1)
WAIT_S = 10.0


def udp(kind: str, port: int) -> Url:
    return read_url(f"{kind}:127.0.0.1:{port}")


def text(number: int) -> Message:
    """A message that says a number and nothing else."""
    return dialect.MAVLink_system_time_message(0, number)


def heard(waiting: MessageQueue, number: int) -> bool:
    """True if that number comes in time; messages before it are thrown away."""
    until = time.monotonic() + WAIT_S
    while (message := waiting.get(until - time.monotonic())) is not None:
        if message.time_boot_ms == number:
            return True
    return False


def passes(one: Wire, other: Wire, *, start: int = 0) -> None:
    """Messages go both ways, sooner or later."""
    for sends, hears in ((one, other), (other, one), (one, other)):
        with hears.waiting("SYSTEM_TIME") as waiting:
            until = time.monotonic() + WAIT_S
            for number in count(start + 1):
                sends.send(text(number))
                if waiting.get(0.1) is not None:
                    break
                assert time.monotonic() < until, f"nothing passes: {one.disconnected or other.disconnected}"


# Lines.


@pytest.mark.parametrize(("station", "vehicle"), [("udpin", "udpout"), ("udpout", "udpin")])
def test_udp_goes_in_both_directions(station: str, vehicle: str) -> None:
    port = free_port()
    with wire(udp(station, port)) as one, wire(udp(vehicle, port), me=VEHICLE) as other:
        passes(other, one) if station == "udpin" else passes(one, other)


def test_tcp_goes_in_both_directions_and_is_connected_again() -> None:
    port = free_port()
    with ExitStack() as stack:
        vehicle = stack.enter_context(wire(udp("tcpin", port), me=VEHICLE))
        with wire(udp("tcp", port)) as station:
            passes(station, vehicle)
            stack.close()
            until = time.monotonic() + WAIT_S
            while not station.disconnected:
                station.send(text(0))
                assert time.monotonic() < until
            with wire(udp("tcpin", port), me=VEHICLE) as again:
                passes(station, again)
                assert station.disconnected == ""


def test_nobody_at_a_tcp_port_is_said_at_once() -> None:
    with (
        pytest.raises(RobotUnreachable, match=r"no connection .*nothing was sent"),
        wire(udp("tcp", free_port())),
    ):
        pass


def test_a_writer_that_meets_an_error_does_not_hold_up_the_reader() -> None:
    """The datagram that `select` saw is no longer there when it is read."""
    transport = open_transport(udp("udpout", free_port()))
    writer = threading.Thread(target=lambda: [transport.write(b"x") for _ in range(5000)])
    writer.start()
    while writer.is_alive():
        assert transport.read(0.001) == []
    assert transport.disconnected == "nothing listens there"
    transport.close()


class Cable:
    """A serial device at a path, which can be unplugged and plugged in again; we hold the vehicle's end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.end = -1
        self._device = -1

    def plug(self) -> None:
        self.end, self._device = pty.openpty()
        for end in (self.end, self._device):
            tty.setraw(end, termios.TCSANOW)
        self.path.symlink_to(os.ttyname(self._device))

    def unplug(self) -> None:
        self.path.unlink()
        os.close(self._device)
        os.close(self.end)

    def say(self, message: Message) -> None:
        os.write(self.end, message.pack(dialect.MAVLink(None, 1, 1)))


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    cable = Cable(tmp_path / "ttyUSB0")
    cable.plug()
    yield cable
    cable.unplug()


def test_a_serial_line_that_is_unplugged_comes_back(cable: Cable) -> None:
    with wire(Url("serial", str(cable.path), 57600)) as station, station.waiting("SYSTEM_TIME") as waiting:
        assert station.slow
        cable.say(text(1))
        assert heard(waiting, 1)
        station.send(text(7))
        assert os.read(cable.end, 300)[:1] == b"\xfd"
        cable.unplug()
        until = time.monotonic() + WAIT_S
        while "serial port is disconnected" not in station.disconnected:
            station.send(text(2))  # to a line that is gone, which is no error
            assert time.monotonic() < until
        cable.plug()
        while station.disconnected:
            assert time.monotonic() < until
            waiting.get(0.01)
        cable.say(text(3))
        assert heard(waiting, 3)


def test_a_device_that_is_not_there_is_named(tmp_path: Path) -> None:
    told = pytest.raises(InputError, match=r"serial:.*ttyUSB7:57600: cannot be opened .*plugged in")
    with told, wire(Url("serial", str(tmp_path / "ttyUSB7"), 57600)):
        pass


@pytest.mark.parametrize("kind", ["udpin", "tcpin"])
def test_a_port_that_is_taken_is_named(kind: str) -> None:
    url = udp(kind, free_port())
    with wire(url), pytest.raises(InputError, match=f"{url}: cannot listen there .*port free"), wire(url):
        pass


# What comes in.


@contextmanager
def listening(signing_key: bytes | None = None) -> Iterator[tuple[Wire, MessageQueue, Any]]:
    """A station, what it hears of the time, and a way to throw bytes at it."""
    port = free_port()
    with (
        wire(udp("udpin", port), signing_key=signing_key) as station,
        station.waiting("SYSTEM_TIME") as waiting,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as thrower,
    ):
        thrower.connect(("127.0.0.1", port))
        yield station, waiting, thrower.send


def packed(number: int, *, key: bytes | None = None, ahead_s: float = 0.0) -> bytes:
    """A message of the vehicle as bytes; signed so many seconds in the future."""
    coder = dialect.MAVLink(None, 1, 1)
    if key is not None:
        coder.signing.secret_key, coder.signing.sign_outgoing = key, True
        coder.signing.timestamp = round((time.time() + ahead_s - 1_420_070_400) * 1e5)
    return bytes(text(number).pack(coder))


def test_half_a_datagram_does_not_swallow_the_next() -> None:
    with listening() as (_, waiting, throw):
        throw(packed(1)[:9])
        throw(packed(2))
        assert waiting.get(WAIT_S).time_boot_ms == 2


def test_what_is_for_others_is_left_to_them() -> None:
    with listening() as (station, _, throw), station.waiting() as waiting:
        coder = dialect.MAVLink(None, 1, 1)
        ack = dialect.MAVLink_mission_ack_message
        throw(ack(255, 190, 0, 0).pack(coder))
        throw(ack(254, 190, 1, 0).pack(coder))
        assert waiting.get(WAIT_S).type == 1
        assert station.dropped["for others"] == 1


def test_a_signed_wire_hears_only_its_key() -> None:
    with listening(KEY) as (station, waiting, throw):
        throw(packed(1))
        throw(packed(2, key=OTHER_KEY))
        throw(packed(3, key=KEY))
        assert waiting.get(WAIT_S).time_boot_ms == 3
        assert station.dropped[SIGNATURE] == 2


def test_a_replay_is_not_accepted_again_nor_is_what_was_signed_long_ago() -> None:
    with listening(KEY) as (station, waiting, throw):
        throw(packed(1, key=KEY, ahead_s=-120.0))
        first = packed(2, key=KEY)
        throw(first)
        throw(first)
        throw(packed(3, key=KEY, ahead_s=1.0))
        assert [waiting.get(WAIT_S).time_boot_ms for _ in range(2)] == [2, 3]
        assert station.dropped[SIGNATURE] == 2


def test_a_forged_far_future_does_not_lock_out_the_vehicle() -> None:
    with listening(KEY) as (_, waiting, throw):
        throw(packed(1, key=OTHER_KEY, ahead_s=1e8))
        throw(packed(2, key=KEY))
        assert waiting.get(WAIT_S).time_boot_ms == 2


def test_two_signed_wires_understand_each_other() -> None:
    port = free_port()
    with (
        wire(udp("udpin", port), signing_key=KEY) as station,
        wire(udp("udpout", port), me=VEHICLE, signing_key=KEY) as vehicle,
    ):
        passes(vehicle, station)


@pytest.mark.parametrize("key", [None, KEY], ids=["unsigned", "signed"])
def test_ten_thousand_hostile_datagrams_stop_nothing(key: bytes | None) -> None:
    with listening(key) as (station, waiting, throw):
        for number, datagram in enumerate(Hostile(seed=5).datagrams(10_000)):
            throw(datagram)
            if number % 100 == 99:  # one at a time, or the system drops what is not read
                mark = 1_000_000 + number
                throw(packed(mark, key=key))
                assert heard(waiting, mark), station.disconnected
        assert station.disconnected == ""
        assert station.dropped["unreadable"] > 1000
        assert key is None or station.dropped[SIGNATURE] > 1000


# Keys.


def test_a_key_is_hexadecimal_or_a_passphrase(tmp_path: Path) -> None:
    path = tmp_path / "key"
    path.write_text(KEY.hex() + "\n")
    assert read_signing_key(path) == KEY
    path.write_text("correct horse\n")
    assert read_signing_key(path) == hashlib.sha256(b"correct horse").digest()


def test_a_key_that_others_can_read_is_reported_without_showing_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "key"
    path.write_text("correct horse\n")
    path.chmod(0o600)
    read_signing_key(path)
    assert capsys.readouterr().err == ""
    path.chmod(0o644)
    read_signing_key(path)
    said = capsys.readouterr().err
    assert "others on this machine can read it; chmod 600" in said and said.count("\n") == 1
    assert "horse" not in said


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "is empty"), (b"\xff\xfe", "is not text; write 64 hex.* xxd"), (b"short", "too short")],
)
def test_a_file_without_a_key_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "key"
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_signing_key(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_signing_key(tmp_path / "nothing")
