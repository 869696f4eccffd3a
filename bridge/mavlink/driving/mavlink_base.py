"""An autopilot as a robot's base: driven point by point along the mission's legs, and judged by its pose.

Whoever stands by the vehicle wins: a mode changed by a remote control, an emergency stop or another station,
or a disarmed vehicle, ends the drive, and nothing is changed back before somebody has ordered to go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from threading import Event

from bridge.link.clock import Clock
from bridge.mavlink.driving.onboard_autopilot import ORDER_S, OnboardAutopilot
from bridge.mavlink.driving.straight_drive import NEAR_M, STALLED_S, Patience, StraightDrive
from bridge.robot.base import BaseHealth, Outcome, Rest
from mission.document import Mission, Point, RobotSpec, SiteOrigin
from mission.events import Pose
from mission.mavlink.local_frame import UNPLACED, LocalFrame, VehicleOrigin, apart, local_frame
from mission.run.scans import needs_heading, turned_away

TICK_S = 0.1
AGAIN_S = 1.0
"""How often a place is told again to a vehicle that stands: the last time may have been lost."""
STAND_S = 10.0
"""How long a drive that ended early waits for the vehicle to come to a stand."""
WARM_UP_S = 1.2
"""Setpoints must have come for a second before an autopilot that lives on them lets itself be driven."""
TURN_S = 20.0
TURNED_RAD = math.radians(1.0)
ESTIMATED = Rest(metres=0.005, radians=0.005)
"""An estimator of a vehicle that stands wanders by some millimetres."""


class DriveEnded(Exception):
    """A drive is over before its end."""

    def __init__(self, outcome: Outcome, why: str = "") -> None:
        super().__init__(why)
        self.outcome: Outcome = outcome
        self.why = why


class MavlinkBase:
    """The vehicle of an autopilot."""

    def __init__(
        self, autopilot: OnboardAutopilot, *, clock: Clock, arm: bool = False, patience: Patience = Patience()
    ) -> None:
        self.autopilot = autopilot
        self._clock = clock
        self._arm = arm
        self._patience = patience
        self._mission: Mission | None = None
        self._local = UNPLACED
        self._local_for: tuple[SiteOrigin | None, VehicleOrigin | None] = (None, None)
        self._boots = autopilot.peer.boots
        self._blocked_by = ""

    def take(self, mission: Mission) -> None:
        """Tell poses in this mission's frame from now on, and drive in it."""
        self._mission = mission

    # What it is asked

    def pose(self) -> Pose:
        north, east = self.autopilot.place()
        return self._frame().pose(north, east, self.autopilot.yaw())

    def speed(self) -> float:
        return self.autopilot.speed()

    def battery(self) -> float:
        """What the autopilot tells; full if it tells nothing, so that its own failsafe is all there is."""
        told = self.autopilot.battery()
        return 1.0 if told is None else told

    def health(self) -> BaseHealth:
        """Nothing: autopilots tell of none of it in words that all of them share."""
        return BaseHealth()

    def endurance_s(self) -> float | None:
        return None

    def rest(self) -> Rest:
        return ESTIMATED

    def unfit(self, mission: Mission) -> str:
        site, origin = mission.georeference, self.autopilot.origin()
        if site is None:
            return "the mission has no georeference; plan it with --origin LAT,LON,ALT,HEADING"
        if needs_heading(mission.scanner) and not self.autopilot.kind.driving.turns:
            return (
                f"the scanner sees {mission.scanner.fov_deg:g}°, so its stops need their headings,"
                f" and {self.autopilot.kind.name} turns to none by order"
            )
        return "" if origin is None else apart(site, origin)

    def not_ready(self) -> str:
        away = self.autopilot.out_of_reach()
        if away:
            return away
        if self.autopilot.origin() is None:
            return "the autopilot has no origin (GPS_GLOBAL_ORIGIN); set it to the mission's"
        wrong = "" if self._mission is None else self.unfit(self._mission)
        return wrong or self.autopilot.in_other_hands() or self._disarmed()

    def blocked_by(self) -> str:
        return self._blocked_by

    def _disarmed(self) -> str:
        if self.autopilot.peer.armed or self._arm:
            return ""
        return "the autopilot is disarmed; arm it, or start stopgo robot with --arm"

    # What it is ordered

    def goto(
        self, path: Sequence[Point], *, heading: float | None, limits: RobotSpec, interrupt: Event
    ) -> Outcome:
        self._blocked_by = ""
        try:
            self._engage(limits, interrupt)
            for point in path:
                self._drive(point, limits, interrupt)
            if heading is not None and self.autopilot.kind.driving.turns:
                self._turn(heading, interrupt)
        except DriveEnded as end:
            self._blocked_by = end.why
            self._leave_off()
            return end.outcome
        if self.autopilot.kind.driving.streams:
            self.autopilot.stop()
        return "arrived"

    def stop(self) -> None:
        self.autopilot.stop()

    def _engage(self, limits: RobotSpec, interrupt: Event) -> None:
        """Armed, in the mode in which we drive it, at the mission's speed, and still where it stands."""
        autopilot = self.autopilot
        _must(self.not_ready() or autopilot.changed_hands())
        self._boots = autopilot.peer.boots
        if not autopilot.peer.armed:
            _must(autopilot.arm())
        here = autopilot.place()
        if autopilot.kind.driving.streams:
            self._aim_for(here, WARM_UP_S, interrupt)
        _must(autopilot.guide())
        began_s = self._now_s()
        while not autopilot.is_guided():
            if self._now_s() > began_s + ORDER_S:
                _must("the autopilot took the order and did not change its mode")
            self._aim_for(here, TICK_S, interrupt)
        self._limit_speed(here, limits.speed, interrupt)

    def _aim_for(self, place: Point, seconds: float, interrupt: Event) -> None:
        """Keep telling a place while nothing else counts yet."""
        until_s = self._now_s() + seconds
        while self._now_s() < until_s:
            self.autopilot.aim(place)
            if self._clock.wait(TICK_S, interrupt):
                raise DriveEnded("interrupted")

    def _limit_speed(self, here: Point, speed: float, interrupt: Event) -> None:
        """A speed counts only for a vehicle that has a place to go to, so it is told where it stands."""
        trouble = ""
        for _ in range(3 if self.autopilot.kind.driving.takes_speed else 0):
            self.autopilot.aim(here)
            self._tick(interrupt)
            trouble = self.autopilot.limit_speed(speed)
            if not trouble:
                return
        _must(trouble)

    def _drive(self, point: Point, limits: RobotSpec, interrupt: Event) -> None:
        target = self._frame().north_east(point)
        course = self._course(point, limits)
        told_s = self._now_s()
        self.autopilot.aim(target)
        while True:
            self._tick(interrupt)
            lost = self.autopilot.still() and self._now_s() - told_s >= AGAIN_S
            if lost or self.autopilot.kind.driving.streams:
                self.autopilot.aim(target)
                told_s = self._now_s()
            here = self.pose()
            verdict = course.judge((here.x, here.y), still=self.autopilot.still(), now_s=self._now_s())
            if verdict == "arrived":
                return
            _must(course.why)

    def _course(self, point: Point, limits: RobotSpec) -> StraightDrive:
        pose, stops = self.pose(), () if self._mission is None else self._mission.stops
        near_m = min((NEAR_M, *(stop.tolerance_m for stop in stops)))
        return StraightDrive(
            (pose.x, pose.y), point, self._now_s(),
            near_m=near_m, over_m=max(near_m, limits.radius), patience=self._patience,
        )  # fmt: skip

    def _turn(self, heading: float, interrupt: Event) -> None:
        """Turn where it stands, as far as the vehicle can: one that steers like a car cannot at all."""
        yaw, began_s = self._frame().yaw(heading), self._now_s()
        least, progress_s, told_s = math.inf, began_s, -math.inf
        while self._now_s() < min(began_s + TURN_S, progress_s + STALLED_S):
            off = self._off(heading)
            if off <= TURNED_RAD and self.autopilot.still():
                return
            if off < least - TURNED_RAD:
                least, progress_s = off, self._now_s()
            if self._now_s() - told_s >= AGAIN_S:
                self.autopilot.aim_yaw(yaw)
                told_s = self._now_s()
            self._tick(interrupt)
        self._check_heading(heading)

    def _check_heading(self, heading: float) -> None:
        """A heading that was missed matters only to a scanner that does not see all around."""
        mission = self._mission
        missing = 0.0 if mission is None else turned_away(mission.scanner, heading, self.pose().heading)
        if missing:
            wanted = math.degrees(heading)
            _must(f"the vehicle does not turn to {wanted:.0f}°: {math.degrees(missing):.0f}° are missing")

    def _off(self, heading: float) -> float:
        return abs(math.remainder(self.pose().heading - heading, math.tau))

    def _tick(self, interrupt: Event) -> None:
        """A moment later, if all is well."""
        if self._clock.wait(TICK_S, interrupt):
            raise DriveEnded("interrupted")
        autopilot = self.autopilot
        began_again = autopilot.peer.boots != self._boots
        _must(
            autopilot.out_of_reach()
            or ("the autopilot was started again" if began_again else "")
            or autopilot.changed_hands()
            or ("" if autopilot.peer.armed else "the autopilot was disarmed")
        )

    def _leave_off(self) -> None:
        """After a drive that ended early: hold, unless somebody else has the vehicle, and stand."""
        autopilot = self.autopilot
        if autopilot.changed_hands() and not autopilot.out_of_reach():
            autopilot.leave()
        else:
            autopilot.stop()
        until_s = self._now_s() + STAND_S
        while not (autopilot.still() or autopilot.out_of_reach()) and self._now_s() < until_s:
            self._clock.wait(TICK_S)

    def _frame(self) -> LocalFrame:
        """The mission's, as the autopilot's origin lies in it; east and north while either is unknown."""
        site = None if self._mission is None else self._mission.georeference
        now = (site, self.autopilot.origin())
        if now != self._local_for:
            self._local, self._local_for = self._framed(*now), now
        return self._local

    def _framed(self, site: SiteOrigin | None, origin: VehicleOrigin | None) -> LocalFrame:
        rule = self.autopilot.kind.rule
        if site is None:
            return UNPLACED
        if origin is None or apart(site, origin):
            return LocalFrame(site)
        return local_frame(site, origin, rule)

    def _now_s(self) -> float:
        return self._clock.now_ns() / 1e9


def _must(trouble: str) -> None:
    """End the drive if there is trouble."""
    if trouble:
        raise DriveEnded("blocked", trouble)
