"""A robot and a scanner that exist only as numbers, but keep time, drift, and what they did on disk."""

from __future__ import annotations

import hashlib
import os
import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import msgspec

from bridge.clock import Clock
from bridge.motion import Brake, Motion, along
from bridge.robots import Outcome, ScanFailed, ScanResult
from mission.document import Point, RobotSpec, Scan, Start
from mission.events import Pose

SLICE_S = 0.5
"""How often a moving robot's place is written down: what a crash can cost."""
POINTS_PER_S = 360_000
BYTES_PER_POINT = 16


class World(msgspec.Struct, frozen=True, kw_only=True):
    """What stays as it is when the robot's program dies: where it stands, and its battery."""

    pose: Pose = Pose(x=0.0, y=0.0, heading=0.0)
    battery: float = 1.0
    placed: bool = False
    """Whether somebody said where it stands, or it has driven."""


@dataclass(frozen=True)
class Wear:
    """What the simulated robot gets wrong and uses up."""

    noise_m: float = 0.004
    """Standard deviation of where it ends up, each axis; never more than two of them."""
    noise_rad: float = 0.002
    battery_per_s: float = 1.0 / (6 * 3600)


class SimulatedBase:
    """A differential drive on an empty floor."""

    def __init__(self, *, clock: Clock, keep: Path | None = None, wear: Wear = Wear(), seed: int = 1) -> None:
        self._clock = clock
        self._keep = keep
        self._wear = wear
        self._chance = random.Random(seed)
        self._world = read_world(keep)
        self._began_ns = clock.now_ns()
        self._motion = Motion(self._world.pose)

    def pose(self) -> Pose:
        return self._now()[0]

    def speed(self) -> float:
        return self._now()[1]

    def battery(self) -> float:
        return self._world.battery

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        start, _ = self._now()
        path, heading = self._missed(path, heading)
        motion = along(
            start, path, heading,
            speed=limits.speed, turn_rate=limits.turn_rate, acceleration=limits.acceleration,
        )  # fmt: skip
        if self._follow(motion, interrupt):
            return "arrived"
        pose, speed = self._now()
        self._follow(Motion(pose, (Brake(pose, speed, limits.acceleration),)), Event())
        return "interrupted"

    def stop(self) -> None:
        self._stand(self.pose())

    def stand_at(self, pose: Pose) -> None:
        """Put the robot there by hand."""
        self._stand(pose)

    def stand_at_start(self, start: Start) -> None:
        """Put the robot at a mission's start, if nobody ever said where it stands."""
        if not self._world.placed:
            self._stand(Pose(x=start.x, y=start.y, heading=start.heading))

    def _missed(self, path: Sequence[Point], heading: float | None) -> tuple[Sequence[Point], float | None]:
        """Path and heading as they will be driven, a little beside what was asked."""
        if not path:
            return path, heading
        x, y = path[-1]
        beside = (x + self._error(self._wear.noise_m), y + self._error(self._wear.noise_m))
        turned = None if heading is None else heading + self._error(self._wear.noise_rad)
        return (*path[:-1], beside), turned

    def _error(self, deviation: float) -> float:
        return max(-2 * deviation, min(2 * deviation, self._chance.gauss(0.0, deviation)))

    def _follow(self, motion: Motion, interrupt: Event) -> bool:
        """Let the motion take its time; false if it was interrupted."""
        self._motion, self._began_ns = motion, self._clock.now_ns()
        left = motion.duration
        while left > 0:
            if self._clock.wait(min(left, SLICE_S), interrupt):
                return False
            self._remember(self._now()[0], self._wear.battery_per_s * SLICE_S)
            left = motion.duration - (self._clock.now_ns() - self._began_ns) / 1e9
        self._stand(motion.at(motion.duration)[0])
        return True

    def _stand(self, pose: Pose) -> None:
        self._motion, self._began_ns = Motion(pose), self._clock.now_ns()
        self._remember(pose, 0.0)

    def _now(self) -> tuple[Pose, float]:
        motion = self._motion
        return motion.at((self._clock.now_ns() - self._began_ns) / 1e9)

    def _remember(self, pose: Pose, used: float) -> None:
        battery = max(0.0, self._world.battery - used)
        self._world = World(pose=pose, battery=battery, placed=True)
        if self._keep is not None:
            write_world(self._keep, self._world)


class SimulatedScanner:
    """Takes its time and answers with a file that was never written; `record` counts what it did."""

    profiles: tuple[str, ...] | None = None

    def __init__(self, *, clock: Clock, record: Path | None = None) -> None:
        self._clock = clock
        self._record = record

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        self._note(f"begin {label}")
        if self._clock.wait(min(scan.duration_s, scan.timeout_s), interrupt):
            return ScanFailed(reason="interrupted")
        if scan.duration_s > scan.timeout_s:
            return ScanFailed(reason=f"no result within {scan.timeout_s:g} s")
        self._note(f"end {label}")
        points = round(POINTS_PER_S * max(scan.duration_s, 0.1))
        digest = hashlib.sha256(label.encode()).hexdigest()
        return ScanResult(file=f"{label}.e57", size=points * BYTES_PER_POINT, sha256=digest, points=points)

    def _note(self, line: str) -> None:
        if self._record is not None:
            with self._record.open("a", encoding="utf-8") as record:
                record.write(line + "\n")


def read_world(keep: Path | None) -> World:
    if keep is None or not keep.exists():
        return World()
    return msgspec.json.decode(keep.read_bytes(), type=World)


def write_world(keep: Path, world: World) -> None:
    """Replace the file in one step, so that a crash leaves the old or the new."""
    beside = keep.with_suffix(".new")
    beside.write_bytes(msgspec.json.encode(world))
    os.replace(beside, keep)
