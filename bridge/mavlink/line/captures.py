"""What a vehicle's camera tells of a scan: CAMERA_IMAGE_CAPTURED, whose file_url says what was written.

The file_url is `NAME.e57?size=N&points=N&sha256=HEX`; `capture_result` is 1 for a scan that was made.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from bridge.mavlink.desk.visits import Course
from bridge.mavlink.line.wire import Message
from bridge.robots import ScanFailed, ScanResult
from mission.document import Stop
from mission.events import Pose
from mission.geodesy import STEPS_PER_DEGREE, Geodetic, from_geodetic, heading_of
from mission.mavlink.autopilots import autopilot_named

NEAR_M = 0.5
"""A failure that is told from farther away is of another stop."""
STEPS_M = 0.02
"""Two steps of 1e-7 degrees, in which the camera tells where it was."""


@dataclass(frozen=True)
class Capture:
    """One message of the camera."""

    name: tuple[int, int]
    """The picture's number and the vehicle's time (ms since it was started); the same however often told."""
    pose: Pose | None
    """Where the vehicle was; `None` if it does not say."""
    result: ScanResult | ScanFailed

    def at(self, stop: Stop) -> bool:
        """Whether it is of this stop; one that does not say where it is from may be."""
        if self.pose is None:
            return True
        away = math.dist((self.pose.x, self.pose.y), (stop.x, stop.y))
        return away <= (NEAR_M if isinstance(self.result, ScanFailed) else stop.tolerance_m + STEPS_M)


def capture_of(message: Message, course: Course | None) -> Capture:
    """What the message tells of a scan."""
    name = (int(message.image_index), int(message.time_boot_ms))
    return Capture(name, _pose(message, course), _result(message))


def _pose(message: Message, course: Course | None) -> Pose | None:
    if course is None or (message.lat, message.lon) == (0, 0):
        return None
    site = course.sent.origin
    place = Geodetic(lat=message.lat / STEPS_PER_DEGREE, lon=message.lon / STEPS_PER_DEGREE)
    x, y = from_geodetic(site, place, autopilot_named(course.sent.autopilot).rule)
    w, i, j, k = message.q
    yaw = math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
    return Pose(x=x, y=y, heading=heading_of(site, math.degrees(yaw)))


def _result(message: Message) -> ScanResult | ScanFailed:
    url = urlsplit(message.file_url)
    if message.capture_result != 1:
        return ScanFailed(reason=f"the vehicle's camera reports that picture {message.image_index} failed")
    told = {name: values[-1] for name, values in parse_qs(url.query).items()}
    size, points = (_count(told.get(name, "")) for name in ("size", "points"))
    return ScanResult(file=url.path, size=size, points=points, sha256=told.get("sha256", ""))


def _count(text: str) -> int:
    """0 for what is no number, which makes a result that is none."""
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= 15 else 0
