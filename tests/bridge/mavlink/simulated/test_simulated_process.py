"""The vehicle as a process on a wire: its command, its faults on the line, its keys, and being killed."""

from __future__ import annotations

import random
import signal
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from stopgo.bridge.mavlink.simulated.lossy_line import on_line
from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_faults import (
    FAULTS,
    VehicleFault,
    VehicleFaults,
    read_vehicle_faults,
)
from stopgo.bridge.mavlink.simulated.vehicle_process import VehicleOptions, setup_of, vehicle_on
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.transport import Address
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import SIGNATURE, Who, Wire, wire
from stopgo.mission.errors import InputError
from stopgo.mission.mavlink.items import Item
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.simulated.bench import delay, item_message
from tests.ports import free_port

PATIENCE_S = 120.0
KEY = bytes(range(32))


def there(port: int) -> Url:
    return Url("udpout", "127.0.0.1", port)


def here(port: int) -> Url:
    return Url("udpin", "127.0.0.1", port)


def answer(station: Wire, message: Message, kind: str, *, tries: int = 40) -> Message:
    """The next message of a kind; `message` is sent again twice a second until it comes."""
    with station.waiting(kind) as waiting:
        for _ in range(tries):
            station.send(message)
            got = waiting.get(0.5)
            if got is not None:
                return got
    raise AssertionError(f"no {kind}")


def upload(station: Wire, items: list[Item], *, home: bool = False) -> bool:
    """All items, each as often as it is requested; true once they are accepted."""
    listed = [item_message(number, item) for number, item in enumerate([items[0], *items] if home else items)]
    count = dialect.MAVLink_mission_count_message(1, 1, len(listed), 0)
    with station.waiting("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK") as waiting:
        station.send(count)
        for _ in range(400):
            got = waiting.get(1.5)
            if got is None:
                station.send(count)
            elif got.get_type() != "MISSION_ACK":
                station.send(listed[got.seq])
            elif got.type == dialect.MAV_MISSION_ACCEPTED:
                return True
    return False


def count_of(station: Wire) -> int:
    listed = dialect.MAVLink_mission_request_list_message(1, 1, 0)
    return int(answer(station, listed, "MISSION_COUNT").count)


@contextmanager
def process(*options: str) -> Iterator[subprocess.Popen[str]]:
    """`stopgo simulate vehicle`, ready."""
    command = [sys.executable, "-m", "stopgo", "simulate", "vehicle", *options]
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert running.stderr is not None
    try:
        line = running.stderr.readline()
        assert line.startswith("ready"), line
        yield running
    finally:
        running.kill()
        running.wait()
        running.stderr.close()


@pytest.mark.parametrize("profile", list(PROFILES))
def test_a_vehicle_that_is_killed_and_started_again_keeps_its_items(tmp_path: Path, profile: str) -> None:
    port = free_port()
    options = ("--mavlink", str(here(port)), "--autopilot", profile, "--state", str(tmp_path / "v"))
    ardupilot = profile == "ardupilot"
    with wire(there(port)) as station:
        with process(*options) as running:
            assert upload(station, [delay(1.0), delay(2.0)], home=ardupilot)
            running.send_signal(signal.SIGKILL)
            running.wait()
        with process(*options) as running:
            assert count_of(station) == 2 + ardupilot
            running.send_signal(signal.SIGTERM)
            assert running.wait(PATIENCE_S) == 0


def test_a_vehicle_that_cannot_keep_its_state_ends_and_says_so(tmp_path: Path) -> None:
    port, state = free_port(), tmp_path / "v"
    with (
        wire(there(port)) as station,
        process("--mavlink", str(here(port)), "--state", str(state)) as running,
    ):
        state.rename(tmp_path / "elsewhere")  # at once, whatever it is just writing
        state.touch()
        station.send(dialect.MAVLink_mission_clear_all_message(1, 1, 0))
        assert running.wait(PATIENCE_S) == 2
        assert running.stderr is not None
        (line,) = running.stderr.read().splitlines()
        assert str(state) in line


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--mavlink", "udp:1"], "not a MAVLink URL"),
        (["--mavlink", "udpin:0.0.0.0:14550"], "--insecure"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--autopilot", "copter"], "--autopilot copter"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--origin", "1,2"], "LAT,LON,ALT"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--origin", "90,2,3"], "LAT,LON,ALT"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--fault", "slip@1"], "KIND@N"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--fault", "nack@-1"], "0 or more"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--fault", "loss@200"], "0 to 100"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--keys", "k"], "--keys"),
        (["--mavlink", "udpin:127.0.0.1:14550", "--signing-key", "none"], "cannot be read"),
        (["--mavlink", "udpin:203.0.113.9:14550", "--insecure"], "cannot listen there"),
    ],
)
def test_options_that_cannot_be_are_refused_in_one_line(
    options: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    from stopgo.command_line import main

    code = main(["simulate", "vehicle", *options])
    out = capsys.readouterr()
    assert (code, out.out) == (2, "")
    assert said in out.err
    assert len(out.err.strip().splitlines()) == 1


def test_a_state_that_is_none_is_refused(tmp_path: Path) -> None:
    (tmp_path / "vehicle.msgpack").write_bytes(b"\xc1")
    with pytest.raises(InputError, match="remove it to begin again"):
        Store(tmp_path)
    with pytest.raises(InputError, match="cannot be made"):
        Store(tmp_path / "vehicle.msgpack" / "v")


def test_a_vehicle_that_was_refused_leaves_its_port_free(tmp_path: Path) -> None:
    (tmp_path / "vehicle.msgpack").write_bytes(b"\xc1")
    port = free_port()
    threads = threading.active_count()
    with pytest.raises(InputError), vehicle_on(here(port), VehicleSetup(PROFILES["strict"], state=tmp_path)):
        pass
    with vehicle_on(here(port), VehicleSetup(PROFILES["strict"])), wire(there(port)) as station:
        assert count_of(station) == 0
    assert threading.active_count() == threads


def test_two_stations_on_streams_are_informed_the_same() -> None:
    port = free_port()
    with (
        vehicle_on(Url("tcpin", "127.0.0.1", port), VehicleSetup(PROFILES["strict"])),
        wire(Url("tcp", "127.0.0.1", port)) as one,
        wire(Url("tcp", "127.0.0.1", port), me=Who(200, 190)) as other,
    ):
        assert upload(one, [delay(1.0), delay(2.0)])
        assert count_of(other) == 2
        with one.waiting("HEARTBEAT") as here_, other.waiting("HEARTBEAT") as there_:
            for waiting in (here_, there_):
                beat = waiting.get(PATIENCE_S)
                assert beat is not None and beat.type == dialect.MAV_TYPE_GROUND_ROVER


def test_a_vehicle_outlives_stations_that_hang_up() -> None:
    """They do so while it is writing to them, with everything unread, so that its writes fail."""
    port = free_port()
    linger = struct.pack("ii", 1, 0)
    with (
        vehicle_on(Url("tcpin", "127.0.0.1", port), VehicleSetup(PROFILES["strict"])),
        wire(Url("tcp", "127.0.0.1", port)) as station,
    ):
        for _ in range(500):
            with socket.create_connection(("127.0.0.1", port)) as rude:
                rude.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                station.send(dialect.MAVLink_param_request_list_message(1, 1))
        assert count_of(station) == 0


def test_a_signing_vehicle_hears_who_has_the_key_only() -> None:
    port = free_port()
    setup = VehicleSetup(PROFILES["strict"])
    with vehicle_on(here(port), setup, signing_key=KEY):
        with wire(there(port), signing_key=KEY) as station:
            assert upload(station, [delay(1.0)])
        with wire(there(port)) as stranger, stranger.waiting("MISSION_ACK") as waiting:
            stranger.send(dialect.MAVLink_mission_clear_all_message(1, 1, 0))
            assert waiting.get(0.5) is None
        with wire(there(port), signing_key=KEY) as station:
            assert count_of(station) == 1


def test_a_vehicle_that_should_sign_and_does_not() -> None:
    port = free_port()
    setup = VehicleSetup(PROFILES["strict"], faults=VehicleFaults((VehicleFault("unsigned", 0),)))
    with vehicle_on(here(port), setup, signing_key=KEY):
        with wire(there(port), signing_key=KEY) as careful, careful.waiting() as waiting:
            careful.send(dialect.MAVLink_mission_request_list_message(1, 1, 0))
            assert waiting.get(0.5) is None
            assert careful.dropped[SIGNATURE] > 0
        with wire(there(port)) as careless, careless.waiting("MISSION_COUNT") as waiting:
            careless.send(dialect.MAVLink_mission_request_list_message(1, 1, 0))
            assert waiting.get(0.5) is None, "it hears only what is signed"


@pytest.mark.parametrize("profile", list(PROFILES))
def test_an_upload_over_a_line_that_loses_doubles_and_delays(profile: str) -> None:
    """The station sends COUNT again until it is heard, answers requests, and waits for an ACCEPTED."""
    port = free_port()
    faults = read_vehicle_faults(["loss@5", "duplicates@20=3", "jitter@20"])
    setup = VehicleSetup(PROFILES[profile], faults=faults)
    items = [delay(float(number)) for number in range(10)]
    with vehicle_on(here(port), setup), wire(there(port)) as station:
        assert upload(station, items, home=profile == "ardupilot")
        assert count_of(station) == len(items) + (profile == "ardupilot")


class Loop:
    """A transport that gives back what is written."""

    datagrams = True
    disconnected = ""

    def __init__(self) -> None:
        self.written: list[bytes] = []

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        return [("peer", bytes([number])) for number in range(100)]

    def write(self, data: bytes, to: Address | None = None) -> None:
        self.written.append(data)

    def close(self) -> None: ...


@pytest.mark.parametrize(("fault", "least", "most"), [("loss@30=1", 50, 85), ("duplicates@30=1", 115, 145)])
def test_frames_are_lost_and_doubled_by_chance_and_by_seed(fault: str, least: int, most: int) -> None:
    faults = read_vehicle_faults([fault])
    loops = [Loop(), Loop()]
    lines = [on_line(loop, faults) for loop in loops]
    read = [line.read(0.0) for line in lines]
    for number in random.Random(1).sample(range(100), 100):
        for line in lines:
            line.write(bytes([number]))
    assert read[0] == read[1]
    assert loops[0].written == loops[1].written
    assert least <= len(read[0]) <= most
    assert least <= len(loops[0].written) <= most


def test_a_line_without_faults_is_the_line() -> None:
    loop = Loop()
    assert on_line(loop, VehicleFaults((VehicleFault("nack", 1),))) is loop


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("loss@101", "0 to 100"), ("duplicates@200", "0 to 100"), ("jitter@60001", "milliseconds"),
        ("beside@1", "metres"), ("finish@1=0", "metres"), ("nack@0=99", "MAV_MISSION_RESULT"),
        ("nack@1=1.5", "MAV_MISSION_RESULT"), ("scanner@0", "from 1"), ("lostack@0", "from 1"),
    ],
)  # fmt: skip
def test_a_fault_that_could_not_happen_is_refused_with_one_that_could(text: str, said: str) -> None:
    with pytest.raises(InputError, match=f"{text}: .*{said}.*@"):
        read_vehicle_faults([text])


def test_every_fault_can_be_written_and_is_in_the_guide() -> None:
    assert [fault.kind for fault in read_vehicle_faults(f"{kind}@1=2" for kind in FAULTS).all] == list(FAULTS)
    guide = (Path(__file__).parents[4] / "docs" / "how-to" / "simulated-vehicle.md").read_text(
        encoding="utf-8"
    )
    assert [kind for kind in FAULTS if f"`{kind}@" not in guide] == []


def test_a_pose_is_said_in_the_sites_frame() -> None:
    from stopgo.mission.run.events import Pose

    options = VehicleOptions("udpin:127.0.0.1:1", origin="47,8,0,90", at=Pose(x=1.0, y=2.0, heading=0.0))
    setup = setup_of(options)
    assert setup.at is not None and setup.origin is not None
    assert (round(setup.at.x, 9), round(setup.at.y, 9)) == (2.0, -1.0)
    assert setup.origin.heading_deg == 0
