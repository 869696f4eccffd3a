"""Driving along a mission's legs, point by point, and turning on the spot; judged by the vehicle's pose."""

from __future__ import annotations

import math
from itertools import pairwise
from threading import Event

from stopgo.bridge.mavlink.driving.engagement import REPEAT_S, Engagement, end_if
from stopgo.bridge.mavlink.driving.mission_frame import MissionFrame
from stopgo.bridge.mavlink.driving.onboard_autopilot import OnboardAutopilot
from stopgo.bridge.mavlink.driving.straight_drive import NEAR_M, Ability, Patience, Steer, StraightDrive
from stopgo.mission.document import Point, RobotSpec
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot, legs_of
from stopgo.mission.run.scans import heading_error

COAST_S = 0.4
"""Time that a vehicle rolls on after the command to stop, until it was measured once."""
NEAR_FRACTION = 0.6
"""Fraction of a stop's tolerance within which a drive ends: the estimate drifts on during the scan."""
TURN_S = 20.0
TURNED_RAD = math.radians(1.0)


class PathDriver:
    """Drives one vehicle; both methods raise `DriveEnded` when the drive cannot go on."""

    def __init__(
        self, autopilot: OnboardAutopilot, frame: MissionFrame, engagement: Engagement, patience: Patience
    ) -> None:
        self._autopilot = autopilot
        self._frame = frame
        self._engagement = engagement
        self._patience = patience
        self._coast_s = COAST_S

    def drive(self, point: Point, limits: RobotSpec, interrupt: Event) -> None:
        """Drive straight to a point of the mission."""
        telemetry, now_s = self._autopilot.telemetry, self._engagement.now_s
        drive = self._straight(point, limits)
        while True:
            if self._engagement.tick(interrupt):
                drive.paused(now_s())
            verdict = drive.judge(
                self._frame.pose(), speed=telemetry.speed(), still=telemetry.is_stationary(), now_s=now_s()
            )
            self._coast_s = drive.coast_s
            if verdict == "arrived":
                return
            end_if(drive.why)
            self._steer(drive.steer)

    def _steer(self, steer: Steer) -> None:
        if steer.stand:
            self._autopilot.setpoints.halt()
        else:
            self._autopilot.setpoints.keep_course(self._frame.yaw(steer.heading), steer.speed)

    def turn(self, heading: float, interrupt: Event) -> None:
        """Turn on the spot as far as the vehicle can: one that steers like a car cannot at all."""
        yaw, began_s = self._frame.yaw(heading), self._engagement.now_s()
        least, progress_s, sent_s = math.inf, began_s, -math.inf
        while self._engagement.now_s() < min(began_s + TURN_S, progress_s + self._patience.turns_s):
            off = abs(math.remainder(self._frame.pose().heading - heading, math.tau))
            if off <= TURNED_RAD and self._autopilot.telemetry.is_stationary():
                return
            if off < least - TURNED_RAD:
                least, progress_s = off, self._engagement.now_s()
            if self._engagement.now_s() - sent_s >= REPEAT_S:
                self._autopilot.setpoints.turn_to(yaw)
                sent_s = self._engagement.now_s()
            if self._engagement.tick(interrupt):
                progress_s, sent_s = self._engagement.now_s(), -math.inf
        self._check_heading(heading)

    def _straight(self, point: Point, limits: RobotSpec) -> StraightDrive:
        pose, stops = self._frame.pose(), () if self._frame.mission is None else self._frame.mission.stops
        near_m = min((NEAR_M, *(NEAR_FRACTION * stop.tolerance_m for stop in stops)))
        ability = Ability(
            near_m=near_m, over_m=max(near_m, limits.radius), speed=limits.speed,
            acceleration=limits.acceleration, gives_up_s=self._autopilot.gives_up_s,
            reverses=self._autopilot.kind.driving.courses == "heading",
        )  # fmt: skip
        return StraightDrive(
            self._leg_start(point, pose), point, self._engagement.now_s(),
            ability=ability, coast_s=self._coast_s, patience=self._patience,
        )  # fmt: skip

    def _leg_start(self, point: Point, pose: Pose) -> Point:
        """Start of the mission's straight that ends at `point`, if the vehicle is on one."""
        here, mission = (pose.x, pose.y), self._frame.mission
        legs = () if mission is None else legs_of(mission)
        pairs = [pair for leg in legs for one in pairwise(leg) for pair in (one, one[::-1])]
        offsets = [(math.dist(foot(*pair, here), here), pair[0]) for pair in pairs if pair[1] == point]
        return min(offsets, default=(0.0, here))[1]

    def _check_heading(self, heading: float) -> None:
        """End the drive if the scanner needs a heading that was not reached."""
        mission = self._frame.mission
        away = self._frame.pose().heading
        missing = 0.0 if mission is None else heading_error(mission.scanner, heading, away)
        if missing:
            wanted = math.degrees(heading)
            end_if(f"the vehicle does not turn to {wanted:.0f}°: {math.degrees(missing):.0f}° are missing")
