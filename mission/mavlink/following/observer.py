"""State of a vehicle at each moment, collected from its messages."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

from stopgo.mission.frames.geodesy import heading_of
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.captures import STEPS_M, Capture, Picture, capture_of
from stopgo.mission.mavlink.enums import MissionState, ModeFlag
from stopgo.mission.mavlink.failsafes import RECENT_S, UNNAMED, Failsafe, failsafe_of
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.scan_watch import ScanWatch
from stopgo.mission.mavlink.following.steps import Observation
from stopgo.mission.mavlink.local_frame import LocalFrame, VehicleOrigin, is_other_site, local_frame
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.mavlink.telemetry import (
    Message,
    charge_of,
    global_speed,
    is_lost,
    local_speed,
    mission_id_of,
    origin_of,
    place_of,
    stands_still,
)
from stopgo.mission.run.events import Arrived, Pose
from stopgo.mission.run.states import Run

CAPTURES_KEPT = 100
JUMP_SLACK_S = 1.0
"""Lateness of the vehicle's clock: its messages come several times a second, and may be lost."""
USED_MESSAGES = (
    "HEARTBEAT", "MISSION_CURRENT", "MISSION_ITEM_REACHED", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
    "ATTITUDE", "SYS_STATUS", "BATTERY_STATUS", "CAMERA_IMAGE_CAPTURED", "GPS_GLOBAL_ORIGIN", "SYSTEM_TIME",
    "STATUSTEXT",
)  # fmt: skip
"""Messages that are used."""
NONE_YET: Picture = (-1, -1)


@dataclass(frozen=True)
class TimestampedMessage:
    """A message, and the time of its arrival."""

    message: Message
    ns: int


@dataclass(frozen=True)
class Fix:
    """Pose and speed of the robot, from one message."""

    pose: Pose
    speed: float
    still: bool
    ns: int


@dataclass(frozen=True)
class CaptureReport:
    """A camera report, and the robot's pose when it first came."""

    capture: Capture
    pose: Pose | None
    """Pose as reported by the robot, unless the camera reports another position."""
    ns: int


@dataclass(frozen=True)
class Jump:
    """A change of the current item beyond waits that cannot have been over."""

    listed: ListedMission
    first: int
    """Index of the item before it."""
    end: int
    """Index of the item after it."""


class Observer:
    """Takes messages one after another; returns the state on request."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._newest: dict[str, TimestampedMessage] = {}
        self._captures: deque[CaptureReport] = deque(maxlen=CAPTURES_KEPT)
        self._frame: tuple[ListedMission, VehicleOrigin, LocalFrame] | None = None
        self._work: tuple[int, bool] | None = None
        """Sequence number of the current item, and True if all is done."""
        self._work_ns = 0
        """Time since when it is current."""
        self._work_ms = 0
        """Time since then on the vehicle's own clock."""
        self._jump: Jump | None = None
        """The last jump, as far as the vehicle has not gone back behind it."""
        self._mode_began_ns = 0
        """Time when the vehicle was first in its present mode."""
        self._scan_watch = ScanWatch()
        self._failsafe: tuple[Failsafe, int] | None = None
        """The failsafe that a text reported last, and when."""
        self.fix: Fix | None = None
        self.battery = 1.0
        """0 to 1, as last reported."""

    def take(self, message: Message, listed: ListedMission | None, now_ns: int) -> str:
        """Store a message; return its name."""
        name = str(message.get_type())
        before = (self.mode, self.armed)
        self._newest[name] = TimestampedMessage(message, now_ns)
        if (self.mode, self.armed) != before:
            self._mode_began_ns = now_ns
        handler = HANDLERS.get(name)
        if handler is not None:
            handler(self, message, listed, now_ns)
        return name

    @property
    def began_ns(self) -> int | None:
        """Time of the vehicle's boot, by the newest message that contains its time."""
        newest = self._newest_clock()
        return None if newest is None else newest.ns - int(newest.message.time_boot_ms) * 10**6

    @property
    def boot_ms(self) -> int:
        """Its time since boot, as last reported."""
        newest = self._newest_clock()
        return 0 if newest is None else int(newest.message.time_boot_ms)

    def mode_explained(self, now_ns: int) -> bool:
        """Return True if clock and item came since the mode changed, which a reboot or an end may explain."""
        newest = self._newest_clock()
        explained = newest is not None and min(newest.ns, self.current_ns) > self._mode_began_ns
        return explained or is_lost((now_ns - self._mode_began_ns) / 1e9)

    def pose(self, now_ns: int) -> Pose | None:
        """Return the pose, unless the last one is too old."""
        fix = self.fix
        lost = fix is None or is_lost((now_ns - fix.ns) / 1e9)
        return None if fix is None or lost else fix.pose

    def _newest_clock(self) -> TimestampedMessage | None:
        clocks = [self._newest[name] for name in CLOCKS if name in self._newest]
        return max(clocks, key=lambda one: one.ns, default=None)

    def fresh(self, within_s: float, now_ns: int) -> bool:
        """Return True if the most important messages come often enough."""
        oldest_ns = now_ns - round(within_s * 1e9)
        newest = [self._newest.get(name) for name in WANTED]
        return all(one is not None and one.ns > oldest_ns for one in newest)

    def complete(self, listed: ListedMission | None) -> bool:
        """Return True if the vehicle's state, and its position in the list, can be determined."""
        known = {"HEARTBEAT", "MISSION_CURRENT"} <= self._newest.keys()
        return known and (listed is None or self.fix is not None)

    @property
    def mode(self) -> str:
        """AUTO, HOLD or another; empty before a heartbeat."""
        newest = self._newest.get("HEARTBEAT")
        return "" if newest is None else self._autopilot.mode_name(newest.message)

    @property
    def mode_ns(self) -> int:
        """Time of the last report of the mode."""
        newest = self._newest.get("HEARTBEAT")
        return 0 if newest is None else newest.ns

    @property
    def armed(self) -> bool:
        newest = self._newest.get("HEARTBEAT")
        return newest is not None and bool(newest.message.base_mode & ModeFlag.SAFETY_ARMED)

    @property
    def sequence(self) -> int | None:
        """Number of the current item."""
        return None if self._work is None else self._work[0]

    @property
    def current_ns(self) -> int:
        """Time of the last report of the current item."""
        newest = self._newest.get("MISSION_CURRENT")
        return 0 if newest is None else newest.ns

    @property
    def items(self) -> int | None:
        """Number of items on the vehicle, without home; `None` if it is not reported."""
        newest = self._newest.get("MISSION_CURRENT")
        if newest is None:
            return None
        if newest.message.mission_state == MissionState.NO_MISSION:
            return 0
        return newest.message.total if 0 < newest.message.total < UNKNOWN_TOTAL else None

    @property
    def mission_id(self) -> int:
        """Id of the vehicle's list, which changes with it; 0 if the vehicle reports none."""
        newest = self._newest.get("MISSION_CURRENT")
        return 0 if newest is None else mission_id_of(newest.message)

    def observe(
        self, run: Run, listed: ListedMission, arrived: Arrived | None = None, *, after: Picture = NONE_YET
    ) -> Observation | None:
        """Return the observation of the vehicle, if enough is known.

        `arrived` is its arrival at the current stop; only scans made after the one named `after` count.
        """
        if self._work is None or "HEARTBEAT" not in self._newest:
            return None
        place, began_ns = self.place(listed), self._work_ns
        fix = self.fix if self.fix is not None and self.fix.ns > began_ns else None
        report = self._report_of(run, listed, arrived, after)
        return Observation(
            mode=self.mode, armed=self.armed, place=place,
            pose=None if fix is None else fix.pose,
            still=fix is not None and fix.still,
            scan=None if report is None else report.capture.result,
            stood=_stood(report, arrived),
            is_jumped=self._is_jumped(run, listed),
            failsafe=self._failsafe_text(), moved=self._moved(run, listed),
        )  # fmt: skip

    def _moved(self, run: Run, listed: ListedMission) -> str:
        stops = listed.stops
        return self._scan_watch.why(listed, stops[run.at].stop) if run.at < len(stops) else ""

    def _failsafe_text(self) -> str:
        """Return the failsafe that may have caused the present mode; empty if none is reported."""
        if self._failsafe is not None and self._failsafe[1] > self._mode_began_ns - RECENT_S * 1e9:
            return str(self._failsafe[0])
        return UNNAMED if self._autopilot.in_failsafe(self._newest["HEARTBEAT"].message) else ""

    def place(self, listed: ListedMission) -> int:
        """Return the index in the list of the current item; the list's length once all is done."""
        current = self._newest["MISSION_CURRENT"].message
        if current.mission_state == MissionState.COMPLETE:
            return listed.end
        reached = self._newest.get("MISSION_ITEM_REACHED")
        last = listed.sequence(listed.end - 1)
        through = reached is not None and reached.message.seq == last == current.seq
        if through and current.mission_state == MissionState.UNKNOWN:
            return listed.end
        return listed.place(current.seq)

    def capture(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> Capture | None:
        """Return the last report of a scan at the current stop."""
        report = self._report_of(run, listed, arrived, after)
        return None if report is None else report.capture

    def _report_of(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> CaptureReport | None:
        """Return the newest report of the stop; one from near it counts only if it came after the arrival."""
        stops = listed.mission.stops
        if run.at >= len(stops):
            return None
        since_ns = 0 if arrived is None else arrived.robot_ns
        for report in reversed(self._captures):
            capture = report.capture
            new = capture.name[1] > after[1] and capture.name != after
            if new and (
                capture.may_be_of(stops[run.at])
                or (report.ns > since_ns and capture.is_nearest(run.at, stops))
            ):
                return report
        return None

    def _take_current(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        work = (message.seq, message.mission_state == MissionState.COMPLETE)
        if listed is not None:
            self._scan_watch.take_item(listed, self.place(listed), same=self._work == work)
        if self._work == work:
            return
        if self._work is not None and listed is not None:
            self._take_place(listed, self._work, now_ns)
        self._work, self._work_ns, self._work_ms = work, now_ns, self.boot_ms

    def _take_place(self, listed: ListedMission, before: tuple[int, bool], now_ns: int) -> None:
        """Note a jump: the item has changed before the waits between the two can have been over."""
        first = listed.end if before[1] else listed.place(before[0])
        place, waits_s = self.place(listed), 0.0
        if self._jump is not None and (self._jump.listed is not listed or place < self._jump.end):
            self._jump = replace(self._jump, end=place) if self._jump.listed is listed else None
        if place <= first or not 0 < self._work_ms <= self.boot_ms:
            return
        waits_s = listed.wait_s(first, place)
        passed_s = max((now_ns - self._work_ns) / 1e9, (self.boot_ms - self._work_ms) / 1e3)
        if waits_s > passed_s + JUMP_SLACK_S:
            self._jump = Jump(listed, first, place)

    def _is_jumped(self, run: Run, listed: ListedMission) -> bool:
        jump = self._jump
        if jump is None or jump.listed is not listed or run.at >= len(listed.stops):
            return False
        return jump.first < listed.stops[run.at].after <= jump.end

    def _take_origin(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        self._frame = None

    def _take_local(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        attitude, frame = self._newest.get("ATTITUDE"), self._local_frame(listed)
        if attitude is not None and frame is not None:
            pose = frame.pose(message.x, message.y, attitude.message.yaw)
            self._fix(pose, local_speed(message), attitude.message.yawspeed, now_ns)

    def _take_global(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        """Take a global position: in centimetres, so only without local metres from the vehicle."""
        attitude = self._newest.get("ATTITUDE")
        if listed is None or attitude is None or place_of(message) is None:
            return
        if "LOCAL_POSITION_NED" in self._newest and self._local_frame(listed) is not None:
            return
        x, y = point_at(listed.sent, message.lat, message.lon)
        heading = heading_of(listed.sent.origin, math.degrees(attitude.message.yaw))
        speed = global_speed(message)
        self._fix(Pose(x=x, y=y, heading=heading), speed, attitude.message.yawspeed, now_ns)

    def _fix(self, pose: Pose, speed: float, yaw_rate: float, now_ns: int) -> None:
        self._scan_watch.take_pose(pose, speed)
        self.fix = Fix(pose, speed, stands_still(speed=speed, yaw_rate=yaw_rate), now_ns)

    def _take_battery(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        charge = charge_of(message.battery_remaining)
        self.battery = self.battery if charge is None else charge

    def _take_text(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        failsafe = failsafe_of(message.text)
        self._failsafe = self._failsafe if failsafe is None else (failsafe, now_ns)

    def _take_capture(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        capture = capture_of(message, None if listed is None else listed.sent)
        if all(capture.name != known.capture.name for known in self._captures):
            self._captures.append(CaptureReport(capture, self._seen_at(capture, listed, now_ns), now_ns))

    def _seen_at(self, capture: Capture, listed: ListedMission | None, now_ns: int) -> Pose | None:
        """Return the vehicle's own pose, if it agrees with the camera's position."""
        pose = self.pose(now_ns)
        there = self._waits(listed) if capture.pose is None else _agree(capture.pose, pose)
        return pose if there else None

    def _waits(self, listed: ListedMission | None) -> bool:
        """Return True if the vehicle is at a stop, and not driving."""
        if listed is None or "MISSION_CURRENT" not in self._newest:
            return False
        place = self.place(listed)
        return any(items.at < place < items.after for items in listed.stops)

    def _local_frame(self, listed: ListedMission | None) -> LocalFrame | None:
        """Return the vehicle's local frame in the site; `None` if its origin is unknown or far away."""
        known = self._newest.get("GPS_GLOBAL_ORIGIN")
        if listed is None or known is None:
            return None
        origin = origin_of(known.message)
        if is_other_site(listed.sent.origin, origin.place):
            return None
        if self._frame is None or self._frame[:2] != (listed, origin):
            rule = autopilot_named(listed.sent.autopilot).rule
            self._frame = (listed, origin, local_frame(listed.sent.origin, origin, rule))
        return self._frame[2]


def _stood(report: CaptureReport | None, arrived: Arrived | None) -> Pose | None:
    """Return the pose of the scan; a camera reports it in steps of a centimetre, and last."""
    before = None if arrived is None else arrived.pose
    if report is not None and report.pose is not None:
        return report.pose
    reported = None if report is None else report.capture.pose
    return before if reported is None or _agree(reported, before) else reported


def _agree(camera: Pose | None, robot: Pose | None) -> bool:
    """Return True if a camera's position is a pose, rounded to its steps."""
    if camera is None or robot is None:
        return False
    return math.dist((camera.x, camera.y), (robot.x, robot.y)) <= STEPS_M


UNKNOWN_TOTAL = 65_535
WANTED = ("MISSION_CURRENT", "LOCAL_POSITION_NED", "ATTITUDE")
CLOCKS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "ATTITUDE", "SYSTEM_TIME")
"""Messages with the vehicle's time since boot."""
HANDLERS: dict[str, Callable[[Observer, Message, ListedMission | None, int], None]] = {
    "MISSION_CURRENT": Observer._take_current,
    "GPS_GLOBAL_ORIGIN": Observer._take_origin,
    "LOCAL_POSITION_NED": Observer._take_local,
    "GLOBAL_POSITION_INT": Observer._take_global,
    "SYS_STATUS": Observer._take_battery,
    "BATTERY_STATUS": Observer._take_battery,
    "CAMERA_IMAGE_CAPTURED": Observer._take_capture,
    "STATUSTEXT": Observer._take_text,
}
