"""Camera reports of scans: CAMERA_IMAGE_CAPTURED, whose file_url describes the written file.

The file_url is `NAME.e57?size=N&points=N&sha256=HEX`; `capture_result` is 1 for a completed scan. A file_url
without one of these fields is no confirmation.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import parse_qsl

from stopgo.mission.document import Stop
from stopgo.mission.frames.geodesy import heading_of
from stopgo.mission.mavlink.items import ItemList
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult, missing_fields
from stopgo.mission.run.tolerance import deviation, is_outside

NEAR_M = 0.5
"""A report from farther away belongs to another stop."""
STEPS_M = 0.02
"""Two steps of 1e-7 degrees, the resolution of the camera's position."""
_NUMBER = re.compile(r"[1-9][0-9]{0,14}")

Picture = tuple[int, int]
"""The picture's number and the vehicle's time (ms since boot); the same in every repeated report."""


class CaptureMessage(Protocol):
    """The fields of CAMERA_IMAGE_CAPTURED that are read."""

    image_index: int
    time_boot_ms: int
    lat: int
    lon: int
    q: Sequence[float]
    capture_result: int
    file_url: str


@dataclass(frozen=True)
class Capture:
    """One message of the camera."""

    name: Picture
    pose: Pose | None
    """Pose of the vehicle; `None` if it is not reported."""
    result: ScanResult | ScanFailed

    def may_be_of(self, stop: Stop) -> bool:
        """True if it may be of this stop; a report without a position may be of any."""
        if self.pose is None:
            return True
        within_m = NEAR_M if isinstance(self.result, ScanFailed) else stop.tolerance_m + STEPS_M
        return not is_outside(deviation(self.pose, stop), within_m)

    def is_nearest(self, at: int, stops: Sequence[Stop]) -> bool:
        """True if it was made near this stop, and no nearer to the one before or after."""
        if self.pose is None:
            return False
        own, around = deviation(self.pose, stops[at]), stops[max(0, at - 1) : at + 2]
        return own <= NEAR_M and all(own <= deviation(self.pose, stop) for stop in around)


def capture_of(message: CaptureMessage, sent: ItemList | None) -> Capture:
    """Return the message's scan report, in the frame of the site whose items were sent."""
    return Capture(picture_of(message), _pose(message, sent), result_of(message))


def picture_of(message: CaptureMessage) -> Picture:
    """Return the picture's identity; a camera that restarts counts from the beginning."""
    return int(message.image_index), int(message.time_boot_ms)


def result_of(message: CaptureMessage) -> ScanResult | ScanFailed:
    """Return the message's scan outcome."""
    if message.capture_result != 1:
        return ScanFailed(reason="the vehicle reports that the scan failed")
    return read_file_url(message.file_url)


def read_file_url(url: str) -> ScanResult | ScanFailed:
    """Return the file of a `NAME.e57?size=N&points=N&sha256=HEX`."""
    name, _, query = url.partition("?")
    values = dict(parse_qsl(query))
    scan = ScanResult(
        file=name if name.removesuffix(".e57") not in ("", name) else "",
        size=_count(values.get("size", "")),
        points=_count(values.get("points", "")),
        sha256=values.get("sha256", "").lower(),
    )
    missing = missing_fields(scan)
    return ScanFailed(reason=f"the vehicle sent {url!r}, without {', '.join(missing)}") if missing else scan


def _count(text: str) -> int:
    """Return 0 for text that is no number; no scan result has a 0."""
    return int(text) if _NUMBER.fullmatch(text) else 0


def _pose(message: CaptureMessage, sent: ItemList | None) -> Pose | None:
    if sent is None or (message.lat, message.lon) == (0, 0):
        return None
    x, y = point_at(sent, message.lat, message.lon)
    w, i, j, k = message.q
    yaw = math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
    return Pose(x=x, y=y, heading=heading_of(sent.origin, math.degrees(yaw)))
