"""What a robot's controller drives: a base, a scanner, and what both must be told of the mission."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Base, Scanner
from stopgo.bridge.robot.map_frame import OnMap, turned
from stopgo.bridge.robot.simulator import (
    ENDURANCE_S,
    NO_FAULTS,
    Faults,
    SimulatedBase,
    SimulatedScanner,
    Wear,
)
from stopgo.mission.document import Mission, Start
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose


@dataclass(frozen=True)
class Body:
    """A base and a scanner, and what they must be told of the mission that is to be run."""

    base: Base
    scanner: Scanner
    take: Callable[[Mission], None]


OpenBody = Callable[[Clock], AbstractContextManager[Body]]
"""Gives the body while the robot's program runs, on the run's clock."""


@dataclass(frozen=True)
class SimulatedBody:
    """A robot that exists only as numbers."""

    state: Path
    at: Pose | None = None
    """Where it stands on its map; else where it last stood, or its first mission's start."""
    to_map: Transform | None = None
    endurance_s: float = ENDURANCE_S
    """How long a full battery lasts; 0: it does not run down."""
    faults: Faults = NO_FAULTS

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        wear = Wear(battery_per_s=1.0 / self.endurance_s if self.endurance_s else 0.0)
        simulated = SimulatedBase(clock=clock, keep=self.state / "world.json", faults=self.faults, wear=wear)
        base = OnMap(simulated, self.to_map)
        if self.at is not None:
            simulated.stand_at(self.at)

        def take(mission: Mission) -> None:
            base.take(mission)
            simulated.stand_at_start(turned(pose_of(mission.start), base.to_map))

        record = self.state / "scans.log"
        yield Body(base, SimulatedScanner(clock=clock, record=record, faults=self.faults), take)


def pose_of(start: Start) -> Pose:
    return Pose(x=start.x, y=start.y, heading=start.heading)
