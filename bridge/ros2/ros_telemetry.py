"""Position and motion of a robot from tf and odometry, with their ages, jumps and clocks.

Ages count from the arrival of a sample with a newer stamp, on this program's clock. So a publisher that
repeats an old sample counts as silent, and a computer with another date does not.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import dataclass

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import BaseHealth
from stopgo.bridge.ros2.ros_settings import FrameNames, RosLimits
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose

STILL_M_S = 0.02
STILL_RAD_S = 0.02
COMMAND_S = 0.5
"""Time for which a velocity command counts: drives stop without a newer one."""
SEEN_JUMP_M = 0.1
"""Shift of the localisation that counts as a jump."""
FASTEST_M_S = 3.0
"""No robot that scans is faster: odometry that is has jumped."""
TO_AND_FRO_S = 2.0
TO_AND_FRO = 3
"""Number of jumps of one transform, within `TO_AND_FRO_S`, that show two publishers."""
SET_BACK_NS = 10**9
"""A stamp that is so much older comes from a clock that was set back, and counts."""
DEPTH = 16
"""Most transforms from the map to the base."""


@dataclass(frozen=True)
class PoseJump:
    """A shift of the robot's pose that no drive explains."""

    metres: float
    words: str
    ns: int


@dataclass
class _Link:
    """A transform of tf from a child's frame to its parent's."""

    parent: str
    transform: Transform
    stamp_ns: int
    arrived_ns: int
    static: bool


class RosTelemetry:
    """The newest samples; the node's thread brings them, any thread reads them."""

    def __init__(self, clock: Clock, frames: FrameNames, limits: RosLimits) -> None:
        self._clock = clock
        self._frames = frames
        self._limits = limits
        self._lock = threading.Lock()
        self._links: dict[str, _Link] = {}
        self._odometry_ns: int | None = None
        self._odometry_stamp_ns = -1
        self._velocity = (0.0, 0.0)
        self._commanded_ns: int | None = None
        self._jumps: deque[tuple[str, int]] = deque(maxlen=32)
        self._last = Pose(x=0.0, y=0.0, heading=0.0)
        self.jump: PoseJump | None = None
        """The newest jump; whoever has reacted to it sets it to `None`."""
        self.fault = ""
        """Error that has ended the thread which brings the samples."""
        self.unguarded = ""
        """Reason why no process stops the robot if this program ends; empty if one does."""
        self.inactive = ""
        """Reason why the life cycle of the node lets it drive nothing; empty while the node is active."""
        self.clock_offset_s: float | None = None
        """Seconds by which the odometry's stamps are behind this computer's time."""
        self.charge: float | None = None
        self.emergency_stop: bool | None = None
        self.sigma_m: float | None = None
        """Standard deviation of the position."""

    def say_unguarded(self, why: str) -> None:
        """Take the reason why no process stops the robot; empty if one does."""
        self.unguarded = why

    def say_inactive(self, why: str) -> None:
        """Take the reason why the node's life cycle lets it drive nothing; empty if it may."""
        self.inactive = why

    def say_fault(self, why: str) -> None:
        """Take the error that has ended the node's thread."""
        self.fault = why

    # From the node's thread

    def take_transform(
        self, parent: str, child: str, transform: Transform, *, stamp_ns: int, static: bool = False
    ) -> None:
        """Take a transform of tf; one with an older stamp, the same one or no number says nothing.

        Neither does one without two frames, as in tf2.
        """
        parent, child, now_ns = parent.lstrip("/"), child.lstrip("/"), self._clock.now_ns()
        is_number = math.isfinite(transform.x + transform.y + transform.heading)
        if not is_number or not parent or not child or parent == child:
            return
        with self._lock:
            old = self._links.get(child)
            if old is not None and old.parent == parent and 0 <= old.stamp_ns - stamp_ns < SET_BACK_NS:
                return  # repeated, or out of order
            before = self._chain()
            self._links[child] = _Link(parent, transform, stamp_ns, now_ns, static)
            if old is not None and old.parent != parent:
                self._jumps.append((f"{child} has the parents {old.parent} and {parent}", now_ns))
            after = self._chain()
            if old is not None and before is not None and after is not None:
                self._note_jump(f"{parent} -> {child}", before, after, (now_ns - old.arrived_ns) / 1e9)

    def take_odometry(self, velocity: float, turn_rate: float, *, stamp_ns: int, behind_s: float) -> None:
        """Take the velocities of an odometry message; `behind_s` is the age of its stamp on arrival.

        Velocities that are no numbers say nothing, as if no message had come.
        """
        if not math.isfinite(velocity + turn_rate):
            return
        with self._lock:
            self.clock_offset_s = behind_s
            if stamp_ns != self._odometry_stamp_ns:
                self._odometry_ns, self._odometry_stamp_ns = self._clock.now_ns(), stamp_ns
                self._velocity = (abs(velocity), abs(turn_rate))

    def take_variances(self, x: float, y: float) -> None:
        """Take the variances of the localisation; one that is no number makes its position unknown."""
        known = math.isfinite(x + y)
        self.sigma_m = math.sqrt(max(0.0, x, y)) if known else math.inf

    def take_command(self, velocity: float, turn_rate: float) -> None:
        """Take a velocity command, whoever has sent it."""
        if max(abs(velocity), abs(turn_rate)) > 0:
            self._commanded_ns = self._clock.now_ns()

    def _note_jump(self, link: str, before: Transform, after: Transform, seconds: float) -> None:
        moved = math.dist((before.x, before.y), (after.x, after.y))
        localised = link.startswith(f"{self._frames.map} -> ")
        if moved <= (SEEN_JUMP_M if localised else max(2 * SEEN_JUMP_M, FASTEST_M_S * seconds)):
            return
        now_ns = self._clock.now_ns()
        what = "localisation" if localised else "odometry"
        if self.jump is None or self.jump.metres < moved:
            self.jump = PoseJump(moved, f"the {what} jumped by {moved:.2f} m ({link})", now_ns)
        self._jumps.append((f"{link} jumps to and fro", now_ns))

    # To any thread

    def pose(self) -> Pose:
        """Return the newest pose of the base in the map; the last known one if tf has lost it."""
        with self._lock:
            found = self._chain()
            if found is not None:
                self._last = Pose(x=found.x, y=found.y, heading=found.heading)
            return self._last

    def speed(self) -> float:
        return self._velocity[0]

    def _chain(self) -> Transform | None:
        """Return the base's pose in the map; `None` if tf does not lead there."""
        at, found = self._frames.base, Transform(x=0.0, y=0.0, heading=0.0)
        for _ in range(DEPTH):
            if at == self._frames.map:
                return found
            link = self._links.get(at)
            if link is None:
                return None
            at, found = link.parent, link.transform.after(found)
        return None

    def still(self) -> bool:
        """Return True if fresh odometry shows a standstill, and nobody commands a velocity."""
        commanded = self._age_s(self._commanded_ns) < COMMAND_S
        stands = self._velocity[0] <= STILL_M_S and self._velocity[1] <= STILL_RAD_S
        return stands and not commanded and not self.silence()

    def silence(self) -> str:
        """Return what does not arrive at present, in words; empty if everything does."""
        if self.fault:
            return f"the ROS 2 node has failed ({self.fault}); restart stopgo robot"
        with self._lock:
            return self._tf_silence() or self._odometry_silence()

    def _tf_silence(self) -> str:
        frames, at = self._frames, self._frames.base
        if self._chain() is None:
            known = ", ".join(sorted({*self._links, *(link.parent for link in self._links.values())}))
            return f"tf has no transform from {frames.map} to {frames.base}; its frames: {known or 'none'}"
        while at != frames.map:
            link = self._links[at]
            age_s = self._age_s(link.arrived_ns)
            if not link.static and age_s > self._limits.tf_age_s:
                return f"tf has no {link.parent} -> {at} for {age_s:.1f} s"
            at = link.parent
        return ""

    def _odometry_silence(self) -> str:
        age_s = self._age_s(self._odometry_ns)
        if math.isinf(age_s):
            return "no odometry has arrived"
        return f"no odometry for {age_s:.1f} s" if age_s > self._limits.odometry_age_s else ""

    def _age_s(self, ns: int | None) -> float:
        return math.inf if ns is None else (self._clock.now_ns() - ns) / 1e9

    def unusable(self) -> str:
        """Return why the robot must not move though everything arrives; empty if it may."""
        if self.inactive or self.unguarded:
            return self.inactive or self.unguarded
        offset_s, limits = self.clock_offset_s, self._limits
        if self.emergency_stop:
            return "the emergency stop is pressed"
        if offset_s is not None and abs(offset_s) > limits.clock_offset_s:
            side = "behind" if offset_s > 0 else "ahead of"
            return (
                f"the odometry's clock is {abs(offset_s):.1f} s {side} this computer's; synchronise the"
                " clocks, or set use_sim_time on both sides"
            )
        if self.sigma_m is not None and self.sigma_m > limits.sigma_m:
            return f"the localisation is uncertain by {self.sigma_m:.2f} m, above {limits.sigma_m:g} m"
        return self.conflict()

    def conflict(self) -> str:
        """Return which transform seems to have two publishers; empty if none does."""
        with self._lock:
            since_ns = self._clock.now_ns() - round(TO_AND_FRO_S * 1e9)
            recent = [words for words, ns in self._jumps if ns >= since_ns]
        often = next((words for words in recent if recent.count(words) >= TO_AND_FRO), "")
        return f"tf: {often}; has it two publishers?" if often else ""

    def health(self) -> BaseHealth:
        sigma = self.sigma_m
        quality = None if sigma is None else max(0.0, 1.0 - sigma / self._limits.sigma_m)
        return BaseHealth(localisation=quality, emergency_stop=self.emergency_stop)
