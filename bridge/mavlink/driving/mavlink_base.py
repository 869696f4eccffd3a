"""An autopilot as a robot's base: driven point by point along the mission's legs, and judged by its pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Event

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.engagement import DriveEnded, Engagement
from stopgo.bridge.mavlink.driving.mission_frame import MissionFrame
from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot
from stopgo.bridge.mavlink.driving.path_driver import PathDriver
from stopgo.bridge.mavlink.driving.straight_drive import Patience
from stopgo.bridge.mavlink.driving.takeover_watch import TakeoverWatch
from stopgo.bridge.robot.base import BaseHealth, Outcome, Rest
from stopgo.mission.document import Mission, Point, RobotSpec
from stopgo.mission.mavlink.local_frame import apart
from stopgo.mission.run.events import Pose
from stopgo.mission.run.scans import needs_heading

ESTIMATED = Rest(metres=0.005, radians=0.005)
"""An estimator of a stationary vehicle drifts by some millimetres."""
NO_ORIGIN = (
    "the autopilot has no origin (GPS_GLOBAL_ORIGIN); set it to the mission's, or start stopgo robot with"
    " --set-origin"
)


class MavlinkBase:
    """The vehicle of an autopilot (`stopgo.bridge.robot.base.Base`)."""

    def __init__(
        self, autopilot: OnboardAutopilot, *, clock: Clock, arm: bool = False, patience: Patience = Patience()
    ) -> None:
        self._autopilot = autopilot
        self._frame = MissionFrame(autopilot.telemetry, autopilot.kind.rule)
        self._engagement = Engagement(
            autopilot, clock=clock, arms=arm, not_ready=self.not_ready, misplaced=self._misplaced
        )
        self._driver = PathDriver(autopilot, self._frame, self._engagement, patience)
        self._blocked_by = ""

    def take(self, mission: Mission) -> None:
        """Report poses in this mission's frame from now on, and drive in it."""
        self._frame.mission = self._autopilot.origin_keeper.mission = mission

    def pose(self) -> Pose:
        return self._frame.pose()

    def speed(self) -> float:
        return self._autopilot.telemetry.speed()

    def battery(self) -> float | None:
        """Charge as reported; `None` if the autopilot reports none: then its own failsafe is the only one."""
        return self._autopilot.telemetry.health().charge

    def health(self) -> BaseHealth:
        now = self._autopilot.telemetry.health()
        return BaseHealth(battery_ok=now.battery, position_ok=now.position, fence_ok=now.fence)

    def endurance_s(self) -> float | None:
        return None

    def rest(self) -> Rest:
        return ESTIMATED

    def unfit(self, mission: Mission) -> str:
        site, origin = mission.georeference, self._autopilot.telemetry.origin()
        if site is None:
            return "the mission has no georeference; plan it with --origin LAT,LON,ALT,HEADING"
        if needs_heading(mission.scanner) and not self._autopilot.kind.driving.turns:
            return (
                f"the scanner sees {mission.scanner.fov_deg:g}°, so its stops need their headings,"
                f" and {self._autopilot.kind.name} turns to none by command"
            )
        return "" if origin is None else apart(site, origin)

    def not_ready(self) -> str:
        unknown = self._autopilot.telemetry.why_unknown()
        if unknown:
            return unknown
        if self._autopilot.telemetry.origin() is None:
            return NO_ORIGIN
        return (
            self._misplaced()
            or self._autopilot.control.other_control()
            or self._autopilot.telemetry.health().lasting(self._blocked_by)
            or self._engagement.disarmed()
        )

    def _misplaced(self) -> str:
        """Report that the vehicle cannot drive in the mission's frame, as when somebody moved its origin."""
        return "" if self._frame.mission is None else self.unfit(self._frame.mission)

    def take_hold(self, why: str) -> bool:
        """Take the hold as known, for the run is paused for it; a failsafe then must end before a drive."""
        self._blocked_by = why
        self._accept_change()
        return True

    def watch_takeover(self) -> Callable[[], str]:
        """Return what reports who takes the vehicle from now on, also by putting it on hold."""
        watch, known = TakeoverWatch(self._autopilot, by_hold=True), ""

        def taken() -> str:
            nonlocal known
            control = self._autopilot.control
            if not known and (why := watch.taken() or watch.steered() or watch.disarmed()):
                known = self._blocked_by = control.mode_change() or why
                self._accept_change()
            return known

        return taken

    def _accept_change(self) -> None:
        self._autopilot.control.accept_mode()
        self._autopilot.control.accept_disarming()

    def blocked_by(self) -> str:
        return self._blocked_by

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        self._blocked_by = ""
        try:
            self._engagement.begin(interrupt)
            for point in path:
                self._driver.drive(point, limits, interrupt)
            if heading is not None and self._autopilot.kind.driving.turns:
                self._driver.turn(heading, interrupt)
        except DriveEnded as end:
            self._blocked_by = end.why
            self._engagement.release()
            return end.outcome
        if self._autopilot.kind.driving.streams:
            self._autopilot.control.stop()
        return "arrived"

    def stop(self) -> None:
        self._autopilot.control.accept_disarming()
        self._autopilot.control.stop()
