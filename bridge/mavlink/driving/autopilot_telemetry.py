"""State that an autopilot reports: position, speed, battery and origin, and the age of each report."""

from __future__ import annotations

import math
import time
from collections import Counter

from stopgo.bridge.mavlink.vehicle_link.messages import interval
from stopgo.bridge.mavlink.vehicle_link.peer import Peer
from stopgo.bridge.mavlink.vehicle_link.wire import MessageQueue, Who
from stopgo.mission.document import Point
from stopgo.mission.mavlink.enums import MessageId
from stopgo.mission.mavlink.failsafes import RECENT_S, Failsafe, failsafe_of
from stopgo.mission.mavlink.following.vehicle_health import HealthReports, VehicleHealth
from stopgo.mission.mavlink.local_frame import VehicleOrigin
from stopgo.mission.mavlink.telemetry import (
    Message,
    has_numbers,
    is_lost,
    local_speed,
    origin_of,
    stands_still,
)

ASK_ORIGIN_S = 4.0
ORIGIN_S = 15.0
"""An origin that was not confirmed for this long is void: the vehicle was restarted and has none."""
POSE_HZ = 20
ASK_S = 1.0
"""Interval at which the rates of the wanted messages are checked."""
RARE = 0.4
"""A message below this fraction of its wanted rate is requested again; above it, the link loses the rest."""
LATE_GAPS, LOST_GAPS = 4.0, 20.0
"""Multiples of the longest recent pause after which a message is late, and lost."""
SOONEST_LATE_S, LATEST_S = 0.4, 2.0
SOONEST_LOST_S = 20.0
FORGETS = 0.998
"""Fraction of the longest pause that is remembered from one position to the next."""
POSE = ("LOCAL_POSITION_NED", "ATTITUDE")
HEARTBEAT_HZ = 4
"""Rate of the mode's reports, so that the vehicle is let go at once when somebody else takes it."""
STREAMS = {
    "HEARTBEAT": (MessageId.HEARTBEAT, HEARTBEAT_HZ),
    "LOCAL_POSITION_NED": (MessageId.LOCAL_POSITION_NED, POSE_HZ),
    "ATTITUDE": (MessageId.ATTITUDE, POSE_HZ),
    "BATTERY_STATUS": (MessageId.BATTERY_STATUS, 1),
    "SYS_STATUS": (MessageId.SYS_STATUS, 1),
    "EKF_STATUS_REPORT": (MessageId.EKF_STATUS_REPORT, 1),
    "ESTIMATOR_STATUS": (MessageId.ESTIMATOR_STATUS, 1),
    "FENCE_STATUS": (MessageId.FENCE_STATUS, 1),
    "RC_CHANNELS": (MessageId.RC_CHANNELS, 4),
}
"""Wanted messages by name: number of the message, times a second."""
UNANSWERED, SELDOM_S = 5, 30.0
"""Requests for a message that never came, after which it is requested this seldom: some vehicles lack it."""


class NewestMessages(MessageQueue):
    """The newest message of each type from the vehicle, its arrival time, and the regularity of positions."""

    def __init__(self, of: Who) -> None:
        super().__init__(of=of)
        self._newest: dict[str, tuple[float, Message]] = {}
        self._counts: Counter[str] = Counter()
        self._longest_s = 1.0 / POSE_HZ
        self._failsafe: tuple[float, Failsafe] | None = None
        self.health = HealthReports()

    def put(self, message: Message) -> None:
        """Take a message; a position or heading that is no number is late, as one that did not come."""
        if not has_numbers(message):
            return
        now_s = time.monotonic()
        self._counts[message.get_type()] += 1
        if message.get_type() == POSE[0]:
            gap_s = min(self.age_s(POSE[0]), LATEST_S)
            self._longest_s = max(gap_s, self._longest_s * FORGETS)
        self._newest[message.get_type()] = (now_s, message)
        self.health.take(message.get_type(), message)
        failsafe = failsafe_of(message.text) if message.get_type() == "STATUSTEXT" else None
        if failsafe is not None:
            self._failsafe = (now_s, failsafe)

    @property
    def recent_failsafe(self) -> Failsafe | None:
        """The failsafe that a text has just reported."""
        at_s, failsafe = self._failsafe or (-math.inf, None)
        return failsafe if time.monotonic() - at_s < RECENT_S else None

    def take_counts(self) -> Counter[str]:
        """Number of messages of each type since the last call."""
        counts, self._counts = self._counts, Counter()
        return counts

    def age_s(self, name: str) -> float:
        """Seconds since the newest of a type came."""
        return time.monotonic() - self._newest.get(name, (-math.inf, None))[0]

    @property
    def late_s(self) -> float:
        """Age at which a position is late, measured by the recent pauses on this link."""
        return max(SOONEST_LATE_S, min(LATEST_S, LATE_GAPS * self._longest_s))

    @property
    def lost_s(self) -> float:
        """Age at which a position is not late but lost."""
        return max(SOONEST_LOST_S, LOST_GAPS * self._longest_s)

    def newest(self, name: str, within_s: float = math.inf) -> Message | None:
        """The newest of a type, unless it is older than `within_s`."""
        return self.since(name, time.monotonic() - within_s)

    def fresh(self, name: str) -> Message | None:
        """The newest of a type, unless it is too old to describe the present."""
        at, message = self._newest.get(name, (-math.inf, None))
        return None if is_lost(time.monotonic() - at) else message

    def since(self, name: str, at_s: float) -> Message | None:
        """The newest of a type, if it came after a moment of the monotonic clock."""
        at, message = self._newest.get(name, (-math.inf, None))
        return message if at >= at_s else None


class AutopilotTelemetry:
    """Last reports of one vehicle. Positions are metres north and east of its origin, yaws from north."""

    def __init__(self, peer: Peer, newest: NewestMessages) -> None:
        self._peer = peer
        self._newest = newest
        self._boots = peer.boots
        self._unanswered: Counter[str] = Counter()
        self._asked_s: dict[str, float] = {}

    @property
    def has_pose(self) -> bool:
        """True once position and heading have been reported."""
        return all(self._newest.newest(name) is not None for name in POSE)

    def position(self) -> Point:
        report = self._report("LOCAL_POSITION_NED")
        return (report.x, report.y)

    def down(self) -> float:
        """Metres below the origin."""
        return float(self._report("LOCAL_POSITION_NED").z)

    def yaw(self) -> float:
        """Radians clockwise from north."""
        return float(self._report("ATTITUDE").yaw)

    def speed(self) -> float:
        """Metres per second; 0 when it is not known any more."""
        report = self._newest.fresh("LOCAL_POSITION_NED")
        return 0.0 if report is None else local_speed(report)

    def is_stationary(self) -> bool:
        """True if the vehicle reports that it neither moves nor turns; false while it does not report."""
        moved, turned = (self._newest.fresh(name) for name in POSE)
        if moved is None or turned is None:
            return False
        return stands_still(speed=local_speed(moved), yaw_rate=turned.yawspeed)

    def health(self) -> VehicleHealth:
        """Battery, position estimate, geofence and remote control, as last reported, however old."""
        return self._newest.health.now

    def origin(self, since_s: float | None = None) -> VehicleOrigin | None:
        """Origin of its local frame; `None` if it has none, or did not report it since then (monotonic)."""
        at_s = time.monotonic() - ORIGIN_S if since_s is None else since_s
        report = self._newest.since("GPS_GLOBAL_ORIGIN", at_s)
        return None if report is None else origin_of(report)

    @property
    def up_s(self) -> float:
        """Seconds since the autopilot was started, by its own clock."""
        return float(self._report("LOCAL_POSITION_NED").time_boot_ms) / 1000

    @property
    def is_late(self) -> bool:
        """True if the next position or heading is overdue."""
        return max(self._newest.age_s(name) for name in POSE) > self._newest.late_s

    @property
    def is_lost(self) -> bool:
        """True if the pose has been late for so long that waiting for it makes no sense."""
        return max(self._newest.age_s(name) for name in POSE) > self._newest.lost_s

    def why_unknown(self) -> str:
        """Reason why position or state of the vehicle are unknown; empty if they are known."""
        if is_lost(self._peer.silent_s):
            reason = f" ({self._peer.wire.disconnected})" if self._peer.wire.disconnected else ""
            return f"no data from the autopilot for {self._peer.silent_s:.0f} s{reason}"
        lost = [name for name in POSE if self._newest.fresh(name) is None]
        return f"the autopilot sends no {lost[0]}: has it lost its position?" if lost else ""

    def request_streams(self) -> None:
        """Request each message that comes too seldom: a restarted autopilot sends at its default rates."""
        came = self._newest.take_counts()
        if self._peer.boots != self._boots:
            self._boots = self._peer.boots
            self._unanswered.clear()
        for name, (number, hertz) in STREAMS.items():
            missing = self._newest.newest(name, 3.0 / hertz + 1.0) is None
            if (missing or came[name] < RARE * hertz * ASK_S - 1) and self._may_ask(name, came[name]):
                self._peer.send(interval(self._peer.who, number, hertz))
        if self._newest.newest("GPS_GLOBAL_ORIGIN", ASK_ORIGIN_S) is None:
            self._peer.request(MessageId.GPS_GLOBAL_ORIGIN)

    def _may_ask(self, name: str, came: int) -> bool:
        """True unless a message that never came was requested a while ago; poses are always requested."""
        known = came > 0 or name in POSE or self._newest.newest(name) is not None
        self._unanswered[name] = 0 if known else self._unanswered[name] + 1
        now_s = time.monotonic()
        if self._unanswered[name] > UNANSWERED and now_s < self._asked_s[name] + SELDOM_S:
            return False
        self._asked_s[name] = now_s
        return True

    def _report(self, name: str) -> Message:
        report = self._newest.newest(name)
        assert report is not None  # `OnboardAutopilot.await_pose`
        return report
