"""What a vehicle tells, gathered into what is known of it at each moment."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from stopgo.mission.frames.geodesy import heading_of
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.autopilots.kind import Autopilot
from stopgo.mission.mavlink.captures import STEPS_M, Capture, Picture, capture_of
from stopgo.mission.mavlink.enums import MissionState, ModeFlag
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.following.steps import Observation
from stopgo.mission.mavlink.local_frame import LocalFrame, VehicleOrigin, is_elsewhere, local_frame
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.mavlink.telemetry import (
    Message,
    charge_of,
    global_speed,
    is_lost,
    local_speed,
    origin_of,
    place_of,
    stands_still,
)
from stopgo.mission.run.events import Arrived, Pose
from stopgo.mission.run.states import Run

CAPTURES_KEPT = 100
TOLD = (
    "HEARTBEAT", "MISSION_CURRENT", "MISSION_ITEM_REACHED", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT",
    "ATTITUDE", "SYS_STATUS", "BATTERY_STATUS", "CAMERA_IMAGE_CAPTURED", "GPS_GLOBAL_ORIGIN", "SYSTEM_TIME",
)  # fmt: skip
"""Messages that are looked at."""
NONE_YET: Picture = (-1, -1)


@dataclass(frozen=True)
class TimestampedMessage:
    """Something that was told, and when that came."""

    message: Message
    ns: int


@dataclass(frozen=True)
class Fix:
    """Where the robot stood, by one message."""

    pose: Pose
    speed: float
    still: bool
    ns: int


@dataclass(frozen=True)
class HeardCapture:
    """What a camera told, and what was known when it was first heard."""

    capture: Capture
    pose: Pose | None
    """Where the robot stood by its own word, unless the camera says that it was elsewhere."""
    ns: int


class Observer:
    """Takes messages one after another; asked, it says what they come to."""

    def __init__(self, autopilot: Autopilot) -> None:
        self._autopilot = autopilot
        self._newest: dict[str, TimestampedMessage] = {}
        self._captures: deque[HeardCapture] = deque(maxlen=CAPTURES_KEPT)
        self._frame: tuple[ListedMission, VehicleOrigin, LocalFrame] | None = None
        self._work: tuple[int, bool] | None = None
        """Sequence number that is worked on, and whether all is done."""
        self._work_ns = 0
        """Since when."""
        self._mode_began_ns = 0
        """When the vehicle was first seen in its present mode."""
        self.fix: Fix | None = None
        self.battery = 1.0
        """0 to 1, as last told."""

    def take(self, message: Message, listed: ListedMission | None, now_ns: int) -> str:
        """Remember what a message tells; its name."""
        name = str(message.get_type())
        before = (self.mode, self.armed)
        self._newest[name] = TimestampedMessage(message, now_ns)
        if (self.mode, self.armed) != before:
            self._mode_began_ns = now_ns
        taking = TAKING.get(name)
        if taking is not None:
            taking(self, message, listed, now_ns)
        return name

    @property
    def began_ns(self) -> int | None:
        """When the vehicle was started, by the newest message that tells its time."""
        newest = self._clock_told()
        return None if newest is None else newest.ns - int(newest.message.time_boot_ms) * 10**6

    @property
    def boot_ms(self) -> int:
        """Its time since it was started, as last told."""
        newest = self._clock_told()
        return 0 if newest is None else int(newest.message.time_boot_ms)

    def mode_explained(self, now_ns: int) -> bool:
        """Whether clock and item were told since the mode changed: by a reboot it does, and at the end."""
        newest = self._clock_told()
        told = newest is not None and min(newest.ns, self.current_ns) > self._mode_began_ns
        return told or is_lost((now_ns - self._mode_began_ns) / 1e9)

    def pose(self, now_ns: int) -> Pose | None:
        """Where it stands, unless it has not told so for a while."""
        fix = self.fix
        lost = fix is None or is_lost((now_ns - fix.ns) / 1e9)
        return None if fix is None or lost else fix.pose

    def _clock_told(self) -> TimestampedMessage | None:
        told = [self._newest[name] for name in CLOCKS if name in self._newest]
        return max(told, key=lambda seen: seen.ns, default=None)

    def fresh(self, within_s: float, now_ns: int) -> bool:
        """Whether what is wanted most comes in often enough."""
        oldest_ns = now_ns - round(within_s * 1e9)
        seen = [self._newest.get(name) for name in WANTED]
        return all(one is not None and one.ns > oldest_ns for one in seen)

    def complete(self, listed: ListedMission | None) -> bool:
        """Whether enough is known to say what the vehicle does, and where in its list."""
        told = {"HEARTBEAT", "MISSION_CURRENT"} <= self._newest.keys()
        return told and (listed is None or self.fix is not None)

    @property
    def mode(self) -> str:
        """AUTO, HOLD or another; empty before a heartbeat."""
        seen = self._newest.get("HEARTBEAT")
        return "" if seen is None else self._autopilot.mode_name(seen.message)

    @property
    def mode_ns(self) -> int:
        """When the mode was last told."""
        seen = self._newest.get("HEARTBEAT")
        return 0 if seen is None else seen.ns

    @property
    def armed(self) -> bool:
        seen = self._newest.get("HEARTBEAT")
        return seen is not None and bool(seen.message.base_mode & ModeFlag.SAFETY_ARMED)

    @property
    def sequence(self) -> int | None:
        """Number of the item that is worked on."""
        return None if self._work is None else self._work[0]

    @property
    def current_ns(self) -> int:
        """When the item that is worked on was last told."""
        seen = self._newest.get("MISSION_CURRENT")
        return 0 if seen is None else seen.ns

    @property
    def items(self) -> int | None:
        """How many items the vehicle says it holds, without home; `None` if it does not say."""
        seen = self._newest.get("MISSION_CURRENT")
        if seen is None:
            return None
        if seen.message.mission_state == MissionState.NO_MISSION:
            return 0
        return seen.message.total if 0 < seen.message.total < UNKNOWN_TOTAL else None

    def observe(
        self, run: Run, listed: ListedMission, arrived: Arrived | None = None, *, after: Picture = NONE_YET
    ) -> Observation | None:
        """What is seen of the vehicle, if enough is known.

        `arrived` tells that it was seen at its stop; scans count that were made after the one named `after`.
        """
        if self._work is None or "HEARTBEAT" not in self._newest:
            return None
        place, began_ns = self.place(listed), self._work_ns
        fix = self.fix if self.fix is not None and self.fix.ns > began_ns else None
        heard = self._heard(run, listed, arrived, after)
        return Observation(
            mode=self.mode, armed=self.armed, place=place,
            pose=None if fix is None else fix.pose,
            still=fix is not None and fix.still,
            scan=None if heard is None else heard.capture.result,
            stood=_stood(heard, arrived),
        )  # fmt: skip

    def place(self, listed: ListedMission) -> int:
        """Place in the list of what the vehicle works on; its length once all is done."""
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
        """What was told last of a scan at the stop that is worked on."""
        heard = self._heard(run, listed, arrived, after)
        return None if heard is None else heard.capture

    def _heard(
        self, run: Run, listed: ListedMission, arrived: Arrived | None, after: Picture
    ) -> HeardCapture | None:
        """A scan from beside its stop may be of an earlier try, unless it was told after the arrival."""
        stops = listed.mission.stops
        if run.at >= len(stops):
            return None
        since_ns = 0 if arrived is None else arrived.robot_ns
        for heard in reversed(self._captures):
            capture = heard.capture
            new = capture.name[1] > after[1] and capture.name != after
            if new and (capture.at(stops[run.at]) or (heard.ns > since_ns and capture.beside(run.at, stops))):
                return heard
        return None

    def _take_current(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        work = (message.seq, message.mission_state == MissionState.COMPLETE)
        if self._work != work:
            self._work, self._work_ns = work, now_ns

    def _take_origin(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        self._frame = None

    def _take_local(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        attitude, frame = self._newest.get("ATTITUDE"), self._local_frame(listed)
        if attitude is not None and frame is not None:
            pose = frame.pose(message.x, message.y, attitude.message.yaw)
            self._fix(pose, local_speed(message), attitude.message.yawspeed, now_ns)

    def _take_global(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        """Steps of 1e-7 degrees are centimetres: taken only of a vehicle that tells no local metres."""
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
        self.fix = Fix(pose, speed, stands_still(speed=speed, yaw_rate=yaw_rate), now_ns)

    def _take_battery(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        charge = charge_of(message.battery_remaining)
        self.battery = self.battery if charge is None else charge

    def _take_capture(self, message: Message, listed: ListedMission | None, now_ns: int) -> None:
        capture = capture_of(message, None if listed is None else listed.sent)
        if all(capture.name != known.capture.name for known in self._captures):
            self._captures.append(HeardCapture(capture, self._seen_at(capture, listed, now_ns), now_ns))

    def _seen_at(self, capture: Capture, listed: ListedMission | None, now_ns: int) -> Pose | None:
        """Where the vehicle itself says that it stands, if that is where its camera tells of."""
        pose = self.pose(now_ns)
        there = self._waits(listed) if capture.pose is None else _agree(capture.pose, pose)
        return pose if there else None

    def _waits(self, listed: ListedMission | None) -> bool:
        """Whether the vehicle is at a stop, and not on its way."""
        if listed is None or "MISSION_CURRENT" not in self._newest:
            return False
        place = self.place(listed)
        return any(items.at < place < items.after for items in listed.stops)

    def _local_frame(self, listed: ListedMission | None) -> LocalFrame | None:
        """The vehicle's local metres in the site; `None` before its origin is known, or if it is far away."""
        told = self._newest.get("GPS_GLOBAL_ORIGIN")
        if listed is None or told is None:
            return None
        origin = origin_of(told.message)
        if is_elsewhere(listed.sent.origin, origin.place):
            return None
        if self._frame is None or self._frame[:2] != (listed, origin):
            rule = autopilot_named(listed.sent.autopilot).rule
            self._frame = (listed, origin, local_frame(listed.sent.origin, origin, rule))
        return self._frame[2]


def _stood(heard: HeardCapture | None, arrived: Arrived | None) -> Pose | None:
    """Where the robot was scanned from; a camera tells that in steps of a centimetre, and after all else."""
    before = None if arrived is None else arrived.pose
    if heard is not None and heard.pose is not None:
        return heard.pose
    told = None if heard is None else heard.capture.pose
    return before if told is None or _agree(told, before) else told


def _agree(told: Pose | None, seen: Pose | None) -> bool:
    """Whether a camera's place is a pose, rounded to its steps."""
    if told is None or seen is None:
        return False
    return math.dist((told.x, told.y), (seen.x, seen.y)) <= STEPS_M


UNKNOWN_TOTAL = 65_535
WANTED = ("MISSION_CURRENT", "LOCAL_POSITION_NED", "ATTITUDE")
CLOCKS = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "ATTITUDE", "SYSTEM_TIME")
"""Messages with the vehicle's time since it was started."""
TAKING: dict[str, Callable[[Observer, Message, ListedMission | None, int], None]] = {
    "MISSION_CURRENT": Observer._take_current,
    "GPS_GLOBAL_ORIGIN": Observer._take_origin,
    "LOCAL_POSITION_NED": Observer._take_local,
    "GLOBAL_POSITION_INT": Observer._take_global,
    "SYS_STATUS": Observer._take_battery,
    "BATTERY_STATUS": Observer._take_battery,
    "CAMERA_IMAGE_CAPTURED": Observer._take_capture,
}
