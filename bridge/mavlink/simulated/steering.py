"""Control loops of an autopilot: from target to throttle and steering, as ArduPilot Rover and PX4 do it.

ArduPilot's: AR_AttitudeControl (speed and turn rate loops, stop), AR_PivotTurn, AR_PosControl and AR_WPNav
(a target that runs ahead on the straight and is followed). PX4's: DifferentialVelControl (turn on the spot
or drive), DifferentialPosControl (pure pursuit). Written from scratch after their behaviour.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from stopgo.bridge.mavlink.simulated.estimator import Estimate
from stopgo.bridge.mavlink.simulated.tuning import Tuning
from stopgo.mission.document import Point

PIVOTED_RAD = math.radians(5.0)
STEER_SPEED = 1.0
"""Least speed by which ArduPilot converts a sideways acceleration into a turn rate."""
REACHED_M = 0.01
"""Distance to its end at which ArduPilot's running target counts as arrived."""
PARTS = 8
"""Parts of a mean over time."""
MIDDLES = tuple((part + 0.5) / PARTS for part in range(PARTS))
STARTS_M_S = 0.05
"""PX4's speed at the very beginning of a straight."""


@dataclass
class RunningStraight:
    """A straight between two positions, and the progress of the target that runs along it."""

    start: Point
    end: Point
    run_s: float = 0.0
    run_m: float = 0.0
    run_speed: float = 0.0
    scale: float = 1.0
    turning: bool = False
    """Turning on the spot, before it drives."""
    reached: bool = False
    keeps: bool = False
    """The vehicle goes on following it at its end: ArduPilot does so while it holds in AUTO."""

    @property
    def length(self) -> float:
        return math.dist(self.start, self.end)

    @property
    def along(self) -> Point:
        """Unit vector of its direction."""
        length = self.length
        return (
            ((self.end[0] - self.start[0]) / length, (self.end[1] - self.start[1]) / length)
            if length
            else (1.0, 0.0)
        )


@dataclass(frozen=True)
class Course:
    """A commanded heading and speed; backwards if the speed is negative."""

    heading: float
    speed: float


Want = tuple[float, float]
"""Speed ahead and turn rate."""


class ArduPilotLaw:
    """Control law of ArduPilot Rover with skid steering."""

    def __init__(self, tuning: Tuning) -> None:
        self._p = tuning
        self.reset()

    def reset(self) -> None:
        self._speed = self._turn = self._speed_sum = self._turn_sum = 0.0

    def set_out(self, straight: RunningStraight, here: Estimate) -> None:
        off = abs(_off(_bearing(here, straight.end), here))
        angle = math.radians(self._p["WP_PIVOT_ANGLE"])
        straight.turning = self._p.pivots and angle > PIVOTED_RAD and off > angle

    def follow(self, straight: RunningStraight, here: Estimate, speed: float, dt: float) -> Want:
        if straight.turning:
            bearing = _bearing(here, straight.end)
            straight.turning = abs(_off(bearing, here)) >= PIVOTED_RAD
            return 0.0, self._turn_to(bearing, here) if abs(self._speed) < 1e-6 else 0.0
        target, velocity, push = self._run(straight, here, speed, dt)
        to_x, to_y = target[0] - here.pose.x, target[1] - here.pose.y
        gain = self._p["PSC_POS_P"]
        want = _within((velocity[0] + gain * to_x, velocity[1] + gain * to_y), speed)
        self._check_end(straight, here)
        return self._ahead_and_turn(want, push, here)

    def _run(
        self, straight: RunningStraight, here: Estimate, speed: float, dt: float
    ) -> tuple[Point, Point, Point]:
        """Position, velocity and acceleration of the running target."""
        p, (ux, uy) = self._p, straight.along
        accel = p["WP_ACCEL"] or p["ATC_ACCEL_MAX"] or 20.0
        smooth_s = accel / (p["WP_JERK"] or accel)
        before = straight.run_speed
        straight.run_s += straight.scale * dt
        straight.run_m, straight.run_speed = _smooth(straight.length, speed, accel, smooth_s, straight.run_s)
        self._scale(straight, here, dt / smooth_s)
        at = (straight.start[0] + ux * straight.run_m, straight.start[1] + uy * straight.run_m)
        push = (straight.run_speed - before) / dt
        return at, (ux * straight.run_speed, uy * straight.run_speed), (ux * push, uy * push)

    def _scale(self, straight: RunningStraight, here: Estimate, weight: float) -> None:
        """Slow the target's time for a vehicle that does not keep up with it."""
        if straight.run_speed <= 0:
            return
        ux, uy = straight.along
        ahead = (
            straight.run_m - (here.pose.x - straight.start[0]) * ux - (here.pose.y - straight.start[1]) * uy
        )
        keeps_up = (here.speed_x * ux + here.speed_y * uy - self._p["PSC_POS_P"] * ahead) / straight.run_speed
        straight.scale += (max(0.0, min(1.0, 0.05 + keeps_up)) - straight.scale) * weight

    def _check_end(self, straight: RunningStraight, here: Estimate) -> None:
        """Set `reached` within the radius or past the finish line, once the target is there."""
        if straight.length - straight.run_m <= REACHED_M:
            ux, uy = straight.along
            past = (here.pose.x - straight.end[0]) * ux + (here.pose.y - straight.end[1]) * uy
            straight.reached = (
                past >= 0 or math.dist((here.pose.x, here.pose.y), straight.end) <= self._p["WP_RADIUS"]
            )

    def _ahead_and_turn(self, want: Point, push: Point, here: Estimate) -> Want:
        cos, sin = math.cos(here.pose.heading), math.sin(here.pose.heading)
        gain = self._p["PSC_VEL_P"]
        lateral = -sin * (push[0] + gain * (want[0] - here.speed_x)) + cos * (
            push[1] + gain * (want[1] - here.speed_y)
        )
        ahead = cos * want[0] + sin * want[1]
        return ahead, lateral / max(STEER_SPEED, abs(ahead))

    def steer(self, course: Course, here: Estimate) -> Want:
        return _limit(course.speed, self._p["WP_SPEED"]), self._turn_to(course.heading, here)

    def _turn_to(self, heading: float, here: Estimate) -> float:
        off = _off(heading, here)
        most = math.radians(self._p["WP_PIVOT_RATE"] or self._p["ATC_STR_RAT_MAX"])
        slows = math.sqrt(2 * abs(off) * math.radians(self._p["ATC_STR_ACC_MAX"])) or most
        return _limit(_limit(self._p["ATC_STR_ANG_P"] * off, most), slows)

    def output(self, want: Want, here: Estimate, dt: float) -> tuple[float, float]:
        return self._throttle(want[0], here.ahead, dt), self._steering(want[1], here.turning, dt)

    def _throttle(self, wanted: float, speed: float, dt: float) -> float:
        p = self._p
        slower = abs(wanted) < abs(self._speed)
        step = ((p["ATC_DECEL_MAX"] if slower else 0.0) or p["ATC_ACCEL_MAX"] or 1e3) * dt
        self._speed = max(self._speed - step, min(self._speed + step, wanted))
        if self._speed == 0.0 and abs(speed) <= p["ATC_STOP_SPEED"]:
            self._speed_sum = 0.0
            return 0.0
        off = self._speed - speed
        self._speed_sum = _limit(self._speed_sum + p["ATC_SPEED_I"] * off * dt, p["ATC_SPEED_IMAX"])
        base = self._speed * p["CRUISE_THROTTLE"] / 100.0 / p["CRUISE_SPEED"]
        out = base + p["ATC_SPEED_P"] * off + self._speed_sum
        brakes = p["ATC_BRAKE"] or out * self._speed > 0
        return out if brakes else 0.0

    def _steering(self, wanted: float, turning: float, dt: float) -> float:
        p = self._p
        step = (math.radians(p["ATC_STR_ACC_MAX"]) or 1e3) * dt
        wanted = max(self._turn - step, min(self._turn + step, wanted))
        self._turn = _limit(wanted, math.radians(p["ATC_STR_RAT_MAX"]) or 1e3)
        off = self._turn - turning
        self._turn_sum = _limit(self._turn_sum + p["ATC_STR_RAT_I"] * off * dt, 1.0)
        return p["ATC_STR_RAT_FF"] * self._turn + p["ATC_STR_RAT_P"] * off + self._turn_sum


class Px4Law:
    """Control law of PX4's differential rover."""

    def __init__(self, tuning: Tuning) -> None:
        self._p = tuning
        self._spot = False
        self.reset()

    def reset(self) -> None:
        self._speed = self._turn = self._sum = 0.0

    def set_out(self, straight: RunningStraight, here: Estimate) -> None:
        """Do nothing: at every moment it decides again if it turns on the spot."""

    def follow(self, straight: RunningStraight, here: Estimate, speed: float, dt: float) -> Want:
        p, position = self._p, (here.pose.x, here.pose.y)
        away, begun = math.dist(position, straight.end), math.dist(position, straight.start)
        straight.reached = away <= p["NAV_ACC_RAD"]
        if straight.reached:
            return 0.0, 0.0
        slows = math.sqrt(2 * p["RO_DECEL_LIM"] * away)
        starts = math.sqrt(2 * p["RO_ACCEL_LIM"] * begun) + STARTS_M_S
        speed = min(speed, slows, starts)
        return self.steer(Course(self._pursued(straight, position, speed), speed), here)

    def _pursued(self, straight: RunningStraight, position: Point, speed: float) -> float:
        """Bearing of the point of the straight that lies a lookahead away (pure pursuit)."""
        p, (ux, uy) = self._p, straight.along
        ahead = max(p["PP_LOOKAHD_MIN"], min(p["PP_LOOKAHD_MAX"], p["PP_LOOKAHD_GAIN"] * speed))
        along = (position[0] - straight.start[0]) * ux + (position[1] - straight.start[1]) * uy
        across = (position[1] - straight.start[1]) * ux - (position[0] - straight.start[0]) * uy
        reach = min(straight.length, along + math.sqrt(max(0.0, ahead * ahead - across * across)))
        aim = (straight.start[0] + reach * ux, straight.start[1] + reach * uy)
        return math.atan2(aim[1] - position[1], aim[0] - position[0])

    def steer(self, course: Course, here: Estimate) -> Want:
        """Turn on the spot while the bearing is far off, else drive."""
        p, off = self._p, _off(course.heading, here)
        self._spot = p.pivots and abs(off) > p["RD_TRANS_TRN_DRV" if self._spot else "RD_TRANS_DRV_TRN"]
        turn = _limit(p["RO_YAW_P"] * off, math.radians(p["RO_YAW_RATE_LIM"]))
        return (0.0 if self._spot else _limit(course.speed, p["RO_SPEED_LIM"])), turn

    def output(self, want: Want, here: Estimate, dt: float) -> tuple[float, float]:
        p = self._p
        self._speed = _toward(self._speed, want[0], p["RO_ACCEL_LIM"] * dt, p["RO_DECEL_LIM"] * dt)
        self._turn += _limit(want[1] - self._turn, math.radians(p["RO_YAW_ACCEL_LIM"]) * dt)
        measured = here.ahead if abs(here.ahead) > p["RO_SPEED_TH"] else 0.0
        off = self._speed - measured
        self._sum = _limit(self._sum + p["RO_SPEED_I"] * off * dt, 1.0) if self._speed else 0.0
        throttle = self._speed / p["RO_MAX_THR_SPEED"] + p["RO_SPEED_P"] * off + self._sum
        return (throttle if self._speed or measured else 0.0), self._turn / math.radians(p["SIM_TURN_TOP"])


LAWS: dict[str, type[ArduPilotLaw] | type[Px4Law]] = {"ardupilot": ArduPilotLaw, "px4": Px4Law}


def _smooth(length: float, speed: float, accel: float, smooth_s: float, run_s: float) -> tuple[float, float]:
    """Distance and speed from rest to rest with limited acceleration and jerk, after `run_s`.

    It is the mean over `smooth_s` of a motion whose acceleration begins at once.
    """
    top = min(speed, math.sqrt(length * accel))
    if top <= 0:
        return 0.0, 0.0
    ramp_s, whole_s = top / accel, length / top + top / accel
    run_m = fast = 0.0
    for middle in MIDDLES:
        seconds = run_s - middle * smooth_s
        left_s = whole_s - seconds
        if left_s <= 0:
            run_m += length
        elif seconds > ramp_s and left_s > ramp_s:
            run_m += top * (seconds - ramp_s / 2)
            fast += top
        elif 0 < seconds <= ramp_s:
            run_m += accel * seconds * seconds / 2
            fast += accel * seconds
        elif seconds > 0:
            run_m += length - accel * left_s * left_s / 2
            fast += accel * left_s
    return run_m / PARTS, fast / PARTS


def _bearing(here: Estimate, to: Point) -> float:
    return math.atan2(to[1] - here.pose.y, to[0] - here.pose.x)


def _off(heading: float, here: Estimate) -> float:
    return math.remainder(heading - here.pose.heading, math.tau)


def _limit(value: float, most: float) -> float:
    return max(-most, min(most, value))


def _within(vector: Point, most: float) -> Point:
    length = math.hypot(*vector)
    return vector if length <= most else (vector[0] * most / length, vector[1] * most / length)


def _toward(value: float, wanted: float, up: float, down: float) -> float:
    """A step from `value`; away from 0 by `up` at most, towards it by `down`."""
    step = down if abs(wanted) < abs(value) else up
    return value + _limit(wanted - value, step or 1e3)
