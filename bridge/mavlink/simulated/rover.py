"""The simulated rover's pose and motion in metres, and its position on the earth."""

from __future__ import annotations

import math

from stopgo.bridge.mavlink.simulated.estimator import Estimate
from stopgo.bridge.mavlink.simulated.exact_drive import ExactDrive
from stopgo.bridge.mavlink.simulated.real_drive import RealDrive
from stopgo.bridge.mavlink.simulated.steering import Course
from stopgo.bridge.mavlink.simulated.vehicle_store import Store
from stopgo.bridge.robot.map_frame import turned
from stopgo.mission.document import Point
from stopgo.mission.frames.geodesy import STEPS_PER_DEGREE, from_geodetic, from_steps, to_geodetic
from stopgo.mission.frames.transform import SiteOrigin, Transform
from stopgo.mission.run.events import Pose

STANDING = Pose(x=0.0, y=0.0, heading=math.pi / 2)
"""Pose of a vehicle that was never driven: at the origin, to the north."""
FAR_M = 100_000.0
"""Largest distance from the origin to which it sets out."""
SLOWEST, FASTEST = 0.05, 5.0
STEPS_PER_M = 90
"""Steps of 1e-7 degrees of latitude in a metre, rounded up."""


class Rover:
    """A differential drive on an empty floor, x to the east and y to the north of the global origin.

    Times are nanoseconds of the vehicle's clock, given by the caller. So one motion begins where another
    ended, however seldom the pose is read.
    """

    def __init__(
        self, store: Store, drive: ExactDrive | RealDrive, *, rule: str, origin: SiteOrigin | None
    ) -> None:
        self._store, self._rule = store, rule
        self.motion = drive
        self.origin = origin

    def at(self, now_ns: int) -> tuple[Pose, float]:
        """True pose and speed."""
        return self.motion.at(now_ns)

    def estimate(self, now_ns: int) -> Estimate:
        """Pose and speed as the autopilot estimates them."""
        return self.motion.estimate(now_ns)

    def drive(
        self,
        to: Point,
        now_ns: int,
        *,
        heading: float | None = None,
        to_spare: float = 0.0,
        keeps: bool = False,
    ) -> int:
        """Set out for a point; return when to check the arrival.

        The drive ends `to_spare` metres before the point. With `keeps` the position is held until it brakes.
        """
        return self.motion.set_out(to, now_ns, heading=heading, to_spare=to_spare, keeps=keeps)

    def arrival_ns(self, now_ns: int) -> int | None:
        """Time of the next check; `None` once it has arrived."""
        return self.motion.arrival_ns(now_ns)

    def course(self, course: Course, now_ns: int) -> None:
        """Follow a heading and a speed."""
        self.motion.course(course, now_ns)

    def brake(self, now_ns: int) -> None:
        self.motion.brake(now_ns)

    def save_pose(self, now_ns: int) -> None:
        """Save the pose, if it has changed."""
        pose = self.at(now_ns)[0]
        if pose != self._store.stored.pose:
            self._store.update(pose=pose)

    def set_speed(self, speed: float) -> bool:
        """Set the speed in metres per second from the next drive on; false if it is not allowed."""
        if not SLOWEST <= speed <= FASTEST:
            return False
        self.motion.speed = speed
        return True

    @property
    def speed(self) -> float:
        return self.motion.speed

    @property
    def alt_mm(self) -> int:
        """The origin's altitude above the sea; 0 without one."""
        return 0 if self.origin is None else round(self.origin.alt * 1000)

    def place(self, point: Point) -> tuple[int, int]:
        """Latitude and longitude in steps of 1e-7 degrees; 0, 0 without an origin."""
        if self.origin is None:
            return 0, 0
        place = to_geodetic(self.origin, point, self._rule)
        return round(place.lat * STEPS_PER_DEGREE), round(place.lon * STEPS_PER_DEGREE)

    def point(self, lat: int, lon: int) -> Point | None:
        """Metres east and north of the origin; None without one, or too far away."""
        if self.origin is None or abs(lat - self.origin.lat * STEPS_PER_DEGREE) > STEPS_PER_M * FAR_M:
            return None
        x, y = from_geodetic(self.origin, from_steps(lat, lon), self._rule)
        return (x, y) if math.hypot(x, y) <= FAR_M else None


def to_east(pose: Pose, heading_deg: float) -> Pose:
    """A pose of a site whose +y bears `heading_deg`, with x to the east and y to the north."""
    return turned(pose, Transform(x=0.0, y=0.0, heading=-math.radians(heading_deg)))


def bearing(heading: float) -> float:
    """Radians clockwise from north within ±π, of radians counter-clockwise from east."""
    return math.remainder(math.pi / 2 - heading, math.tau)
