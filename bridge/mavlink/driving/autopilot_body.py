"""An autopilot as the base and scanner that a robot's controller drives."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.mavlink_base import MavlinkBase
from stopgo.bridge.mavlink.driving.mavlink_scanner import MavlinkScanner, ScanTrigger, check_trigger
from stopgo.bridge.mavlink.driving.onboard_autopilot import on_board
from stopgo.bridge.mavlink.vehicle_link.wire import read_link
from stopgo.bridge.robot.controller import Controller
from stopgo.bridge.robot.robot_hardware import Body
from stopgo.mission.document import Mission


@dataclass(frozen=True)
class AutopilotBody:
    """A rover whose autopilot is on the robot's own link."""

    url: str
    arm: bool = False
    trigger: ScanTrigger = "camera"
    signing_key: Path | None = None
    vehicle: int | None = None
    """Its system id, if several vehicles are found."""
    insecure: bool = False
    patience_s: float = 30.0
    """Longest wait for the vehicle, and for its position."""
    set_origin: bool = False
    """The mission's origin may be given to an autopilot that has none."""
    set_timeout: bool = False
    """The time that it drives on without us may be set."""
    guards: bool = False
    """A process of its own stops the vehicle if this program ends or hangs while it drives."""

    @contextmanager
    def __call__(self, clock: Clock) -> Iterator[Body]:
        url, key = read_link(self.url, self.signing_key, insecure=self.insecure, option="--controller")
        with on_board(
            url,
            signing_key=key,
            vehicle=self.vehicle,
            timeout_s=self.patience_s,
            sets_timeout=self.set_timeout,
        ) as autopilot:
            check_trigger(autopilot, self.trigger)
            autopilot.origin_keeper.consents = self.set_origin
            base = MavlinkBase(autopilot, clock=clock, arm=self.arm)
            scanner = MavlinkScanner(autopilot, clock=clock, trigger=self.trigger)

            def take(mission: Mission) -> None:
                base.take(mission)
                scanner.take(mission)

            def attach(controller: Controller) -> None:
                scanner.pause = lambda why: controller.pause_scanning(why) and base.take_hold(why)

            with autopilot.guarded() if self.guards else nullcontext():
                yield Body(base, scanner, take, attach)
