"""Motion of the simulated wheels by throttle and steering: a differential drive with lag."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose

COASTS_M_S = 0.01
"""Speed below which wheels that stick do not move."""


class Chassis:
    """True pose and speed; x to the east, y to the north.

    The model of ArduPilot's simulator (SIM_Rover, skid steering), with a lag of the turn and wheels that
    stick: the speed tends to throttle times the top speed, the turn rate to steering times the top rate.
    """

    def __init__(self, pose: Pose, tuning: Tuning) -> None:
        self._tuning = tuning
        self.x, self.y, self.heading = pose.x, pose.y, pose.heading
        self.speed = self.turning = 0.0
        """Metres and radians per second; the latter counter-clockwise."""
        self.wall: tuple[Point, Point] | None = None
        """A straight that it cannot cross."""

    @property
    def pose(self) -> Pose:
        return Pose(x=self.x, y=self.y, heading=self.heading)

    def move(self, throttle: float, steering: float, dt: float) -> None:
        """Move for a moment; both inputs within ±1, steering to the left positive."""
        tuning = self._tuning
        throttle, steering = max(-1.0, min(1.0, throttle)), max(-1.0, min(1.0, steering))
        if abs(self.speed) < COASTS_M_S and abs(throttle) < tuning["SIM_STICTION"]:
            throttle, self.speed = 0.0, 0.0
        self.speed += (throttle * tuning["SIM_TOP_SPEED"] - self.speed) * _response(dt, tuning["SIM_LAG"])
        top = math.radians(tuning["SIM_TURN_TOP"])
        self.turning += (steering * top - self.turning) * _response(dt, tuning["SIM_TURN_LAG"])
        if not tuning.pivots:
            most = abs(self.speed) / tuning["SIM_TURN_RADIUS"]
            self.turning = max(-most, min(most, self.turning))
        self.heading = math.remainder(self.heading + self.turning * dt, math.tau)
        x = self.x + self.speed * dt * math.cos(self.heading)
        y = self.y + self.speed * dt * math.sin(self.heading)
        if self.wall is not None and _crosses(self.wall, (self.x, self.y), (x, y)):
            self.speed = 0.0
        else:
            self.x, self.y = x, y


def _response(dt: float, lag_s: float) -> float:
    """Fraction of a change that happens within `dt`."""
    return 1.0 if lag_s <= 0 else 1.0 - math.exp(-dt / lag_s)


def _crosses(wall: tuple[Point, Point], before: Point, after: Point) -> bool:
    (ax, ay), (bx, by) = wall

    def side(p: Point) -> bool:
        return (bx - ax) * (p[1] - ay) - (by - ay) * (p[0] - ax) > 0

    return side(before) != side(after)
