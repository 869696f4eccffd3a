"""Reports of a vehicle by which a scan counts, and those by which it does not."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event
from typing import Any

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

SHA = hashlib.sha256(b"scan").hexdigest()
URL = f"scan-1.e57?size=1600&points=100&sha256={SHA}"
SCAN = Scan(profile="default", duration_s=2.0, timeout_s=1.0)
GOOD = ScanResult(file="scan-1.e57", size=1600, points=100, sha256=SHA)


def captured(index: int, *, url: str = URL, result: int = 1, boot_ms: int = 5000, system: int = 1) -> Message:
    message = dialect.MAVLink_camera_image_captured_message(
        boot_ms, 0, 0, 0, 0, 0, 0, (1.0, 0.0, 0.0, 0.0), index, result, url.encode()
    )
    message._header.srcSystem = system
    return message


class Camera:
    """A vehicle of which only the scanner's part is there; `tells` follow an accepted trigger."""

    def __init__(self, *tells: Message, taken: int | None = None, acks: tuple[int, ...] = (0,)) -> None:
        self.who = Who(1, 1)
        self.peer, self.wire, self.telemetry = self, self, self
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

    def command(self, number: int, *params: float, patience_s: float) -> Ack:
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


def test_a_script_is_told_the_stops_number_and_times() -> None:
    camera = Camera(captured(0))
    assert scan(camera, trigger="script") == GOOD
    assert camera.orders == [(dialect.MAV_CMD_DO_SEND_SCRIPT_MESSAGE, (100.0, 2.0, 2.0, 1.0))]


def test_an_older_picture_told_again_is_not_taken_for_the_new_one() -> None:
    old = captured(3, url=URL.replace("scan-1", "scan-0"))
    assert scan(Camera(old, captured(4), taken=4)) == GOOD
    assert scan(Camera(old, taken=4)) == ScanFailed(reason="no result within 1 s")


def test_what_was_told_for_one_scan_does_not_count_for_the_next() -> None:
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
    camera.answers = lambda request: captured(4) if (request.param1, request.param2) == (263, 4) else None
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == GOOD


def test_a_vehicle_that_is_busy_is_waited_for_and_what_it_then_tells_is_not_ours() -> None:
    busy = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    slow = Scan(profile="default", duration_s=2.0, timeout_s=30.0)
    camera = Camera(captured(5), acks=(busy, busy, 0))
    camera._box.put(captured(4, url=URL.replace("scan-1", "scan-0")))
    scanner = MavlinkScanner(camera, clock=WallClock(speed_up=10))  # type: ignore[arg-type]
    assert scanner.scan("run-s2-1", slow, interrupt=Event()) == GOOD
    assert len(camera.orders) == 3


def test_a_trigger_that_is_not_answered_may_have_been_obeyed() -> None:
    assert scan(Camera(captured(4), taken=4, acks=(-1,))) == GOOD


def test_a_trigger_that_is_refused_is_told() -> None:
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


def test_a_stop_is_found_in_its_label_whatever_its_id() -> None:
    assert stop_of("8534e8b51c59-room-2-s1-3") == "room-2-s1"
