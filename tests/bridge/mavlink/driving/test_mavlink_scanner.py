"""Reports of a vehicle by which a scan counts, and those by which it does not."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any

import pytest

from stopgo.bridge.link.clock import WallClock
from stopgo.bridge.mavlink.driving.mavlink_scanner import MavlinkScanner, stop_of
from stopgo.bridge.mavlink.vehicle_link.frames import dialect
from stopgo.bridge.mavlink.vehicle_link.peer import Ack
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who
from stopgo.mission.document import Scan
from stopgo.mission.errors import OutcomeUnknown
from stopgo.mission.mavlink.telemetry import Message
from stopgo.mission.run.scans import ScanFailed, ScanResult
from tests.bridge.mavlink.driving.world import site_mission

pytestmark = pytest.mark.usefixtures("own_time")

SHA = hashlib.sha256(b"scan").hexdigest()
URL = f"scan-1.e57?size=1600&points=100&sha256={SHA}"
SCAN = Scan(profile="default", duration_s=2.0, timeout_s=1.0)
GOOD = ScanResult(file="scan-1.e57", size=1600, points=100, sha256=SHA)


def captured(
    index: int, *, url: str = URL, result: int = 1, boot_ms: int = 5000, system: int = 1, component: int = 1
) -> Message:
    message = dialect.MAVLink_camera_image_captured_message(
        boot_ms, 0, 0, 0, 0, 0, 0, (1.0, 0.0, 0.0, 0.0), index, result, url.encode()
    )
    message._header.srcSystem, message._header.srcComponent = system, component
    return message


class Camera:
    """A vehicle of which only the scanner's part is there; `tells` follow an accepted trigger."""

    def __init__(self, *tells: Message, taken: int | None = None, acks: tuple[int, ...] = (0,)) -> None:
        self.who = Who(1, 1)
        self.peer, self.wire, self.telemetry, self.control = self, self, self, self
        self.boots, self.is_late = 0, False
        self.poses: list[tuple[float, float, float, float]] = [(0.0, 0.0, 0.0, 0.0)]
        """North, east, yaw and speed at each look; the last one stays."""
        self.switched, self.taken, self.stops = "", "", 0
        self.orders: list[tuple[int, tuple[float, ...]]] = []
        self.asked: list[Message] = []
        self.answers: Callable[[Message], Message | None] = lambda request: None
        self._tells, self._taken, self._acks = list(tells), taken, list(acks)
        self._box = MessageQueue()

    @contextmanager
    def waiting(self, *types: str) -> Iterator[MessageQueue]:
        yield self._box

    def ask(self, number: int, *, patience_s: float) -> Message | None:
        if self._taken is None or number != dialect.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS:
            return None
        return dialect.MAVLink_camera_capture_status_message(0, 0, 0, 0.0, 0, 0.0, self._taken)

    def command(self, number: int, *params: float, patience_s: float, unheard: int = 2) -> Ack:
        self.orders.append((number, params))
        result = self._acks.pop(0) if self._acks else 0
        if result < 0:
            self._tell()
            raise OutcomeUnknown("no answer")
        if result == 0:
            self._tell()
        return Ack(number, result)

    def send(self, message: Message) -> None:
        self.asked.append(message)
        answer = self.answers(message)
        if answer is not None:
            self._box.put(answer)

    def why_unknown(self) -> str:
        return ""

    def position(self) -> tuple[float, float]:
        return self.poses[0][:2]

    def yaw(self) -> float:
        return self.poses[0][2]

    def speed(self) -> float:
        present = self.poses[0]
        if len(self.poses) > 1:  # the last of the three that are asked at each look
            self.poses.pop(0)
        return present[3]

    @property
    def is_changed(self) -> bool:
        return bool(self.switched)

    is_put_on_hold = is_disarmed_at_work = False

    def note_armed(self) -> None:
        """Nobody disarms it."""

    def other_hands(self, within_s: float) -> str:
        return ""

    def other_control(self) -> str:
        return self.taken

    def stop(self) -> None:
        self.stops += 1

    def _tell(self) -> None:
        for message in self._tells:
            self._box.put(message)
        self._tells.clear()


def scan(camera: Camera, *, interrupt: Event | None = None, **details: Any) -> ScanResult | ScanFailed:
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10), **details)  # type: ignore[arg-type]
    scanner.take(site_mission())
    return scanner.scan("run-s2-1", SCAN, interrupt=interrupt or Event())


def test_a_scan_is_what_the_vehicle_names_with_size_points_and_sha256() -> None:
    camera = Camera(captured(4), taken=4)
    assert scan(camera) == GOOD
    # All cameras, the scan's duration, one picture, the next number.
    assert camera.orders == [(dialect.MAV_CMD_IMAGE_START_CAPTURE, (0.0, 2.0, 1.0, 5.0))]


def test_a_script_gets_the_stops_number_and_times() -> None:
    camera = Camera(captured(0))
    assert scan(camera, trigger="script") == GOOD
    assert camera.orders == [(dialect.MAV_CMD_DO_SEND_SCRIPT_MESSAGE, (100.0, 2.0, 2.0, 1.0))]


def test_an_older_picture_reported_again_is_not_taken_for_the_new_one() -> None:
    old = captured(3, url=URL.replace("scan-1", "scan-0"))
    assert scan(Camera(old, captured(4), taken=4)) == GOOD
    assert scan(Camera(old, taken=4)) == ScanFailed(reason="no result within 1 s")


def test_what_was_reported_for_one_scan_does_not_count_for_the_next() -> None:
    camera = Camera(captured(7))
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s1-1", SCAN, interrupt=Event()) == GOOD
    camera._tells = [captured(7)]
    assert scanner.scan("run-s2-1", SCAN, interrupt=Event()) == ScanFailed(reason="no result within 1 s")
    camera._tells = [captured(8)]
    assert scanner.scan("run-s2-2", SCAN, interrupt=Event()) == GOOD


def test_another_vehicles_picture_is_not_ours() -> None:
    assert scan(Camera(captured(4, system=2), taken=4)) == ScanFailed(reason="no result within 1 s")


def test_a_result_that_was_lost_is_asked_for() -> None:
    camera = Camera(taken=4)
    camera.answers = lambda request: captured(4) if camera.orders and request.param2 == 4 else None
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == GOOD


def test_a_vehicle_that_is_busy_is_waited_for_and_what_it_then_reports_is_not_ours() -> None:
    busy = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    camera = Camera(captured(5), acks=(busy, busy, 0))
    camera._box.put(captured(4, url=URL.replace("scan-1", "scan-0")))
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == GOOD
    assert len(camera.orders) == 3


def test_a_trigger_that_is_not_answered_may_have_been_obeyed() -> None:
    assert scan(Camera(captured(4), taken=4, acks=(-1,))) == GOOD


def test_a_trigger_that_is_refused_is_reported() -> None:
    refused = scan(Camera(taken=4, acks=(dialect.MAV_RESULT_UNSUPPORTED,)))
    assert refused == ScanFailed(reason="the vehicle answered the trigger with UNSUPPORTED")


def test_a_scan_that_the_vehicle_reports_as_failed_has_failed() -> None:
    failed = ScanFailed(reason="the vehicle reports that the scan failed")
    assert scan(Camera(captured(4, result=0, url=""), taken=4)) == failed


def test_an_interrupted_scan_is_broken_off() -> None:
    interrupt, camera = Event(), Camera(taken=4)
    interrupt.set()
    assert scan(camera, interrupt=interrupt) == ScanFailed(reason="interrupted")
    assert [number for number, _ in camera.orders] == [
        dialect.MAV_CMD_IMAGE_START_CAPTURE,
        dialect.MAV_CMD_IMAGE_STOP_CAPTURE,
    ]


@pytest.mark.parametrize(
    ("poses", "why"),
    [
        ([(0.0, 0.0, 0.0, 0.0), (0.0, 0.06, 0.0, 0.0)], "the vehicle moved 0.06 m during the scan"),
        ([(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1, 0.0)], "the vehicle turned 6° during the scan"),
        (
            [(0.0, 0.0, 0.0, 0.0), *[(0.0, 0.0, 0.0, 0.2)] * 4],
            "the vehicle moved at 0.20 m/s during the scan",
        ),
    ],
)
def test_a_scan_while_the_vehicle_moves_has_failed_and_the_vehicle_must_stand(
    poses: list[tuple[float, float, float, float]], why: str
) -> None:
    camera = Camera(captured(4), taken=4)
    camera.poses = poses
    camera._tells = []
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    scanner.take(site_mission())
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == ScanFailed(reason=why)
    assert camera.orders[-1][0] == dialect.MAV_CMD_IMAGE_STOP_CAPTURE and camera.stops == 1


def test_an_operator_who_has_switched_the_mode_keeps_the_vehicle_after_a_spoilt_scan() -> None:
    camera = Camera(captured(4), taken=4)
    camera.poses, camera.switched = [(0.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)], "to MANUAL"
    assert isinstance(scan(camera), ScanFailed) and camera.stops == 0


def test_a_scan_during_which_somebody_takes_the_vehicle_has_failed_at_once() -> None:
    camera = Camera(taken=4)
    began = camera.command

    def taken(*order: float, **details: Any) -> Ack:
        camera.switched = camera.taken = "the autopilot is in MANUAL: somebody else drives it"
        return began(*order, **details)  # type: ignore[arg-type]

    camera.command = taken  # type: ignore[method-assign]
    slow = Scan(profile="default", duration_s=2.0, timeout_s=3000.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    failed = scanner.scan("run-s2-1", slow, interrupt=Event())
    assert isinstance(failed, ScanFailed) and "the vehicle was taken during the scan" in failed.reason
    assert camera.stops == 0


def test_a_position_that_wanders_within_the_tolerance_and_one_fast_report_are_noise() -> None:
    camera = Camera(captured(4), taken=4)
    camera.poses = [(0.0, 0.0, 0.0, 0.0), (0.04, 0.0, 0.0, 0.2), (0.0, 0.02, 0.05, 0.0)]
    assert scan(camera) == GOOD


def test_a_scan_during_which_the_autopilot_restarts_has_failed() -> None:
    camera = Camera(captured(4), taken=4)
    told = camera._tell

    def restart() -> None:
        camera.boots = 1
        told()

    camera._tell = restart  # type: ignore[method-assign]
    assert scan(camera) == ScanFailed(reason="the autopilot was restarted during the scan")


def test_a_scanner_of_its_own_component_is_asked_itself_and_not_measured_by_the_autopilots_count() -> None:
    camera = Camera(captured(0, component=100), taken=4)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    slow = Scan(profile="default", duration_s=2.0, timeout_s=60.0)
    assert scanner.scan("run-s1-1", slow, interrupt=Event()) == GOOD
    camera._taken = 14  # the autopilot counted a command that was repeated ten times
    camera.asked.clear()
    camera.answers = lambda request: captured(len(camera.orders) - 1, component=100)
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == GOOD
    assert {request.target_component for request in camera.asked} == {100}


def test_while_no_component_has_reported_a_scan_each_is_asked() -> None:
    camera = Camera(taken=4)
    camera.answers = lambda request: captured(0, component=100) if camera.orders else None
    slow = Scan(profile="default", duration_s=2.0, timeout_s=60.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s1-1", slow, interrupt=Event()) == GOOD
    assert {request.target_component for request in camera.asked} == {0, 1}
    assert all(request.param2 == 4 for request in camera.asked if request.target_component == 1)


@pytest.mark.parametrize("taken", [None, 4])
def test_a_picture_from_before_a_restart_of_the_gateway_counts_for_no_stop(taken: int | None) -> None:
    """It is the camera's last one, so the camera reports it whenever it is asked."""
    camera = Camera(taken=taken)
    camera.answers = lambda request: captured(3, component=100)
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=100))  # type: ignore[arg-type]
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == ScanFailed(reason="no result within 30 s")
    camera.orders.clear()
    camera.answers = lambda request: captured(3 + len(camera.orders), component=100)
    assert scanner.scan("run-s2-2", slow, interrupt=Event()) == GOOD


def test_a_picture_that_came_late_while_nobody_listened_counts_for_no_later_stop() -> None:
    camera = Camera(taken=None)
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=100))  # type: ignore[arg-type]
    assert isinstance(scanner.scan("run-s1-1", slow, interrupt=Event()), ScanFailed)
    camera.answers = lambda request: captured(0, component=100)  # the first scan's, after its time
    assert isinstance(scanner.scan("run-s2-1", slow, interrupt=Event()), ScanFailed)


def test_another_scanner_of_the_vehicle_is_not_the_one_that_counts() -> None:
    camera = Camera(captured(4), taken=4)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s1-1", SCAN, interrupt=Event()) == GOOD
    camera._tells = [captured(9, component=101)]
    assert scanner.scan("run-s2-1", SCAN, interrupt=Event()) == ScanFailed(reason="no result within 1 s")


def test_a_stop_is_found_in_its_label_whatever_its_id() -> None:
    assert stop_of("8534e8b51c59-room-2-s1-3") == "room-2-s1"
