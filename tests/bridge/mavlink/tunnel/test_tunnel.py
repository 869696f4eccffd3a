"""Raw frames between a vehicle and ground programs: unchanged and whole, both ways, and who may what."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from stopgo.bridge.commands.spawn import end_robot, robot_process, start
from stopgo.bridge.commands.tunnel_commands import RefusalListener, RefusalSender
from stopgo.bridge.link.authority import init_site, issue
from stopgo.bridge.link.keys import now_utc, read_keys
from stopgo.bridge.link.memory_link import MemoryLink, Switchboard
from stopgo.bridge.link.protocol import KeyExpressions
from stopgo.bridge.link.zenoh_link import Guard, connecting
from stopgo.bridge.mavlink.tunnel import tunnel as tunnels
from stopgo.bridge.mavlink.tunnel.message_filter import MessageFilter
from stopgo.bridge.mavlink.tunnel.tunnel import QUEUE, Tunnel, open_tunnel
from stopgo.bridge.mavlink.vehicle_link.frames import Frames, dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Peer, reached
from stopgo.bridge.mavlink.vehicle_link.transport import Address, open_transport
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.mission.errors import OutcomeUnknown, RobotUnreachable
from tests.bridge.mavlink.driving.world import rover
from tests.bridge.mavlink.scripted import Scripted
from tests.bridge.mavlink.simulated.test_simulated_mavsdk import item_of, raw, station, tour
from tests.called import stopgo
from tests.ports import free_port

KEYS = KeyExpressions("r1")
COMMAND = dialect.MAVLink_command_long_message


def frames(number: int = 3, *, system: int = 1, signed: bool = False) -> list[bytes]:
    """Heartbeats of an ArduPilot rover, one frame each."""
    coder = dialect.MAVLink(None, srcSystem=system, srcComponent=1)
    if signed:
        coder.signing.secret_key, coder.signing.sign_outgoing = b"k" * 32, True
    beats = []
    for _ in range(number):
        beats.append(bytes(dialect.MAVLink_heartbeat_message(10, 3, 0, 15, 4, 3).pack(coder)))
        coder.seq += 1
    return beats


class Line:
    """A transport whose other end is the test."""

    datagrams = True
    disconnected = ""

    def __init__(self) -> None:
        self.coming: queue.Queue[bytes] = queue.Queue()
        self.written: queue.Queue[bytes] = queue.Queue()

    def read(self, timeout_s: float) -> list[tuple[Address, bytes]]:
        try:
            return [("test", self.coming.get(timeout=timeout_s))]
        except queue.Empty:
            return []

    def write(self, data: bytes, to: Address | None = None) -> None:
        self.written.put(data)

    def close(self) -> None: ...


@contextmanager
def both_ends(**details: Any) -> Iterator[tuple[Line, Line, Tunnel]]:
    """The vehicle's line, the ground program's, and the robot's end between them."""
    board, vehicle, ground = Switchboard(), Line(), Line()
    down, up = KEYS.mavlink("down"), KEYS.mavlink("up")
    with (
        open_tunnel(MemoryLink(board), vehicle, publishes=down, receives=up, bulk=True, **details) as end,
        open_tunnel(MemoryLink(board), ground, publishes=up, receives=down),
    ):
        yield vehicle, ground, end


@pytest.mark.parametrize("signed", [False, True])
def test_frames_pass_unchanged_in_both_directions(signed: bool) -> None:
    down, up = frames(signed=signed), frames(system=255, signed=signed)
    with both_ends() as (vehicle, ground, _):
        vehicle.coming.put(down[0] + down[1])
        vehicle.coming.put(b"noise" + down[2] + b"\xfd half a frame")
        assert [ground.written.get(timeout=60) for _ in down] == down
        for frame in up:
            ground.coming.put(frame)
        assert [vehicle.written.get(timeout=60) for _ in up] == up


def test_a_frame_that_comes_back_does_not_go_round() -> None:
    echo, other = frames(2)
    with both_ends() as (vehicle, ground, _):
        vehicle.coming.put(echo)
        ground.coming.put(ground.written.get(timeout=60))
        ground.coming.put(other)
        assert vehicle.written.get(timeout=60) == other
        assert vehicle.written.empty()


def test_frames_are_whole_however_a_stream_is_cut() -> None:
    taken = frames(20)
    dropped: Any = tunnels.Counter()
    reader = Frames(dropped)
    stream = b"".join(taken)
    pieces = [stream[at : at + 7] for at in range(0, len(stream), 7)]
    read = [frame for piece in pieces for frame, _ in reader.whole(piece, datagram=False)]
    assert read == taken
    assert not +dropped


def test_a_link_that_is_stuck_costs_the_oldest_frames_and_never_waits() -> None:
    free, told = threading.Event(), threading.Event()

    class Stuck(MemoryLink):
        def publisher(self, key: str, *, bulk: bool = False) -> Any:
            def publish(payload: bytes) -> None:
                told.set()
                free.wait(60)

            return publish

    many, line = frames(250) + frames(250, system=2) + frames(250, system=3), Line()
    with open_tunnel(Stuck(Switchboard()), line, publishes="down", receives="up") as end:
        line.coming.put(many[0])
        assert told.wait(60)
        for frame in many[1:]:
            end._take(frame, None)  # type: ignore[arg-type]
        assert end.dropped["to the link, too many"] == len(many) - 1 - QUEUE
        free.set()


def test_without_raw_commands_one_can_look_and_stop_and_nothing_else() -> None:
    judge = MessageFilter()
    reader = Frames(tunnels.Counter())
    for _, message in reader.whole(frames(1)[0], datagram=True):
        judge.sees(message)

    def command(number: int, *params: float) -> bool:
        return judge.lets_through(COMMAND(1, 1, number, 0, *(*params, *(0.0,) * 7)[:7]))

    mode, arm = dialect.MAV_CMD_DO_SET_MODE, dialect.MAV_CMD_COMPONENT_ARM_DISARM
    assert command(mode, 1, 4)
    assert command(arm, 0)
    assert command(arm, 0, 21196)
    assert command(dialect.MAV_CMD_REQUEST_MESSAGE, 148)
    assert judge.lets_through(dialect.MAVLink_set_mode_message(1, 1, 4))
    assert judge.lets_through(dialect.MAVLink_set_mode_message(0, 1, 4))
    assert judge.lets_through(dialect.MAVLink_mission_request_list_message(1, 1))
    assert not command(mode, 1, 10)
    assert not command(mode, 1, float("nan"))
    assert not command(arm, 1)
    assert not command(dialect.MAV_CMD_MISSION_START)
    assert not command(dialect.MAV_CMD_DO_REPOSITION)
    assert not judge.lets_through(dialect.MAVLink_set_mode_message(1, 1, 15))
    assert not judge.lets_through(dialect.MAVLink_set_mode_message(2, 1, 4))
    assert not judge.lets_through(dialect.MAVLink_mission_count_message(1, 1, 3))
    assert not judge.lets_through(dialect.MAVLink_mission_clear_all_message(1, 1))
    assert not judge.lets_through(dialect.MAVLink_param_set_message(1, 1, b"X", 1.0, 9))
    assert not judge.lets_through(dialect.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0))


def test_on_px4_holding_is_another_number() -> None:
    judge = MessageFilter()
    coder = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    beat = bytes(dialect.MAVLink_heartbeat_message(10, 12, 0, 0, 4, 3).pack(coder))
    for _, message in Frames(tunnels.Counter()).whole(beat, datagram=True):
        judge.sees(message)
    hold, mission = (COMMAND(1, 1, dialect.MAV_CMD_DO_SET_MODE, 0, 1, 4, sub, 0, 0, 0, 0) for sub in (3, 4))
    assert judge.lets_through(hold)
    assert not judge.lets_through(mission)


@contextmanager
def process(*arguments: str) -> Iterator[Any]:
    made = start("tunnel", *arguments, called="the tunnel")
    try:
        yield made
    finally:
        end_robot(made)


@contextmanager
def tunnelled(
    tmp_path: Path, *robots: str, program: str = "udpin", profile: str = "ardupilot"
) -> Iterator[tuple[int, Any]]:
    """A vehicle behind both ends, each a process: the port at which it is reached, and its operator."""
    endpoint, port = f"tcp/127.0.0.1:{free_port()}", free_port()
    with (
        rover(tmp_path, profile) as (vehicle, operator),
        process("robot", "--name", "r1", "--mavlink", str(vehicle.url), "--listen", endpoint, *robots),
        process(
            "station", "--robot", "r1", "--connect", endpoint, "--mavlink", f"{program}:127.0.0.1:{port}"
        ),
    ):
        yield port, operator


def test_mavsdk_uploads_and_downloads_through_the_tunnel(tmp_path: Path) -> None:
    from mavsdk.plugins.mission_raw.mission_raw import MissionRaw

    items = tour("ardupilot")
    with tunnelled(tmp_path, "--allow-commands", program="udpout") as (port, _), station(port) as system:
        missions = MissionRaw(system)
        missions.upload_mission(raw(items))
        read = [item_of(item) for item in missions.download_mission()]
    assert [item.command for item in read[1:]] == [item.command for item in items[1:]]
    assert [(item.x, item.y) for item in read[1:]] == [(item.x, item.y) for item in items[1:]]


def test_without_raw_commands_arming_is_refused_in_words_and_hold_passes(tmp_path: Path) -> None:
    with tunnelled(tmp_path) as (port, operator):
        operator.manual()
        with reached(Url("udpout", "127.0.0.1", port), vehicle=1, timeout_s=60) as peer:
            assert isinstance(peer, Peer)
            with peer.wire.waiting("STATUSTEXT") as waiting:
                with pytest.raises(OutcomeUnknown):
                    peer.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1.0, patience_s=1.0)
                told = waiting.get(5)
            assert told is not None
            assert told.text == "tunnel refused COMPONENT_ARM_DISARM (COMMAND_LONG)"
            assert peer.command(dialect.MAV_CMD_DO_SET_MODE, *operator.autopilot.modes.hold.params).accepted
        assert operator.mode() == "HOLD"
        assert not operator.peer.armed


def test_the_station_is_informed_once_for_each_kind_of_message_that_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    listener, reader = RefusalListener("r1"), Frames(tunnels.Counter())
    count, arm = dialect.MAVLink_mission_count_message(1, 1, 3, 0), COMMAND(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0)
    told = [RefusalSender().text_of(message) for message in (count, arm, count)]
    capsys.readouterr()
    for frame in (*told, *frames(1)):
        for _, message in reader.whole(frame, datagram=True):
            listener.take(message)
    said = capsys.readouterr().err.splitlines()
    assert [line.split("refused ")[1].split(":")[0] for line in said] == [
        "MISSION_COUNT",
        "COMPONENT_ARM_DISARM (COMMAND_LONG)",
    ]
    assert all("r1" in line and "--allow-commands" in line for line in said)


def test_a_tunnels_refusal_is_named_where_the_vehicle_would_seem_silent() -> None:
    words = dialect.MAVLink_statustext_message(4, b"tunnel refused MISSION_COUNT")
    with Scripted() as vehicle, reached(vehicle.url, vehicle=1, timeout_s=2.0) as peer:
        assert "does it want signed messages" in peer.why_silent()
        tunnel = dialect.MAVLink(None, 1, dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
        (told,) = tunnel.parse_buffer(bytes(words.pack(tunnel))) or []
        assert peer._newest.wants(told)
        peer._newest.put(told)
        assert peer.why_silent() == ' (it last said "tunnel refused MISSION_COUNT")'
        assert peer.newest("STATUSTEXT") is None, "that is the autopilot's own"


def test_the_tunnel_joins_the_robots_own_end_and_comes_back_after_a_kill(tmp_path: Path) -> None:
    port = free_port()
    with (
        rover(tmp_path, "px4") as (vehicle, _),
        robot_process("r1", tmp_path / "robot") as endpoint,
        process("station", "--robot", "r1", "--connect", endpoint, "--mavlink", f"udpin:127.0.0.1:{port}"),
    ):
        own = ("robot", "--name", "r1", "--mavlink", str(vehicle.url), "--connect", endpoint)
        program = Url("udpout", "127.0.0.1", port)
        with process(*own) as first:
            with reached(program, vehicle=1, timeout_s=60) as peer:
                assert peer.autopilot.name == "px4"
            first.kill()
            first.wait()
        with pytest.raises(RobotUnreachable), reached(program, vehicle=1, timeout_s=1.5):
            pass
        with process(*own) as second:
            with reached(program, vehicle=1, timeout_s=60) as peer:
                assert peer.autopilot.name == "px4"
            second.terminate()
            assert second.wait(60) == 0


def test_viewers_hear_the_vehicle_and_cannot_speak_to_it(tmp_path: Path) -> None:
    site, now = tmp_path / "keys", now_utc()
    init_site(site, now=now)
    for role, name in (("robot", "r1"), ("station", "alice"), ("viewer", "vera")):
        issue(site, role, name, now=now)  # type: ignore[arg-type]
    endpoint = f"tls/127.0.0.1:{free_port()}"
    heard: queue.Queue[str] = queue.Queue()
    with ExitStack() as opened:
        vehicle, _ = opened.enter_context(rover(tmp_path, "ardupilot"))
        own = ("robot", "--name", "r1", "--mavlink", str(vehicle.url), "--listen", endpoint)
        opened.enter_context(process(*own, "--allow-commands", "--keys", str(site / "r1")))

        def link_of(name: str) -> Any:
            keys = read_keys(site / name, now=now)
            return opened.enter_context(connecting(endpoint, Guard(keys)))

        reader = Frames(tunnels.Counter())

        def hear(key: str, payload: bytes) -> None:
            for _, message in reader.whole(payload, datagram=True):
                heard.put(f"{message.get_type()} {getattr(message, 'target_system', '')}")

        viewer, commander = link_of("vera"), link_of("alice")
        viewer.hear(KEYS.mavlink("down"), hear)
        for link in (viewer, commander):
            while link.ask(KEYS.mavlink("hello"), timeout_s=0.5) is None:
                continue
        up = KEYS.mavlink("up")
        viewers, stations = viewer.publisher(up), commander.publisher(up)
        answers = 0
        while answers < 10:
            told = heard.get(timeout=60)
            answers += told == "COMMAND_ACK 200"
            assert told != "COMMAND_ACK 201"
            viewers(request_of(201))
            stations(request_of(200))


def request_of(system: int) -> bytes:
    coder = dialect.MAVLink(None, srcSystem=system, srcComponent=190)
    request = COMMAND(1, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, 0, 0, 0, 0, 0, 0, 0)
    return bytes(request.pack(coder))


def test_a_tunnel_off_this_machine_wants_keys_or_insecure() -> None:
    for option, value, why in (
        ("--connect", "tcp/10.9.8.7:7447", "leaves this machine without keys"),
        ("--mavlink", "udpin:0.0.0.0:14550", "leaves this machine unsigned"),
    ):
        told = stopgo("tunnel", "station", "--robot", "r1", option, value)
        assert told.returncode == 2 and why in told.stderr


def test_a_transport_is_closed_with_its_tunnel() -> None:
    port = free_port()
    for _ in range(2):
        with open_tunnel(
            MemoryLink(Switchboard()),
            open_transport(Url("udpin", "127.0.0.1", port)),
            publishes="a",
            receives="b",
        ):
            pass
