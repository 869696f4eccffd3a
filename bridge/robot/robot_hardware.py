"""The hardware of a robot, real or simulated: a base and a scanner."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.robot.base import Base, Scanner
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.map_frame import OnMap, turned
from stopgo.bridge.robot.simulated_faults import NO_FAULTS, RobotFaults
from stopgo.bridge.robot.simulator import (
    ENDURANCE_S,
    SimulatedBase,
    SimulatedScanner,
    Wear,
)
from stopgo.mission.document import Mission, Start
from stopgo.mission.frames.transform import Transform
from stopgo.mission.run.events import Pose


@dataclass(frozen=True)
class Body:
    """A base and a scanner; `take` gives them the mission that will be run, `attach` the run itself."""

    base: Base
    scanner: Scanner
    take: Callable[[Mission], None]
    attach: Callable[[Controller], None] = lambda controller: None


OpenBody = Callable[[Clock], AbstractContextManager[Body]]
"""Opens the hardware for as long as the robot's program runs, on the run's clock."""


@dataclass(frozen=True)
class SimulatedBody:
    """A simulated robot."""

    state: Path
    at: Pose | None = None
    """Pose on its map; if not given, its last pose, or its first mission's start."""
    to_map: Transform | None = None
    endurance_s: float = ENDURANCE_S
    """Seconds that a full battery lasts; 0: it never runs down."""
    faults: RobotFaults = NO_FAULTS

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
