"""Drives a mission on paper, and knows the truth of it: where the robot stopped, when, and at which stop."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Mission, Point
from stopgo.mission.run.run_log import Track
from tests.mission.worlds import mission_of, stop

HZ = 10
BEGIN_NS = 1_700_000_000 * 10**9


@dataclass(frozen=True)
class Halt:
    """The truth of one standstill: the stop's index (None: at no stop), when, and where."""

    stop: int | None
    begin_s: float
    end_s: float
    x: float
    y: float


@dataclass
class Drive:
    """A drive as it grows: rows of seconds, x, y, heading."""

    x: float
    y: float
    heading: float
    seconds: float = 0.0
    rows: list[tuple[float, float, float, float]] = field(default_factory=list)
    halts: list[Halt] = field(default_factory=list)

    def stay(self, seconds: float, stop: int | None = None) -> None:
        begin = self.seconds
        for _ in range(round(seconds * HZ)):
            self._step(self.x, self.y, self.heading)
        self.halts.append(Halt(stop, begin, self.seconds, self.x, self.y))

    def go(self, to: Point, *, speed: float, turn_rate: float) -> None:
        length = math.dist((self.x, self.y), to)
        if length < 1e-9:
            return
        self.turn(math.atan2(to[1] - self.y, to[0] - self.x), turn_rate=turn_rate)
        a, count = (self.x, self.y), max(1, math.ceil(length / speed * HZ))
        for k in range(1, count + 1):
            self._step(a[0] + (to[0] - a[0]) * k / count, a[1] + (to[1] - a[1]) * k / count, self.heading)

    def turn(self, heading: float, *, turn_rate: float) -> None:
        by, before = math.remainder(heading - self.heading, math.tau), self.heading
        count = math.ceil(abs(by) / turn_rate * HZ)
        for k in range(1, count + 1):
            self._step(self.x, self.y, before + by * k / count)

    def _step(self, x: float, y: float, heading: float) -> None:
        self.seconds += 1 / HZ
        self.x, self.y, self.heading = x, y, heading
        self.rows.append((self.seconds, x, y, heading))


@dataclass(frozen=True)
class Odd:
    """Deviations from the plan: indices of stops, and the robot's position error (m, 1 sigma)."""

    skipped: frozenset[int] = frozenset()
    repeated: frozenset[int] = frozenset()
    extra_before: frozenset[int] = frozenset()
    beside_m: float = 0.0


def driven(mission: Mission, odd: Odd = Odd(), seed: int = 1) -> Drive:
    """The whole mission, leg by leg; at an extra standstill the robot waits in the middle of a leg."""
    rng, robot = np.random.default_rng(seed), mission.robot
    drive = Drive(mission.start.x, mission.start.y, mission.start.heading)
    drive.rows.append((0.0, drive.x, drive.y, drive.heading))
    pace = {"speed": robot.speed, "turn_rate": robot.turn_rate}
    for k, item in enumerate(mission.stops):
        pieces = list(pairwise(item.approach))
        longest = max(range(len(pieces)), key=lambda n: math.dist(*pieces[n]), default=0)
        for n, (a, b) in enumerate(pieces):
            if k in odd.extra_before and n == longest:
                drive.go(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2), **pace)
                drive.stay(float(rng.uniform(4, 20)))
            last = b == item.approach[-1] and k not in odd.skipped
            off = rng.normal(0, odd.beside_m, 2) if last else np.zeros(2)
            drive.go((b[0] + float(off[0]), b[1] + float(off[1])), **pace)
        for attempt in range(0 if k in odd.skipped else 2 if k in odd.repeated else 1):
            if attempt:
                drive.go((item.x + 0.5, item.y + 0.5), **pace)
                drive.go((item.x, item.y), **pace)
            drive.turn(item.heading, turn_rate=robot.turn_rate)
            drive.stay(item.settle_s + item.scan.duration_s, k)
    return drive


@dataclass(frozen=True)
class Senses:
    """Log of a drive."""

    noise_m: float = 0.0
    noise_rad: float = 0.0
    slip: float = 0.0
    """Share by which odometry errs in distance, and radians per metre by which it turns away."""
    dropped: float = 0.0
    """Share of messages that are lost."""
    clock_offset_s: float = 0.0
    clock_drift: float = 0.0
    turned: float = 0.0
    shifted: Point = (0.0, 0.0)


def logged(drive: Drive, senses: Senses = Senses(), seed: int = 1) -> Track:
    """The drive as a robot's log reports it, in the robot's own frame."""
    rng = np.random.default_rng(seed + 10_000)
    rows = np.array(drive.rows)
    xy, heading = _slipped(rows[:, 1:3], rows[:, 3], senses.slip)
    cos, sin = math.cos(senses.turned), math.sin(senses.turned)
    xy = xy @ np.array([[cos, sin], [-sin, cos]]) + senses.shifted
    xy = xy + rng.normal(0, senses.noise_m, xy.shape)
    heading = heading + senses.turned + rng.normal(0, senses.noise_rad, len(heading))
    seconds = rows[:, 0] * (1 + senses.clock_drift) + senses.clock_offset_s
    kept = rng.random(len(rows)) >= senses.dropped
    return Track.of(BEGIN_NS + np.rint(seconds[kept] * 1e9).astype(np.int64), xy[kept], heading[kept])


def _slipped(xy: np.ndarray, heading: np.ndarray, slip: float) -> tuple[np.ndarray, np.ndarray]:
    """Wheels that slip make the way longer and bend it."""
    step = np.diff(xy, axis=0)
    turn = slip * 0.1 * np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    cos, sin = np.cos(turn[1:]), np.sin(turn[1:])
    bent = (1 + slip) * np.stack(
        [cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], axis=-1
    )
    return np.concatenate([xy[:1], xy[:1] + np.cumsum(bent, axis=0)]), heading + turn


def wandering(seed: int, *, stops: int = 9, scan_s: float = 12.0) -> Mission:
    """A mission through a building that nobody has drawn: legs of 3 to 9 m with a corner in each."""
    rng = np.random.default_rng(seed)
    at = np.zeros(2)
    made, known = [], [at]
    for number in range(stops):
        for _ in range(1000):
            to = at + rng.uniform(-7, 7, 2)
            if 3 <= math.dist(to, at) <= 9 and min(math.dist(to, place) for place in known) >= 2.5:
                break
        corner = (float(to[0]), float(at[1]))
        heading = float(rng.uniform(-math.pi, math.pi))
        name = f"s{number + 1:02}"
        made.append(
            stop(name, (float(at[0]), float(at[1])), corner, (float(to[0]), float(to[1])), heading=heading)
        )
        at = to
        known.append(to)
    from msgspec.structs import replace

    from stopgo.mission.document import with_digest

    mission = mission_of(*made)
    scan = replace(mission.stops[0].scan, duration_s=scan_s)
    changed = tuple(replace(item, scan=scan, settle_s=2.0) for item in mission.stops)
    return with_digest(replace(mission, stops=changed))
