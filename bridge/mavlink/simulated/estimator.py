"""Estimated pose of the simulated vehicle: late and noisy, with drift and occasional jumps."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass
from functools import lru_cache

from stopgo.bridge.mavlink.simulated.chassis import Chassis
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.mission.run.events import Pose

WANDERS_S = 20.0
"""Time for which an estimate's error stays about the same."""


@dataclass(frozen=True)
class Estimate:
    """Pose and motion as the autopilot estimates them."""

    pose: Pose
    speed_x: float = 0.0
    speed_y: float = 0.0
    turning: float = 0.0
    """Radians per second, counter-clockwise."""

    @property
    def ahead(self) -> float:
        """Speed in the direction of the nose."""
        return self.speed_x * math.cos(self.pose.heading) + self.speed_y * math.sin(self.pose.heading)


class Estimator:
    """Errors as of an EKF on external navigation: a slow drift (first-order Gauss-Markov) and white noise.

    The standard deviations are those of a real log's standstills and their means, see
    docs/background/reliability.md.
    """

    def __init__(self, chassis: Chassis, tuning: Tuning, seed: int) -> None:
        self._chassis, self._tuning = chassis, tuning
        self._chance = random.Random(seed)
        self._off = [self._chance.gauss(0.0, 1.0) for _ in range(3)]
        """Drift of x, y and heading, in standard deviations."""
        self._jumped = [0.0, 0.0]
        self.now = Estimate(chassis.pose)
        self.look(0.0)

    def jump(self, metres: float) -> None:
        """Shift the estimate at once; it stays off the truth."""
        angle = self._chance.uniform(-math.pi, math.pi)
        self._jumped[0] += metres * math.cos(angle)
        self._jumped[1] += metres * math.sin(angle)

    def settle(self) -> None:
        """Remove the error of the jumps, at once."""
        self._jumped = [0.0, 0.0]

    def look(self, dt: float) -> None:
        """Estimate the pose a moment later."""
        tuning, chance, body = self._tuning, self._chance, self._chassis
        keep, fresh = _wandering(dt)
        self._off = [keep * off + fresh * chance.gauss(0.0, 1.0) for off in self._off]
        noise, drift, late = tuning["SIM_POS_NOISE"], tuning["SIM_POS_DRIFT"], tuning["SIM_EST_LAG"]
        back, shake = body.speed * late, tuning["SIM_VEL_NOISE"]
        cos, sin = math.cos(body.heading), math.sin(body.heading)
        self.now = Estimate(
            Pose(
                x=body.x - back * cos + self._jumped[0] + drift * self._off[0] + chance.gauss(0.0, noise),
                y=body.y - back * sin + self._jumped[1] + drift * self._off[1] + chance.gauss(0.0, noise),
                heading=body.heading + math.radians(tuning["SIM_YAW_DRIFT"]) * self._off[2],
            ),
            speed_x=body.speed * cos + chance.gauss(0.0, shake),
            speed_y=body.speed * sin + chance.gauss(0.0, shake),
            turning=body.turning + chance.gauss(0.0, shake),
        )


@lru_cache(maxsize=4)
def _wandering(dt: float) -> tuple[float, float]:
    """Parts of the old drift and of a new one, after a moment."""
    keep = math.exp(-dt / WANDERS_S)
    return keep, math.sqrt(1.0 - keep * keep)
