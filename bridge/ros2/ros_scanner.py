"""A scanner behind a ROS 2 service or action; a scan counts only if the robot stood all the time."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from threading import Event
from typing import Any

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.ros2.ros_port import RosCall, RosPort
from stopgo.bridge.ros2.ros_settings import ScanCall
from stopgo.bridge.ros2.ros_telemetry import RosTelemetry
from stopgo.mission.document import Scan
from stopgo.mission.run.scan_motion import MOVES_M_S
from stopgo.mission.run.scans import ScanFailed, ScanResult

LOOK_S = 0.1
STILL_S = 10.0
"""Longest wait before a scan for a standstill that odometry shows."""
SILENT_S = 2.0
"""Longest time during a scan in which the robot's motion may be unknown."""
LATE = "its last scan may still be in progress"


class RosScanner:
    """The scanner of one robot."""

    profiles: tuple[str, ...] | None = None

    def __init__(self, port: RosPort, telemetry: RosTelemetry, *, clock: Clock, settings: ScanCall) -> None:
        self._port = port
        self._telemetry = telemetry
        self._clock = clock
        self._settings = settings
        self._late: RosCall | None = None
        """A call that was given up, and whose end is not known yet."""

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        why = self.wait_until_free(interrupt) or self._wait_until_ready(interrupt)
        if why:
            return ScanFailed(reason=why)
        call = self._port.trigger(self._request(label, scan))
        spoilt = self._wait_for(call, scan.timeout_s, interrupt)
        if spoilt:
            self._give_up(call)
            return ScanFailed(reason=spoilt)
        return result_of(call, self._settings)

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Always unknown: no response is kept for a program that has ended."""
        return None

    def wait_until_free(self, interrupt: Event) -> str:
        """Wait for the end of a scan that was given up; return why it may still be in progress.

        After `late_s` it is reported once and forgotten: who lets the robot go on then has looked.
        """
        end_ns = self._clock.now_ns() + round(self._settings.late_s * 1e9)
        while self._is_busy() and not self._clock.wait(LOOK_S, interrupt):
            if self._clock.now_ns() > end_ns:
                self._late = None
                return f"the scanner has not answered for {self._settings.late_s:g} s; {LATE}"
        return ""

    def _is_busy(self) -> bool:
        late = self._late
        return late is not None and late.fields is None and not late.error

    def _give_up(self, call: RosCall) -> None:
        call.drop()
        self._late = call

    def _wait_until_ready(self, interrupt: Event) -> str:
        """Wait until the robot stands and the scanner is free; return why it is not so in time."""
        end_ns = self._clock.now_ns() + round(STILL_S * 1e9)
        while why := self._not_ready():
            if self._clock.wait(LOOK_S, interrupt):
                return "interrupted"
            if self._clock.now_ns() > end_ns:
                return why
        return ""

    def _not_ready(self) -> str:
        if missing := self._port.missing("scan"):
            return missing
        return self._moves() or ("" if self._telemetry.still() else "the robot does not stand")

    def _moves(self) -> str:
        """Return what shows that the robot moves or may move; empty if nothing does."""
        foreign = self._port.foreign_goals()
        if foreign:
            return f"another client drives the robot ({foreign[0]})"
        return self._telemetry.silence() or self._telemetry.conflict()

    def _wait_for(self, call: RosCall, timeout_s: float, interrupt: Event) -> str:
        """Wait for the call's end; return why the scan does not count, empty if it may."""
        now_ns = self._clock.now_ns()
        end_ns, known_ns = now_ns + round(timeout_s * 1e9), now_ns
        while call.fields is None and not call.error:
            if self._clock.wait(LOOK_S, interrupt):
                return "interrupted"
            now_ns = self._clock.now_ns()
            if not self._telemetry.silence():
                known_ns = now_ns
            why = self._spoilt(now_ns - known_ns)
            if why:
                return why
            if now_ns > end_ns:
                return f"no result within {timeout_s:g} s"
        return self._spoilt(0)

    def _spoilt(self, unknown_ns: int) -> str:
        speed = self._telemetry.speed()
        if speed > MOVES_M_S:
            return f"the robot moved at {speed:.2f} m/s during the scan"
        if not self._telemetry.silence():
            return self._moves()
        return self._telemetry.silence() if unknown_ns > SILENT_S * 1e9 else ""

    def _request(self, label: str, scan: Scan) -> dict[str, Any]:
        values = {
            "label": label,
            "stop": label.partition("-")[2].rpartition("-")[0],
            "profile": scan.profile,
            "duration_s": scan.duration_s,
            "timeout_s": scan.timeout_s,
        }
        return {field: filled(value, values) for field, value in self._settings.request.items()}


def filled(value: Any, values: Mapping[str, Any]) -> Any:
    """Return a request's value; a text that is one name in braces becomes the named value with its type."""
    if isinstance(value, dict):
        return {key: filled(inner, values) for key, inner in value.items()}
    if not isinstance(value, str):
        return value
    if value.startswith("{") and value[1:-1] in values:
        return values[value[1:-1]]
    for name, given in values.items():
        value = value.replace(f"{{{name}}}", str(given))
    return value


def result_of(call: RosCall, settings: ScanCall) -> ScanResult | ScanFailed:
    """Return the scan that a response reports; whatever it lacks is empty, so that it is not confirmed."""
    if call.error:
        return ScanFailed(reason=f"the scanner's call failed: {call.error}")
    fields = call.fields or {}
    if settings.success and not found(fields, settings.success):
        said = str(found(fields, settings.message) or "")
        return ScanFailed(reason="the scanner reported a failure" + (f": {said}" if said else ""))
    file = str(found(fields, settings.file) or "")
    size, sha256 = _count(found(fields, settings.size)), str(found(fields, settings.sha256) or "")
    if settings.folder and file and not (size and sha256):
        try:
            size, sha256 = _measured(Path(settings.folder) / Path(file).name)
        except OSError as error:
            return ScanFailed(reason=f"{file}: not in {settings.folder} ({error.strerror})")
    return ScanResult(file=file, size=size, sha256=sha256, points=_count(found(fields, settings.points)))


def _count(value: Any) -> int:
    try:
        return max(0, int(value or 0))
    except (TypeError, ValueError, OverflowError):
        return 0


def found(fields: Any, path: str) -> Any:
    """Return the value at a path of names; a text on the way is read as JSON. `None` if there is none."""
    at: Any = fields
    for name in filter(None, path.split(".")):
        if isinstance(at, str):
            try:
                at = json.loads(at)
            except ValueError:
                return None
        at = at.get(name) if isinstance(at, Mapping) else None
    return at


def _measured(path: Path) -> tuple[int, str]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        return file.tell(), digest.hexdigest()
