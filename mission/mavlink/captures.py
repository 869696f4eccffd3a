"""What a vehicle's camera tells of a scan: CAMERA_IMAGE_CAPTURED, whose file_url says what was written.

The file_url is `NAME.e57?size=N&points=N&sha256=HEX`; `capture_result` is 1 for a scan that was made. What
lacks a piece is no confirmation.
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
"""What is told from farther away is of another stop."""
STEPS_M = 0.02
"""Two steps of 1e-7 degrees, in which the camera tells where it was."""
_NUMBER = re.compile(r"[1-9][0-9]{0,14}")

Picture = tuple[int, int]
"""The picture's number and the vehicle's time (ms since it was started); the same however often told."""


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
    """Where the vehicle was; `None` if it does not say."""
    result: ScanResult | ScanFailed

    def at(self, stop: Stop) -> bool:
        """Whether it is of this stop; one that does not say where it is from may be."""
        if self.pose is None:
            return True
        within_m = NEAR_M if isinstance(self.result, ScanFailed) else stop.tolerance_m + STEPS_M
        return not is_outside(deviation(self.pose, stop), within_m)

    def beside(self, at: int, stops: Sequence[Stop]) -> bool:
        """Whether it was made near this stop, and no nearer to the one before or after."""
        if self.pose is None:
            return False
        own, around = deviation(self.pose, stops[at]), stops[max(0, at - 1) : at + 2]
        return own <= NEAR_M and all(own <= deviation(self.pose, stop) for stop in around)


def capture_of(message: CaptureMessage, sent: ItemList | None) -> Capture:
    """What the message tells of a scan, placed in the site whose items were sent."""
    return Capture(picture_of(message), _pose(message, sent), result_of(message))


def picture_of(message: CaptureMessage) -> Picture:
    """What tells a picture from others; cameras that were started again count anew."""
    return int(message.image_index), int(message.time_boot_ms)


def result_of(message: CaptureMessage) -> ScanResult | ScanFailed:
    """What the message says of the scan."""
    if message.capture_result != 1:
        return ScanFailed(reason="the vehicle reports that the scan failed")
    return read_file_url(message.file_url)


def read_file_url(url: str) -> ScanResult | ScanFailed:
    """The file that `NAME.e57?size=N&points=N&sha256=HEX` tells of."""
    name, _, query = url.partition("?")
    told = dict(parse_qsl(query))
    scan = ScanResult(
        file=name if name.removesuffix(".e57") not in ("", name) else "",
        size=_count(told.get("size", "")),
        points=_count(told.get("points", "")),
        sha256=told.get("sha256", "").lower(),
    )
    missing = missing_fields(scan)
    return ScanFailed(reason=f"the vehicle told {url!r}, without {', '.join(missing)}") if missing else scan


def _count(text: str) -> int:
    """0 for what is no number, which no result has."""
    return int(text) if _NUMBER.fullmatch(text) else 0


def _pose(message: CaptureMessage, sent: ItemList | None) -> Pose | None:
    if sent is None or (message.lat, message.lon) == (0, 0):
        return None
    x, y = point_at(sent, message.lat, message.lon)
    w, i, j, k = message.q
    yaw = math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))
    return Pose(x=x, y=y, heading=heading_of(sent.origin, math.degrees(yaw)))
