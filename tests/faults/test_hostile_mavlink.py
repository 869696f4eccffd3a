"""Whatever is sent to the vehicle, it answers the next good message; 20 000 times with STOPGO_FAULTS=full."""

from __future__ import annotations

import math
import socket

import pytest

from stopgo.bridge.mavlink.simulated.profiles import PROFILES
from stopgo.bridge.mavlink.simulated.vehicle import VehicleSetup
from stopgo.bridge.mavlink.simulated.vehicle_process import vehicle_on
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.url import Url
from stopgo.bridge.mavlink.vehicle_link.wire import Wire, wire
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.hostile import Hostile
from tests.bridge.mavlink.simulated.bench import ACCEPTED, ORIGIN, Bench, delay, waypoint
from tests.faults.sizes import size
from tests.ports import free_port

FRAMES = size(short=1500, full=20_000)
BURST = 100
SEEDS = range(size(short=1, full=3))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("profile", list(PROFILES))
def test_messages_that_make_no_sense_are_survived(profile: str, seed: int) -> None:
    """Without a socket: an exception anywhere fails here, and so does an answer that cannot be packed."""
    hostile = Hostile(seed)
    bench = Bench(profile, origin=None if seed % 2 else ORIGIN)
    driven = 0
    for number in range(FRAMES):
        bench.say(hostile.message())
        driven += bench.vehicle.auto.state == "active"
        if number % 50 == 0:
            drive(bench, hostile)
        if number % 20 == 0:
            bench.pass_time(hostile.chance.choice((0.1, 1.0, 5.0)), step_s=0.1)
        if number % 200 == 0:
            pose, speed = bench.vehicle.rover.at(bench.vehicle.now_ns)
            assert all(map(math.isfinite, (pose.x, pose.y, pose.heading, speed)))
            bench.all.clear()
    assert driven > FRAMES / 50, "the vehicle was hardly ever in AUTO"
    bench.pass_time(20.0)
    bench.count(0)
    assert bench.upload([waypoint(1.0, 0.0), delay(1.0)]) == ACCEPTED
    assert len(bench.held()) == 2
    assert bench.vehicle.set_mode("hold")


def drive(bench: Bench, hostile: Hostile) -> None:
    """Give the vehicle something to do, so that nonsense meets it in motion."""
    bench.pass_time(10.0, step_s=1.0)
    bench.upload(hostile.items())
    bench.arm()
    bench.mode(hostile.chance.choice(("auto", "auto", "auto", "guided", "hold")))


@pytest.mark.parametrize("profile", list(PROFILES))
def test_a_vehicle_on_the_wire_answers_after_every_burst_of_hostile_datagrams(profile: str) -> None:
    hostile, port = Hostile(7), free_port()
    ask = dialect.MAVLink_command_long_message(
        1, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0
    )
    with (
        vehicle_on(
            Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES[profile], origin=ORIGIN)
        ) as stopped,
        wire(Url("udpout", "127.0.0.1", port)) as station,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
    ):
        for _ in range(FRAMES // BURST):
            for datagram in hostile.datagrams(BURST):
                stranger.sendto(datagram, ("127.0.0.1", port))
            assert answered(station, ask), "the vehicle is silent"
        assert not stopped.is_set()


def test_a_vehicle_on_a_stream_answers_whoever_else_talks_nonsense() -> None:
    hostile, port = Hostile(11), free_port()
    ask = dialect.MAVLink_command_long_message(
        1, 1, dialect.MAV_CMD_REQUEST_MESSAGE, 0, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0, 0, 0, 0, 0, 0
    )
    with (
        vehicle_on(Url("tcpin", "127.0.0.1", port), VehicleSetup(PROFILES["strict"], origin=ORIGIN)),
        wire(Url("tcp", "127.0.0.1", port)) as station,
    ):
        for _ in range(FRAMES // BURST):
            with socket.create_connection(("127.0.0.1", port)) as stranger:
                for datagram in hostile.datagrams(BURST):
                    stranger.sendall(datagram)
            assert answered(station, ask), "the vehicle is silent"


def answered(station: Wire, message: Message) -> bool:
    """True if an AUTOPILOT_VERSION comes; a vehicle that was made to reboot is away for a second."""
    with station.waiting("AUTOPILOT_VERSION") as waiting:
        for _ in range(60):
            station.send(message)
            if waiting.get(0.25) is not None:
                return True
    return False


def test_a_signing_vehicle_does_nothing_that_a_stranger_says() -> None:
    hostile, port, key = Hostile(3), free_port(), bytes(32)
    with (
        vehicle_on(Url("udpin", "127.0.0.1", port), VehicleSetup(PROFILES["strict"]), signing_key=key),
        wire(Url("udpout", "127.0.0.1", port), signing_key=key) as station,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
        station.waiting("HEARTBEAT", "MISSION_CURRENT") as waiting,
    ):
        for datagram in hostile.datagrams(FRAMES):
            stranger.sendto(datagram, ("127.0.0.1", port))
        station.beat(lambda: dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
        seen = [waiting.get(5.0) for _ in range(4)]
    assert {message.get_type() for message in seen} == {"HEARTBEAT", "MISSION_CURRENT"}
    for message in seen:
        if message.get_type() == "HEARTBEAT":
            assert not message.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
        else:
            assert (message.total, message.mission_state) == (0, dialect.MISSION_STATE_NO_MISSION)
