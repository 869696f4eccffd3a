"""Pose and speed of a vehicle in the site, from its messages."""

from __future__ import annotations

import math
from dataclasses import dataclass

from stopgo.mission.frames.geodesy import heading_of
from stopgo.mission.mavlink.autopilots import autopilot_named
from stopgo.mission.mavlink.following.listed_mission import ListedMission
from stopgo.mission.mavlink.local_frame import LocalFrame, VehicleOrigin, is_other_site, local_frame
from stopgo.mission.mavlink.read_back import point_at
from stopgo.mission.mavlink.telemetry import (
    Message,
    global_speed,
    has_numbers,
    is_lost,
    local_speed,
    origin_of,
    place_of,
    stands_still,
)
from stopgo.mission.run.events import Pose


@dataclass(frozen=True)
class Fix:
    """Pose and speed of the robot, from one message."""

    pose: Pose
    speed: float
    still: bool
    ns: int


class VehiclePoses:
    """Takes positions, attitudes and origins; `fix` is the newest pose."""

    def __init__(self) -> None:
        self._origin: Message | None = None
        self._attitude: Message | None = None
        self._has_local = False
        """True once the vehicle has reported local metres."""
        self._frame: tuple[ListedMission, VehicleOrigin, LocalFrame] | None = None
        self.fix: Fix | None = None

    @property
    def origin(self) -> VehicleOrigin | None:
        """Origin of its local metres, as last reported."""
        return None if self._origin is None else origin_of(self._origin)

    def pose(self, now_ns: int) -> Pose | None:
        """Return the pose, unless the last one is too old."""
        fix = self.fix
        lost = fix is None or is_lost((now_ns - fix.ns) / 1e9)
        return None if fix is None or lost else fix.pose

    def take(self, name: str, message: Message, listed: ListedMission | None, now_ns: int) -> Fix | None:
        """Take a message; return the pose that it gives."""
        if not has_numbers(message):
            return None
        if name == "GPS_GLOBAL_ORIGIN":
            self._origin, self._frame = message, None
        elif name == "ATTITUDE":
            self._attitude = message
        elif name == "LOCAL_POSITION_NED":
            self._has_local = True
            return self._take_local(message, listed, now_ns)
        elif name == "GLOBAL_POSITION_INT":
            return self._take_global(message, listed, now_ns)
        return None

    def _take_local(self, message: Message, listed: ListedMission | None, now_ns: int) -> Fix | None:
        attitude, frame = self._attitude, self._local_frame(listed)
        if attitude is None or frame is None:
            return None
        return self._fix(frame.pose(message.x, message.y, attitude.yaw), local_speed(message), now_ns)

    def _take_global(self, message: Message, listed: ListedMission | None, now_ns: int) -> Fix | None:
        """Take a global position: in centimetres, so only without local metres from the vehicle."""
        attitude = self._attitude
        if listed is None or attitude is None or place_of(message) is None:
            return None
        if self._has_local and self._local_frame(listed) is not None:
            return None
        x, y = point_at(listed.sent, message.lat, message.lon)
        heading = heading_of(listed.sent.origin, math.degrees(attitude.yaw))
        return self._fix(Pose(x=x, y=y, heading=heading), global_speed(message), now_ns)

    def _fix(self, pose: Pose, speed: float, now_ns: int) -> Fix:
        assert self._attitude is not None
        still = stands_still(speed=speed, yaw_rate=self._attitude.yawspeed)
        self.fix = Fix(pose, speed, still, now_ns)
        return self.fix

    def _local_frame(self, listed: ListedMission | None) -> LocalFrame | None:
        """Return the vehicle's local frame in the site; `None` if its origin is unknown or far away."""
        if listed is None or self._origin is None:
            return None
        origin = origin_of(self._origin)
        if is_other_site(listed.sent.origin, origin.place):
            return None
        if self._frame is None or self._frame[:2] != (listed, origin):
            rule = autopilot_named(listed.sent.autopilot).rule
            self._frame = (listed, origin, local_frame(listed.sent.origin, origin, rule))
        return self._frame[2]
