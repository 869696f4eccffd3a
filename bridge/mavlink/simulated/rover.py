"""Where the rover stands and how it moves, in metres; and the place on the earth that this is."""

from __future__ import annotations

import math

from bridge.mavlink.simulated.vehicle_store import Store
from bridge.robot.motion import Brake, Motion, along
from mission.document import Point, RobotSpec, SiteOrigin
from mission.events import Pose
from mission.geodesy import STEPS_PER_DEGREE, from_geodetic, from_steps, to_geodetic

LIMITS = RobotSpec(radius=0.35, speed=0.5, turn_rate=1.0, acceleration=0.5)
FAR_M = 100_000.0
"""Beyond this from the origin it does not set out."""
SLOWEST, FASTEST = 0.05, 5.0
STEPS_PER_M = 90
"""Steps of 1e-7 degrees of latitude in a metre, rounded up."""


class Rover:
    """A differential drive on an empty floor, x to the east and y to the north of the global origin.

    Times are nanoseconds of the vehicle's clock and are told by the caller, so that one motion begins where
    another ended, however seldom anybody looks.
    """

    def __init__(self, store: Store, *, rule: str, origin: SiteOrigin | None, at: Pose | None) -> None:
        self._store = store
        self._rule = rule
        self.origin = origin
        self.speed = LIMITS.speed
        self._motion = Motion(at or store.kept.pose or Pose(x=0.0, y=0.0, heading=math.pi / 2))
        self._began_ns = 0

    def at(self, now_ns: int) -> tuple[Pose, float]:
        """Pose and speed."""
        return self._motion.at((now_ns - self._began_ns) / 1e9)

    def drive(self, to: Point, now_ns: int, *, heading: float | None = None, to_spare: float = 0.0) -> int:
        """Set out for a point; when it will be there.

        `to_spare` metres before the point the drive ends.
        """
        start = self.at(now_ns)[0]
        away = math.hypot(to[0] - start.x, to[1] - start.y)
        share = max(0.0, 1.0 - to_spare / away) if away > 0 else 0.0
        end = (start.x + (to[0] - start.x) * share, start.y + (to[1] - start.y) * share)
        self._motion = along(
            start, [end], heading,
            speed=self.speed, turn_rate=LIMITS.turn_rate, acceleration=LIMITS.acceleration,
        )  # fmt: skip
        self._began_ns = now_ns
        return now_ns + round(self._motion.duration * 1e9)

    def brake(self, now_ns: int) -> None:
        pose, speed = self.at(now_ns)
        self._motion = Motion(pose, (Brake(pose, speed, LIMITS.acceleration),) if speed > 0 else ())
        self._began_ns = now_ns

    def keep(self, now_ns: int) -> None:
        """Write down where it stands, if it has moved."""
        pose = self.at(now_ns)[0]
        if pose != self._store.kept.pose:
            self._store.keep(pose=pose)

    def set_speed(self, speed: float) -> bool:
        """Metres per second from the next drive on; false if that is none."""
        if not SLOWEST <= speed <= FASTEST:
            return False
        self.speed = speed
        return True

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
    angle = -math.radians(heading_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    return Pose(
        x=cos * pose.x - sin * pose.y,
        y=sin * pose.x + cos * pose.y,
        heading=math.remainder(pose.heading + angle, math.tau),
    )


def bearing(heading: float) -> float:
    """Radians clockwise from north within ±π, of radians counter-clockwise from east."""
    return math.remainder(math.pi / 2 - heading, math.tau)
