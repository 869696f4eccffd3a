"""An autopilot as a robot's base: driven point by point along the mission's legs, and judged by its pose.

Whoever stands by the vehicle wins: a mode changed by a remote control, an emergency stop or another station,
or a disarmed vehicle, ends the drive, and nothing is changed back before somebody has ordered to go on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from itertools import pairwise
from threading import Event

from stopgo.bridge.link.clock import Clock
from stopgo.bridge.mavlink.driving.onboard_autopilot import ORDER_S, OnboardAutopilot
from stopgo.bridge.mavlink.driving.straight_drive import NEAR_M, Ability, Patience, StraightDrive
from stopgo.bridge.robot.base import BaseHealth, Outcome, Rest
from stopgo.mission.document import Mission, Point, RobotSpec
from stopgo.mission.frames.transform import SiteOrigin
from stopgo.mission.mavlink.local_frame import UNPLACED, LocalFrame, VehicleOrigin, apart, local_frame
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot, legs_of
from stopgo.mission.run.scans import heading_error, needs_heading

TICK_S = 0.1
AGAIN_S = 1.0
"""How often a place is told again to a vehicle that stands: the last time may have been lost."""
STAND_S = 10.0
"""How long a drive that ended early waits for the vehicle to come to a stand."""
COAST_S = 0.4
"""How long a vehicle rolls on that is told to stop, until that was seen once."""
NEAR_SHARE = 0.6
"""Share of a stop's tolerance within which a drive ends: the estimate goes on wandering while it scans."""
TRIES = 3
"""So often the mode to drive is ordered: a line may lose both ways, and setpoints may not have come."""
TAKE_UP_S = 60.0
"""How long an autopilot that was started again may take until it can drive."""
BEAT_S = 2.0
"""A heartbeat comes within this, once a line is back."""
MOVED_M = 0.5
"""A vehicle whose autopilot was started again and that tells a place farther off was carried, or is lost."""
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
        self._boots: int | None = None
        """How often it had been started when we drove it last."""
        self._stood: Point | None = None
        self._late_until_s = -math.inf
        self._coast_s = COAST_S
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
            self._engage(interrupt)
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

    def _engage(self, interrupt: Event) -> None:
        """Heard, armed, in the mode in which we drive it, and still where it stands."""
        self._await(interrupt)
        autopilot = self.autopilot
        if self._boots not in (None, autopilot.peer.boots):
            self._take_up(interrupt)
        _must(self.not_ready() or autopilot.changed_hands())
        self._boots = autopilot.peer.boots
        if not autopilot.peer.armed:
            self._make_armed(interrupt)
        with autopilot.standing_at(autopilot.place()):
            self._guide(interrupt)

    def _make_armed(self, interrupt: Event) -> None:
        """Arm it; one that was started just now says no until its sensors agree, and is asked again."""
        autopilot = self.autopilot
        while trouble := autopilot.arm():
            _must(trouble if autopilot.up_s > TAKE_UP_S else "")
            self._pause(AGAIN_S, interrupt)
            self._await(interrupt)
            _must(self.not_ready() or autopilot.changed_hands())

    def _guide(self, interrupt: Event) -> None:
        """Into the mode in which we drive it, seen by its heartbeat."""
        trouble = ""
        for _ in range(TRIES):
            if self.autopilot.kind.driving.streams:
                self._pause(WARM_UP_S, interrupt)
            trouble = self.autopilot.guide() or self._not_guided(interrupt)
            if not trouble:
                return
        _must(trouble)

    def _not_guided(self, interrupt: Event) -> str:
        """Why it is not in that mode, though it took the order; empty once it is."""
        began_s = self._now_s()
        while not self.autopilot.is_guided():
            if self._now_s() > began_s + ORDER_S:
                return "the autopilot took the order and did not change its mode"
            self._pause(TICK_S, interrupt)
        return ""

    def _drive(self, point: Point, limits: RobotSpec, interrupt: Event) -> None:
        autopilot = self.autopilot
        drive = self._straight(point, limits)
        while True:
            if self._tick(interrupt):
                drive.paused(self._now_s())
            verdict = drive.judge(
                self.pose(), speed=autopilot.speed(), still=autopilot.still(), now_s=self._now_s()
            )
            self._coast_s = drive.coast_s
            if verdict == "arrived":
                return
            _must(drive.why)
            if drive.steer.stand:
                autopilot.halt()
            else:
                autopilot.keep_course(self._frame().yaw(drive.steer.heading), drive.steer.speed)

    def _straight(self, point: Point, limits: RobotSpec) -> StraightDrive:
        pose, stops = self.pose(), () if self._mission is None else self._mission.stops
        driving = self.autopilot.kind.driving
        near_m = min((NEAR_M, *(NEAR_SHARE * stop.tolerance_m for stop in stops)))
        ability = Ability(
            near_m=near_m, over_m=max(near_m, limits.radius), speed=limits.speed,
            acceleration=limits.acceleration, gives_up_s=self.autopilot.gives_up_s,
            reverses=driving.courses == "heading",
        )  # fmt: skip
        start = self._laid_to(point, pose)
        return StraightDrive(
            start, point, self._now_s(), ability=ability, coast_s=self._coast_s, patience=self._patience
        )

    def _laid_to(self, point: Point, pose: Pose) -> Point:
        """Where the straight of the mission begins that ends at `point`, if the vehicle is on one."""
        here = (pose.x, pose.y)
        legs = () if self._mission is None else legs_of(self._mission)
        pairs = [pair for leg in legs for one in pairwise(leg) for pair in (one, one[::-1])]
        beside = [(math.dist(foot(*pair, here), here), pair[0]) for pair in pairs if pair[1] == point]
        return min(beside, default=(0.0, here))[1]

    def _turn(self, heading: float, interrupt: Event) -> None:
        """Turn where it stands, as far as the vehicle can: one that steers like a car cannot at all."""
        yaw, began_s = self._frame().yaw(heading), self._now_s()
        least, progress_s, told_s = math.inf, began_s, -math.inf
        while self._now_s() < min(began_s + TURN_S, progress_s + self._patience.turns_s):
            off = self._off(heading)
            if off <= TURNED_RAD and self.autopilot.still():
                return
            if off < least - TURNED_RAD:
                least, progress_s = off, self._now_s()
            if self._now_s() - told_s >= AGAIN_S:
                self.autopilot.aim_yaw(yaw)
                told_s = self._now_s()
            if self._tick(interrupt):
                progress_s, told_s = self._now_s(), -math.inf
        self._check_heading(heading)

    def _check_heading(self, heading: float) -> None:
        """A heading that was missed matters only to a scanner that does not see all around."""
        mission = self._mission
        missing = 0.0 if mission is None else heading_error(mission.scanner, heading, self.pose().heading)
        if missing:
            wanted = math.degrees(heading)
            _must(f"the vehicle does not turn to {wanted:.0f}°: {math.degrees(missing):.0f}° are missing")

    def _off(self, heading: float) -> float:
        return abs(math.remainder(self.pose().heading - heading, math.tau))

    def _tick(self, interrupt: Event) -> bool:
        """A moment later; whether something has interrupted the drive that is over."""
        self._pause(TICK_S, interrupt)
        autopilot = self.autopilot
        rode_out = self._await(interrupt)
        if autopilot.peer.boots != self._boots:
            self._engage(interrupt)
            return True
        if self._left_by_itself():
            autopilot.left = None
            self._engage(interrupt)
            return True
        _must(autopilot.changed_hands() or ("" if autopilot.peer.armed else "the autopilot was disarmed"))
        self._stood = autopilot.place()
        return rode_out

    def _left_by_itself(self) -> bool:
        """Whether it holds because it did not hear us, as one does that wants a stream of setpoints.

        Its heartbeat may tell of that a moment after the line is back; of a hold that somebody ordered
        meanwhile it tells no failsafe.
        """
        just_back = self._now_s() - self._late_until_s < BEAT_S
        return just_back and self.autopilot.kind.driving.streams and self.autopilot.holds_by_itself

    def _pause(self, seconds: float, interrupt: Event) -> None:
        if self._clock.wait(seconds, interrupt):
            raise DriveEnded("interrupted")

    def _await(self, interrupt: Event) -> bool:
        """Wait for a vehicle that is late, which is told to stand meanwhile; whether it was."""
        autopilot, late = self.autopilot, False
        while autopilot.is_late:
            late, self._late_until_s = True, self._now_s()
            if autopilot.is_gone:
                _must(autopilot.out_of_reach())
            autopilot.halt()
            self._pause(TICK_S, interrupt)
        return late

    def _take_up(self, interrupt: Event) -> None:
        """The autopilot was started again: go on if it stands where it stood, and nobody took it meanwhile.

        It is left as it is if anything else is the case; the next order to drive does not ask again.
        """
        autopilot, began_s = self.autopilot, self._now_s()
        self._boots = autopilot.peer.boots
        again = "the autopilot was started again"
        _must("" if self._arm else f"{again} and is disarmed; arm it, or start stopgo robot with --arm")
        since_s = time.monotonic()
        origin = autopilot.origin()
        woke = None
        while woke is None or autopilot.origin(since_s) is None:
            if self._now_s() > began_s + TAKE_UP_S:
                _must(f"{again} and tells no {'mode' if woke is None else 'origin; set it to the mission’s'}")
            if origin is not None:
                autopilot.ask_origin(origin)
            self._pause(TICK_S, interrupt)
            self._await(interrupt)
            woke = woke or autopilot.mode_since(since_s)
        moved = math.dist(autopilot.place(), self._stood or autopilot.place())
        if moved > MOVED_M:
            _must(f"{again} and tells a place {moved:.2f} m from where it was: see where it stands")
        _must(autopilot.take(woke))

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
