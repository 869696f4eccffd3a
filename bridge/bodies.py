"""What a robot's controller drives: a simulated base and scanner, or an autopilot's, by `--controller`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bridge.clock import Clock
from bridge.frames import OnMap, turned
from bridge.robots import Base, Scanner
from bridge.simulator import ENDURANCE_S, NO_FAULTS, Faults, SimulatedBase, SimulatedScanner, Wear
from mission.document import Mission, Start, Transform
from mission.errors import InputError
from mission.events import Pose

if TYPE_CHECKING:
    from bridge.mavlink.gateway.scanner import Trigger

MAVLINK = "mavlink:"


@dataclass(frozen=True)
class Body:
    """A base and a scanner, and what they must be told of the mission that is to be run."""

    base: Base
    scanner: Scanner
    take: Callable[[Mission], None]


Incarnate = Callable[[Clock], AbstractContextManager[Body]]
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


@dataclass(frozen=True)
class AutopilotBody:
    """A rover whose autopilot is on the robot's own wire."""

    url: str
    arm: bool = False
    trigger: Trigger = "camera"
    signing_key: Path | None = None
    vehicle: int | None = None
    """Its system id, if several are heard."""
    insecure: bool = False
    patience_s: float = 30.0
    """How long to wait for it, and for its position."""

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        from bridge.mavlink.gateway.autopilot import on_board
        from bridge.mavlink.gateway.base import MavlinkBase
        from bridge.mavlink.gateway.scanner import MavlinkScanner
        from bridge.mavlink.line.wire import read_line

        url, key = read_line(self.url, self.signing_key, insecure=self.insecure, option="--controller")
        with on_board(url, signing_key=key, vehicle=self.vehicle, timeout_s=self.patience_s) as autopilot:
            base = MavlinkBase(autopilot, clock=clock, arm=self.arm)
            scanner = MavlinkScanner(autopilot, clock=clock, trigger=self.trigger)

            def take(mission: Mission) -> None:
                base.take(mission)
                scanner.take(mission)

            yield Body(base, scanner, take)


def autopilot_url(controller: str) -> str | None:
    """The URL in `mavlink:URL`; `None` for `sim`.

    Raises
    ------
    InputError
        If it is neither.
    """
    if controller == "sim":
        return None
    if not controller.startswith(MAVLINK):
        raise InputError(
            f"--controller {controller}: sim, or mavlink: and a URL, as mavlink:udpin:127.0.0.1:14550"
        )
    return controller.removeprefix(MAVLINK)


def pose_of(start: Start) -> Pose:
    return Pose(x=start.x, y=start.y, heading=start.heading)
