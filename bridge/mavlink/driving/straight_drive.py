"""Steering along one straight of a leg, from moment to moment, and the verdict at its end.

The vehicle turns on the spot until it faces along the straight. It follows the line and not only its end,
slows down so that it stops there, and checks where it stopped. If that is not near enough, it tries again.
The verdict counts the vehicle's pose and motion only: an autopilot's report of its arrival proves nothing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from stopgo.mission.document import Point
from stopgo.mission.run.events import Pose
from stopgo.mission.run.route_position import foot

DriveVerdict = Literal["going", "arrived", "blocked"]
DrivePhase = Literal["turning", "driving", "stopping"]

NEAR_M = 0.03
"""Distance from the end that is near enough, unless the mission's tolerance is smaller."""
TRIES = 5
"""Number of further tries after a stop that is not near enough; then it is as near as it gets."""
OVERRUN_M = 0.2
"""Distance that a vehicle without link may roll beyond its end, until it gives up by itself.

At its slowest it may roll this far, so a smaller value would promise too much.
"""
LINK_DELAY_S = 0.2
"""Longest delay of a command on the link."""
CREEP_M_S = 0.06
"""Lowest commanded speed: most drives hold no lower one."""
PUSH_M_S = 0.04
"""Increase of the commanded speed each time the vehicle has not begun to move."""
PUSHED_M_S = 0.3
BRAKES = 0.5
"""Fraction of the vehicle's acceleration that braking relies on."""
LOOK_AHEAD_M = 0.5
"""Distance along the line to the point that a vehicle off the line steers for."""
MOST_ASIDE_RAD = math.radians(60.0)
FACES_RAD = math.radians(3.0)
"""Largest error of the heading with which the vehicle begins to drive."""
TURNS_AGAIN_RAD = math.radians(30.0)
"""Error of the heading at which the vehicle stops to turn on the spot."""
OFF_LINE_M = 0.10
"""Cross-track error above which the vehicle drives slowly until it is back."""
SLOWLY_M_S = 0.15
PROGRESS_M = 0.01


@dataclass(frozen=True)
class Patience:
    """Time limits of a drive, seconds."""

    stood_s: float = 0.4
    """Stationary for this long: the vehicle has come to a standstill."""
    begins_s: float = 1.5
    """Not moving for this long: more speed is commanded."""
    stalled_s: float = 10.0
    """Stationary for this long against the command to drive: it will not go on."""
    turns_s: float = 4.0
    """Not turning for this long against the command: it cannot turn on the spot."""
    astray_s: float = 30.0
    """Moving for this long without getting nearer."""


@dataclass(frozen=True)
class Ability:
    """Abilities of a vehicle, and the accuracy that is wanted of it."""

    near_m: float
    """Distance to the end at which a stationary vehicle has arrived."""
    over_m: float
    """Distance accepted after all tries; a larger cross-track error ends the drive."""
    speed: float
    acceleration: float
    gives_up_s: float
    """Time for which it drives on by itself without link."""
    reverses: bool
    """True if it drives backwards on command."""


@dataclass(frozen=True)
class Steer:
    """Command for the present moment."""

    heading: float
    speed: float = 0.0
    """Backwards if negative; 0 to turn on the spot."""
    stand: bool = False
    """True: neither drive nor turn."""


class StraightDrive:
    """A straight to `end` along the line from `start`.

    Parameters
    ----------
    coast_s
        Time for which it rolls on at its speed after the command to stop; measured at each standstill.
    """

    def __init__(
        self, start: Point, end: Point, now_s: float, *, ability: Ability, coast_s: float, patience: Patience
    ) -> None:
        self._start, self._end, self._line = start, end, (start, end)
        self._ability, self._patience = ability, patience
        self.coast_s = coast_s
        self.why = ""
        """Reason, once the drive is blocked."""
        self.steer = Steer(0.0, stand=True)
        self._tries = 0
        self._nearest = math.inf
        self._progress_s = self._moved_s = now_s
        self._still_since: float | None = None
        self._stop_at: tuple[Point, float] | None = None
        self._seen: Pose | None = None
        self._phase: DrivePhase = "turning"
        self._turn_s, self._least_off = now_s, math.inf
        self._backwards = False
        self._floor = CREEP_M_S
        self._commanded, self._commanded_s = 0.0, now_s

    def judge(self, here: Pose, *, speed: float, still: bool, now_s: float) -> DriveVerdict:
        """Judge if the vehicle has arrived or never will; else `steer` is the next command."""
        if self._seen is None:
            self._backwards = self._turns_less_backwards(here)
            if math.dist((here.x, here.y), self._end) <= self._ability.near_m:
                self._phase = "stopping"
        self._note(here, still, now_s)
        self.why = self._wrong(here, now_s)
        if self.why:
            return "blocked"
        if self._phase == "turning":
            self._turn(here, now_s)
        if self._phase == "driving":
            self._drive(here, speed, now_s)
        if self._phase == "stopping":
            return self._stop(here, now_s)
        return "going"

    def paused(self, now_s: float) -> None:
        """Leave out a while in which the vehicle was held, or its state was unknown."""
        self._progress_s = self._moved_s = self._turn_s = now_s
        self._still_since = None
        self._phase, self._least_off = "turning", math.inf

    def _note(self, here: Pose, still: bool, now_s: float) -> None:
        """Note when the vehicle last moved, and when it last came nearer."""
        self._still_since = (now_s if self._still_since is None else self._still_since) if still else None
        away = math.dist((here.x, here.y), self._end)
        if away < self._nearest - PROGRESS_M:
            self._nearest, self._progress_s = away, now_s
        before = self._seen
        if before is None or math.dist((before.x, before.y), (here.x, here.y)) > PROGRESS_M:
            self._seen, self._moved_s = here, now_s

    def _wrong(self, here: Pose, now_s: float) -> str:
        position = (here.x, here.y)
        off_path, away = math.dist(position, foot(*self._line, position)), math.dist(position, self._end)
        if min(off_path, away) > self._ability.over_m:
            return f"the vehicle is {off_path:.2f} m off the path; drive it back there by hand"
        if self._phase == "driving" and now_s - self._moved_s >= self._patience.stalled_s:
            return f"the vehicle stopped {away:.2f} m from its goal, and does not go on"
        if now_s - self._progress_s >= self._patience.astray_s:
            return f"the vehicle moves without getting nearer than {self._nearest:.2f} m"
        return ""

    # Turning on the spot

    def _turn(self, here: Pose, now_s: float) -> None:
        heading = self._heading(here)
        off = abs(math.remainder(heading - here.heading, math.tau))
        if off < self._least_off - FACES_RAD / 3:
            self._least_off, self._turn_s = off, now_s
            self._progress_s = now_s
        self.steer = Steer(heading)
        if off <= FACES_RAD or now_s - self._turn_s >= self._patience.turns_s:
            self._phase, self._moved_s = "driving", now_s
            self._commanded, self._commanded_s = 0.0, now_s

    def _turns_less_backwards(self, here: Pose) -> bool:
        """True if driving backwards needs less turning: only back to a position just passed."""
        if not self._ability.reverses or math.dist((here.x, here.y), self._end) > self._ability.over_m:
            return False
        bearing = math.atan2(self._end[1] - here.y, self._end[0] - here.x)
        return abs(math.remainder(bearing - here.heading, math.tau)) > math.pi / 2

    # Driving

    def _drive(self, here: Pose, speed: float, now_s: float) -> None:
        left, cross_track = self._left_and_cross_track(here)
        if left <= speed * self.coast_s:
            self._stop_at = ((here.x, here.y), speed)
            self._phase = "stopping"
            return
        heading = self._heading(here)
        off = abs(math.remainder(heading - here.heading, math.tau))
        if off > TURNS_AGAIN_RAD and self._least_off <= FACES_RAD:
            self._phase, self._turn_s, self._least_off = "turning", now_s, math.inf
            self.steer = Steer(heading)
            return
        if now_s - self._moved_s >= self._patience.begins_s * (1 + (self._floor - CREEP_M_S) / PUSH_M_S):
            self._floor = min(PUSHED_M_S, self._floor + PUSH_M_S)
        elif speed > self._floor:
            self._floor = CREEP_M_S
        wanted = min(
            self._speed(left, abs(cross_track)), max(CREEP_M_S, self._commanded + self._faster(now_s))
        )
        self._commanded, self._commanded_s = wanted, now_s
        self.steer = Steer(heading, -wanted if self._backwards else wanted)

    def _speed(self, left: float, cross_track: float) -> float:
        """Highest speed from which it stops at the end, also without link; low while it is off the line."""
        ability, brake = self._ability, BRAKES * self._ability.acceleration
        stops = _fastest(left, brake=brake, after_s=self.coast_s)
        alone_s = ability.gives_up_s + LINK_DELAY_S + self.coast_s
        gives_up = _fastest(left + OVERRUN_M, brake=ability.acceleration, after_s=alone_s)
        most = min(ability.speed, stops, gives_up, SLOWLY_M_S if cross_track > OFF_LINE_M else math.inf)
        return max(most, self._floor)

    def _faster(self, now_s: float) -> float:
        """Largest increase of the commanded speed since the last command: else the vehicle overshoots."""
        return BRAKES * self._ability.acceleration * min(1.0, now_s - self._commanded_s)

    def _heading(self, here: Pose) -> float:
        """Heading along the line, and back to it if the vehicle is off the line."""
        left, cross_track = self._left_and_cross_track(here)
        (ax, ay), (bx, by) = self._line
        aside = math.atan2(-cross_track, LOOK_AHEAD_M) if left > 0 else 0.0
        aside = max(-MOST_ASIDE_RAD, min(MOST_ASIDE_RAD, aside))
        along = math.atan2(by - ay, bx - ax)
        return along + aside + (math.pi if self._backwards else 0.0)

    def _left_and_cross_track(self, here: Pose) -> tuple[float, float]:
        """Metres that are left along the line, and the cross-track error (to the left)."""
        (ax, ay), (bx, by) = self._line
        length = math.hypot(bx - ax, by - ay)
        if length == 0:
            return math.dist((here.x, here.y), self._end), 0.0
        ux, uy = (bx - ax) / length, (by - ay) / length
        return (bx - here.x) * ux + (by - here.y) * uy, (here.y - ay) * ux - (here.x - ax) * uy

    # Stopping

    def _stop(self, here: Pose, now_s: float) -> DriveVerdict:
        self.steer = Steer(here.heading, stand=True)
        self._moved_s = self._progress_s = now_s
        if self._still_since is None or now_s - self._still_since < self._patience.stood_s:
            return "going"
        self._measure_coast(here)
        away = math.dist((here.x, here.y), self._end)
        if away <= self._ability.near_m or (self._tries >= TRIES and away <= self._ability.over_m):
            return "arrived"
        if self._tries >= TRIES:
            self.why = f"the vehicle stopped {away:.2f} m from its goal, after {TRIES} more tries"
            return "blocked"
        self._try_again(here, now_s)
        return "going"

    def _measure_coast(self, here: Pose) -> None:
        """Measure how long it rolled on after the command to stop."""
        if self._stop_at is not None and self._stop_at[1] > CREEP_M_S / 2:
            position, speed = self._stop_at
            rolled_s = math.dist(position, (here.x, here.y)) / speed
            self.coast_s += 0.5 * (max(0.05, min(2.0, rolled_s)) - self.coast_s)
        self._stop_at = None

    def _try_again(self, here: Pose, now_s: float) -> None:
        """Drive the last bit again: straight there, forwards or backwards."""
        self._tries += 1
        self._line = ((here.x, here.y), self._end)
        self._backwards = self._turns_less_backwards(here)
        self._phase, self._turn_s, self._least_off = "turning", now_s, math.inf
        self._nearest, self._progress_s = math.inf, now_s


def _fastest(left: float, *, brake: float, after_s: float) -> float:
    """Speed from which it stops within `left` metres if it brakes after `after_s` seconds."""
    return math.sqrt((brake * after_s) ** 2 + 2 * brake * max(0.0, left)) - brake * after_s
