"""Simulated robot and scanner: they take time, drift, use the battery, and store their state on disk."""

from __future__ import annotations

import contextlib
import hashlib
import math
import os
import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event

import msgspec

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import BaseHealth, Outcome, Rest
from stopgo.bridge.robot.motion import Brake, Motion, along
from stopgo.bridge.robot.simulated_faults import NO_FAULTS, RobotFaults
from stopgo.mission.document import Mission, Point, RobotSpec, Scan
from stopgo.mission.document.decoding import decoded
from stopgo.mission.errors import InputError
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import ScanFailed, ScanResult

SLICE_S = 0.5
"""Interval at which a moving robot's pose is stored; a crash loses at most this much."""
SHAKE_M = 0.005
ENDURANCE_S = 6 * 3600.0
POINTS_PER_S = 360_000
"""Scan rate of a simulated scanner, here and on a simulated vehicle."""
BYTES_PER_POINT = 16


class World(msgspec.Struct, frozen=True, kw_only=True):
    """State that outlives the robot's program: pose and battery."""

    pose: Pose = Pose(x=0.0, y=0.0, heading=0.0)
    battery: float = 1.0
    placed: bool = False
    """True if the pose was set, or the robot has driven."""


@dataclass(frozen=True)
class Wear:
    """Pose errors and battery consumption of a simulated robot."""

    noise_m: float = 0.004
    """Standard deviation of the position it reaches, each axis; errors are limited to twice this."""
    noise_rad: float = 0.002
    battery_per_s: float = 1.0 / ENDURANCE_S
    """While it drives; 0 for a battery that does not run down."""


class SimulatedBase:
    """A differential drive on an empty floor."""

    def __init__(
        self,
        *,
        clock: Clock,
        keep: Path | None = None,
        wear: Wear = Wear(),
        faults: RobotFaults = NO_FAULTS,
        seed: int = 1,
    ) -> None:
        self._clock = clock
        self._faults = faults
        self._drives = 0
        self._shakes_until_ns = 0
        self._keep = keep
        self._wear = wear
        self._chance = random.Random(seed)
        self._world = read_world(keep)
        self._deceleration = 1.0
        self._driven = (Motion(self._world.pose), clock.now_ns())
        """The present motion and its start: one value, for a stop comes from another thread."""

    def pose(self) -> Pose:
        return self._now()[0]

    def speed(self) -> float:
        return self._now()[1]

    def battery(self) -> float:
        return self._world.battery

    def health(self) -> BaseHealth:
        return BaseHealth(localisation=1.0, emergency_stop=False, safety_field=False)

    def endurance_s(self) -> float | None:
        used = self._wear.battery_per_s
        return 1.0 / used if used > 0 else None

    def rest(self) -> Rest:
        return Rest()

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        self._drives += 1
        self._deceleration = limits.acceleration
        path, heading = self._with_errors(path, heading)
        motion = along(
            self.pose(), path, heading,
            speed=limits.speed, turn_rate=limits.turn_rate, acceleration=limits.acceleration,
        )  # fmt: skip
        if self._faults.due("blocked", self._drives):
            self._follow(motion, interrupt, fraction=0.5)
            self._brake()
            return "blocked"
        if not self._follow(motion, interrupt):
            self._brake()
            return "interrupted"
        self._stand(motion.at(motion.duration)[0])
        self._apply_faults()
        return "arrived"

    def stop(self) -> None:
        self._driven = self._braking(), self._clock.now_ns()

    def unfit(self, mission: Mission) -> str:
        return ""

    def not_ready(self) -> str:
        return ""

    def blocked_by(self) -> str:
        return ""

    def stand_at(self, pose: Pose) -> None:
        """Put the robot there by hand."""
        self._stand(pose)

    def charge(self) -> None:
        """Fill the battery."""
        self._world = msgspec.structs.replace(self._world, battery=1.0)

    def stand_at_start(self, start: Pose) -> None:
        """Put the robot at a mission's start, if its pose was never set."""
        if not self._world.placed:
            self._stand(start)

    def _with_errors(
        self, path: Sequence[Point], heading: float | None
    ) -> tuple[Sequence[Point], float | None]:
        """Return path and heading with the errors that will be driven."""
        if not path:
            return path, heading
        x, y = path[-1]
        slip = self._faults.due("slip", self._drives)
        if slip:
            before = path[-2] if len(path) > 1 else (self.pose().x, self.pose().y)
            left = math.atan2(y - before[1], x - before[0]) + math.pi / 2
            x, y = x + slip.amount * math.cos(left), y + slip.amount * math.sin(left)
        reached = (x + self._error(self._wear.noise_m), y + self._error(self._wear.noise_m))
        turned = None if heading is None else heading + self._error(self._wear.noise_rad)
        return (*path[:-1], reached), turned

    def _error(self, deviation: float) -> float:
        return max(-2 * deviation, min(2 * deviation, self._chance.gauss(0.0, deviation)))

    def _follow(self, motion: Motion, interrupt: Event, *, fraction: float = 1.0) -> bool:
        """Carry out the motion, or its first fraction; false if it was interrupted."""
        began_ns = self._clock.now_ns()
        self._driven = motion, began_ns
        end_ns = began_ns + round(motion.duration * fraction * 1e9)
        while (left := (end_ns - self._clock.now_ns()) / 1e9) > 0:
            if self._clock.wait(min(left, SLICE_S), interrupt):
                return False
            self._remember(self._now()[0], self._wear.battery_per_s * SLICE_S)
        return True

    def _braking(self) -> Motion:
        pose, speed = self._now()
        return Motion(pose, (Brake(pose, speed, self._deceleration),))

    def _brake(self) -> None:
        braking = self._braking()
        self._follow(braking, Event())
        self._stand(braking.at(braking.duration)[0])

    def _apply_faults(self) -> None:
        """Apply the faults that follow an arrival."""
        drain, shaking = self._faults.due("drain", self._drives), self._faults.due("shaking", self._drives)
        if drain:
            self._world = msgspec.structs.replace(self._world, battery=drain.amount)
        if shaking:
            self._shakes_until_ns = self._clock.now_ns() + round(shaking.amount * 1e9)

    def _stand(self, pose: Pose) -> None:
        self._driven = Motion(pose), self._clock.now_ns()
        self._remember(pose, 0.0)

    def _now(self) -> tuple[Pose, float]:
        (motion, began_ns), now_ns = self._driven, self._clock.now_ns()
        pose, speed = motion.at((now_ns - began_ns) / 1e9)
        if now_ns < self._shakes_until_ns:
            pose = msgspec.structs.replace(pose, x=pose.x + SHAKE_M * math.sin(now_ns / 1e8))
        return pose, speed

    def _remember(self, pose: Pose, used: float) -> None:
        battery = max(0.0, self._world.battery - used)
        self._world = World(pose=pose, battery=battery, placed=True)
        if self._keep is not None:
            with contextlib.suppress(OSError):  # a full disk must not end the simulation
                write_world(self._keep, self._world)


class SimulatedScanner:
    """Scans take time, and their files do not exist; each begin and end is a line in the file `record`."""

    profiles: tuple[str, ...] | None = None

    def __init__(self, *, clock: Clock, record: Path | None = None, faults: RobotFaults = NO_FAULTS) -> None:
        self._clock = clock
        self._record = record
        self._faults = faults
        self._scans = 0
        self._ended: dict[str, ScanResult] = _remembered(record)

    def scan(self, label: str, scan: Scan, *, interrupt: Event) -> ScanResult | ScanFailed:
        try:
            return self._scan(label, scan, interrupt)
        except OSError as error:
            return ScanFailed(reason=f"the scan cannot be written: {error.strerror}")

    def _scan(self, label: str, scan: Scan, interrupt: Event) -> ScanResult | ScanFailed:
        self._scans += 1
        self._note(f"begin {label}")
        if self._clock.wait(min(scan.duration_s, scan.timeout_s), interrupt):
            return ScanFailed(reason="interrupted")
        if scan.duration_s > scan.timeout_s:
            return ScanFailed(reason=f"no result within {scan.timeout_s:g} s")
        if self._faults.due("scanner", self._scans):
            return ScanFailed(reason="the scanner reported an error")
        self._note(f"end {label}")
        empty = self._faults.due("empty", self._scans)
        points = 0 if empty else round(POINTS_PER_S * max(scan.duration_s, 0.1))
        digest = hashlib.sha256(label.encode()).hexdigest()
        result = ScanResult(file=f"{label}.e57", size=points * BYTES_PER_POINT, sha256=digest, points=points)
        self._remember_scan(label, result)
        return result

    def scan_outcome(self, label: str) -> ScanResult | ScanFailed | None:
        """Return the outcome from the scanner's own memory; a scan that is not in it was interrupted."""
        return self._ended.get(label, ScanFailed(reason="cut off"))

    def _remember_scan(self, label: str, result: ScanResult) -> None:
        self._ended[label] = result
        if self._record is not None:
            with _memory(self._record).open("ab") as memory:
                memory.write(msgspec.json.encode((label, result)) + b"\n")

    def _note(self, line: str) -> None:
        if self._record is not None:
            with self._record.open("a", encoding="utf-8") as record:
                record.write(line + "\n")


def _memory(record: Path) -> Path:
    return record.with_suffix(".ended")


def _remembered(record: Path | None) -> dict[str, ScanResult]:
    """Read the scans that ended in an earlier process; an incomplete last line is ignored."""
    if record is None or not _memory(record).exists():
        return {}
    found: dict[str, ScanResult] = {}
    for line in _memory(record).read_bytes().splitlines():
        with contextlib.suppress(msgspec.DecodeError):
            label, result = decoded(line, tuple[str, ScanResult])
            found[label] = result
    return found


def read_world(keep: Path | None) -> World:
    if keep is None or not keep.exists():
        return World()
    try:
        return decoded(keep.read_bytes(), World)
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(
            f"{keep}: no pose of the simulated robot ({error}); remove it to start at the mission's start"
        ) from None


def write_world(keep: Path, world: World) -> None:
    """Replace the file in one step, so that a crash leaves the old or the new."""
    new = keep.with_suffix(".new")
    with new.open("wb") as file:
        file.write(msgspec.json.encode(world))
        file.flush()
        os.fsync(file.fileno())
    os.replace(new, keep)
