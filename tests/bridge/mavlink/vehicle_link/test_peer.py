"""A vehicle is found by its heartbeat, and asked until it answers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.messages import station_beat
from stopgo.bridge.mavlink.vehicle_link.peer import Newest, found, reached
from stopgo.bridge.mavlink.vehicle_link.url import read_url
from stopgo.bridge.mavlink.vehicle_link.wire import DOUBLED, Who, Wire, wire
from stopgo.mission.errors import InputError, NegativeResult, OutcomeUnknown, RobotUnreachable
from stopgo.mission.mavlink.autopilots.generic import GENERIC
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.telemetry import Message
from tests.bridge.mavlink.scripted import Scripted
from tests.ports import free_port

pytestmark = pytest.mark.usefixtures("own_time")

ARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM


class ArduPilot(Scripted):
    autopilot = dialect.MAV_AUTOPILOT_ARDUPILOTMEGA


def test_a_vehicle_is_found_by_its_heartbeat() -> None:
    with ArduPilot() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert (peer.who, peer.autopilot.name) == (Who(1, 1), "ardupilot")
        assert not peer.armed and not peer.in_auto


def test_its_mode_is_that_of_its_last_heartbeat() -> None:
    with ArduPilot() as vehicle:
        vehicle.base_mode, vehicle.custom_mode = dialect.MAV_MODE_FLAG_SAFETY_ARMED, 10
        with reached(vehicle.url) as peer:
            assert peer.armed and peer.in_auto


@pytest.mark.parametrize(
    ("custom_mode", "follows"), [(4 << 16 | 4 << 24, True), (4 << 16 | 3 << 24, False), (0, True)]
)
def test_a_vehicle_on_hold_does_not_follow_its_mission(custom_mode: int, follows: bool) -> None:
    """PX4 sets the flag of AUTO on hold too, and so do those that number their modes as it does."""
    flags = dialect.MAV_MODE_FLAG_AUTO_ENABLED | dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    heartbeat = dialect.MAVLink_heartbeat_message(10, 0, flags, custom_mode, 4, 3)
    assert GENERIC.in_auto(heartbeat) is follows


def test_where_nobody_is_nothing_was_sent() -> None:
    url = read_url(f"udpout:127.0.0.1:{free_port()}")
    told = pytest.raises(RobotUnreachable, match=r"within 0.3 s \(nothing listens there\); nothing was sent")
    with told, reached(url, timeout_s=0.3):
        pass


def test_of_several_vehicles_one_must_be_named() -> None:
    port = free_port()
    out = read_url(f"udpout:127.0.0.1:{port}")
    with (
        wire(read_url(f"udpin:127.0.0.1:{port}")) as station,
        wire(out, me=Who(1, 1)) as one,
        wire(out, me=Who(2, 1)) as other,
    ):
        for vehicle in (one, other):
            vehicle.beat(vehicle_beat)
        names = r"several vehicles: 1 \(ardupilot\), 2 \(ardupilot\); .*--vehicle"
        with pytest.raises(InputError, match=names), found(station):
            pass
        with found(station, 2) as peer:
            assert peer.who == Who(2, 1)
        unheard = pytest.raises(RobotUnreachable, match=r"no vehicle 3 within .*found: 1")
        with unheard, found(station, 3, timeout_s=1.2):
            pass


@contextmanager
def two_with_one_id() -> Iterator[tuple[Wire, Wire, Wire]]:
    """A listening station, and two vehicles with the system id 1, of which the first one's heart beats."""
    port = free_port()
    out = read_url(f"udpout:127.0.0.1:{port}")
    with (
        wire(read_url(f"udpin:127.0.0.1:{port}")) as station,
        wire(out, me=Who(1, 1)) as one,
        wire(out, me=Who(1, 1)) as other,
    ):
        one.beat(vehicle_beat)
        yield station, one, other


def test_two_vehicles_with_one_system_id_are_not_taken_for_one() -> None:
    with two_with_one_id() as (station, one, other):
        while not station.doubled(1):
            other.send(vehicle_beat())
            one.send(vehicle_beat())
        names = r"two vehicles have the system id 1, at 127.0.0.1:\d+ and 127.0.0.1:\d+; nothing was sent"
        with pytest.raises(InputError, match=names), found(station):
            pass


def test_a_second_vehicle_with_the_same_id_is_ignored_and_reported_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with two_with_one_id() as (station, one, other), found(station) as peer:
        armed = vehicle_beat()
        armed.base_mode = dialect.MAV_MODE_FLAG_SAFETY_ARMED
        while station.dropped[DOUBLED] < 5:
            other.send(armed)
            one.send(vehicle_beat())
        assert not peer.armed
    assert capsys.readouterr().err.count("note: two vehicles have the system id 1, at 127.0.0.1:") == 1


def vehicle_beat() -> Message:
    return dialect.MAVLink_heartbeat_message(
        dialect.MAV_TYPE_GROUND_ROVER, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 4, 3
    )


def test_stations_and_cameras_are_no_vehicles() -> None:
    port = free_port()
    out = read_url(f"udpout:127.0.0.1:{port}")
    with (
        wire(read_url(f"udpin:127.0.0.1:{port}")) as station,
        wire(out, me=Who(255, 190)) as other,
        wire(out, me=Who(1, 100)) as camera,
    ):
        other.beat(station_beat)
        camera.beat(vehicle_beat)
        with pytest.raises(RobotUnreachable), found(station, timeout_s=0.3):
            pass


class Slow(Scripted):
    """Answers an order at the third time, after saying that it is at work."""

    def on_command_long(self, message: Message, to: Who) -> None:
        if self.heard["COMMAND_LONG"] >= 3:
            self.answer(message.command + 1, dialect.MAV_RESULT_DENIED, to)
            self.answer(message.command, dialect.MAV_RESULT_IN_PROGRESS, to)
            self.answer(message.command, dialect.MAV_RESULT_ACCEPTED, to)


def test_a_command_is_repeated_until_it_is_answered() -> None:
    with Slow() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert peer.command(ARM, 1).accepted
        assert vehicle.heard["COMMAND_LONG"] >= 3


class Refusing(Scripted):
    def on_command_long(self, message: Message, to: Who) -> None:
        self.send(dialect.MAVLink_statustext_message(2, b"Arm: no position"))
        self.answer(message.command, dialect.MAV_RESULT_FAILED, to)


def test_a_refusal_is_reported_with_the_vehicles_words() -> None:
    told = pytest.raises(NegativeResult, match=r"COMPONENT_ARM_DISARM was answered FAILED .*Arm: no position")
    with Refusing() as vehicle, reached(vehicle.url, vehicle=1) as peer, told:
        peer.order(ARM, 1)


class Deaf(Scripted):
    def take(self, message: Message) -> None:
        pass


def test_an_unanswered_command_is_unknown_and_an_unanswered_question_is_not() -> None:
    with Deaf() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        with pytest.raises(OutcomeUnknown, match="heartbeats come: does it want signed messages"):
            peer.command(ARM, 1, patience_s=0.4)
        with pytest.raises(RobotUnreachable, match=r"does not answer .*; nothing was sent to it"):
            peer.ask(dialect.MAVLINK_MSG_ID_HOME_POSITION, patience_s=0.4)


def test_the_origin_is_asked_and_set() -> None:
    with Scripted() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert peer.origin() == VehicleOrigin(lat=47.0, lon=8.0, alt=0.0)
        vehicle.origin = None
        assert peer.origin() is None
        there = VehicleOrigin(lat=47.5, lon=8.5, alt=400.0)
        assert peer.set_origin(there) == there
        assert peer.set_origin(VehicleOrigin(lat=1.0, lon=1.0, alt=0.0)) == there, "a second one is not taken"


def test_what_it_does_not_know_is_none() -> None:
    with Scripted() as vehicle, reached(vehicle.url, vehicle=1) as peer:
        assert peer.ask(dialect.MAVLINK_MSG_ID_HOME_POSITION) is None


def test_a_clock_that_goes_back_is_a_new_boot() -> None:
    with (
        Scripted() as vehicle,
        reached(vehicle.url, vehicle=1) as peer,
        peer.waiting("SYSTEM_TIME") as waiting,
    ):
        waiting.get(5.0)
        vehicle.boot_ms = 0
        while waiting.get(5.0).time_boot_ms > 10_000:
            pass
        assert peer.boots == 1


def test_an_older_picture_reported_again_is_no_restart() -> None:
    newest = Newest(Who(1, 1))
    for message in (
        dialect.MAVLink_attitude_message(60_000, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_camera_image_captured_message(5000, 0, 0, 0, 0, 0, 0, (1, 0, 0, 0), 0, 1, b""),
        dialect.MAVLink_attitude_message(60_100, 0, 0, 0, 0, 0, 0),
    ):
        message._header.srcSystem, message._header.srcComponent = 1, 1
        newest.put(message)
    assert newest.boots == 0
