"""One straight of a leg: how it is steered from moment to moment, and how it ends.

It turns on the spot until it faces along the straight, drives on the line and not only to its end, slows
down so that it stops there, and looks where it came to stand. From a stand that is not near enough it goes
again. It is judged by where the vehicle is and whether it moves: what an autopilot says of its arrival is no
proof of it.
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
"""Nearer than this nobody asks for more, unless the mission's tolerance does."""
TRIES = 5
"""So often a vehicle that stands beside its place is sent there again; then it is as near as it gets."""
OVERRUN_M = 0.2
"""So far beyond its end a vehicle may roll that hears us no more, until it has given up by itself.

At its slowest it may come as far, so less would promise more than is kept.
"""
HEARD_S = 0.2
"""How long what we say may have been under way."""
CREEP_M_S = 0.06
"""No slower: most drives hold no lower speed."""
PUSH_M_S = 0.04
"""So much faster it is asked to be, each time it has not begun to move."""
PUSHED_M_S = 0.3
BRAKES = 0.5
"""Share of its acceleration that is counted on for slowing down."""
LOOK_AHEAD_M = 0.5
"""A vehicle beside the line steers for the point of it that lies so far ahead."""
MOST_ASIDE_RAD = math.radians(60.0)
FACES_RAD = math.radians(3.0)
"""So well it faces along the straight before it drives."""
TURNS_AGAIN_RAD = math.radians(30.0)
"""It stops to turn on the spot when it faces this far off."""
BESIDE_M = 0.10
"""Farther beside the line it drives slowly until it is back."""
SLOWLY_M_S = 0.15
PROGRESS_M = 0.01


@dataclass(frozen=True)
class Patience:
    """How long a drive waits for what should happen, seconds."""

    stood_s: float = 0.4
    """Standing for so long is to have come to a stand."""
    begins_s: float = 1.5
    """A vehicle that has not begun to move by then is asked for more speed."""
    stalled_s: float = 10.0
    """Standing for so long though it is told to drive: it will not go on."""
    turns_s: float = 4.0
    """Not turning for so long though it is told to: it cannot turn on the spot."""
    astray_s: float = 30.0
    """Moving for so long without getting nearer."""


@dataclass(frozen=True)
class Ability:
    """What a vehicle can, and what is wanted of it."""

    near_m: float
    """Standing so near the end is to have arrived."""
    over_m: float
    """Standing for good within this is to have arrived, as near as it gets; farther beside it is astray."""
    speed: float
    acceleration: float
    gives_up_s: float
    """How long it goes on by itself when it hears us no more."""
    reverses: bool
    """It drives backwards if told so."""


@dataclass(frozen=True)
class Steer:
    """What it is told to do now."""

    heading: float
    speed: float = 0.0
    """Backwards if negative; 0 to turn on the spot."""
    stand: bool = False
    """Neither to drive nor to turn."""


class StraightDrive:
    """A straight to `end` along the line from `start`.

    Parameters
    ----------
    coast_s
        How long it rolls on at its speed once it is told to stop; learnt at each stop, see `coast_s`.
    """

    def __init__(
        self, start: Point, end: Point, now_s: float, *, ability: Ability, coast_s: float, patience: Patience
    ) -> None:
        self._start, self._end, self._line = start, end, (start, end)
        self._ability, self._patience = ability, patience
        self.coast_s = coast_s
        self.why = ""
        """What is wrong, once it is blocked."""
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
        self._asked, self._asked_s = 0.0, now_s

    def judge(self, here: Pose, *, speed: float, still: bool, now_s: float) -> DriveVerdict:
        """Whether the vehicle has arrived or will not; else `steer` says what it is to do."""
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
        """It stood or was not seen for a while, which is not its fault."""
        self._progress_s = self._moved_s = self._turn_s = now_s
        self._still_since = None
        self._phase, self._least_off = "turning", math.inf

    def _note(self, here: Pose, still: bool, now_s: float) -> None:
        """When it last moved, and when it last came nearer."""
        self._still_since = (now_s if self._still_since is None else self._still_since) if still else None
        away = math.dist((here.x, here.y), self._end)
        if away < self._nearest - PROGRESS_M:
            self._nearest, self._progress_s = away, now_s
        before = self._seen
        if before is None or math.dist((before.x, before.y), (here.x, here.y)) > PROGRESS_M:
            self._seen, self._moved_s = here, now_s

    def _wrong(self, here: Pose, now_s: float) -> str:
        place = (here.x, here.y)
        beside, away = math.dist(place, foot(*self._line, place)), math.dist(place, self._end)
        if min(beside, away) > self._ability.over_m:
            return f"the vehicle is {beside:.2f} m beside the way; drive it back there by hand"
        if self._phase == "driving" and now_s - self._moved_s >= self._patience.stalled_s:
            return f"the vehicle stands {away:.2f} m from where it was sent, and does not go on"
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
            self._asked, self._asked_s = 0.0, now_s

    def _turns_less_backwards(self, here: Pose) -> bool:
        """Whether it is nearer to drive there backwards: only ever back to a place just passed."""
        if not self._ability.reverses or math.dist((here.x, here.y), self._end) > self._ability.over_m:
            return False
        bearing = math.atan2(self._end[1] - here.y, self._end[0] - here.x)
        return abs(math.remainder(bearing - here.heading, math.tau)) > math.pi / 2

    # Driving

    def _drive(self, here: Pose, speed: float, now_s: float) -> None:
        left, beside = self._left_and_beside(here)
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
        wanted = min(self._speed(left, abs(beside)), max(CREEP_M_S, self._asked + self._faster(now_s)))
        self._asked, self._asked_s = wanted, now_s
        self.steer = Steer(heading, -wanted if self._backwards else wanted)

    def _speed(self, left: float, beside: float) -> float:
        """So fast that it stops at the end, also if it hears us no more; slowly beside the line."""
        ability, brake = self._ability, BRAKES * self._ability.acceleration
        stops = _fastest(left, brake=brake, after_s=self.coast_s)
        alone_s = ability.gives_up_s + HEARD_S + self.coast_s
        gives_up = _fastest(left + OVERRUN_M, brake=ability.acceleration, after_s=alone_s)
        most = min(ability.speed, stops, gives_up, SLOWLY_M_S if beside > BESIDE_M else math.inf)
        return max(most, self._floor)

    def _faster(self, now_s: float) -> float:
        """By how much it may be asked to be faster than a moment ago: else it overshoots."""
        return BRAKES * self._ability.acceleration * min(1.0, now_s - self._asked_s)

    def _heading(self, here: Pose) -> float:
        """Along the line, and back to it if it is beside."""
        left, beside = self._left_and_beside(here)
        (ax, ay), (bx, by) = self._line
        aside = math.atan2(-beside, LOOK_AHEAD_M) if left > 0 else 0.0
        aside = max(-MOST_ASIDE_RAD, min(MOST_ASIDE_RAD, aside))
        along = math.atan2(by - ay, bx - ax)
        return along + aside + (math.pi if self._backwards else 0.0)

    def _left_and_beside(self, here: Pose) -> tuple[float, float]:
        """Metres that are left along the line, and to its left."""
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
        self._learn(here)
        away = math.dist((here.x, here.y), self._end)
        if away <= self._ability.near_m or (self._tries >= TRIES and away <= self._ability.over_m):
            return "arrived"
        if self._tries >= TRIES:
            self.why = f"the vehicle stands {away:.2f} m from where it was sent, after {TRIES} more tries"
            return "blocked"
        self._go_again(here, now_s)
        return "going"

    def _learn(self, here: Pose) -> None:
        """How long it rolled on after it was told to stop."""
        if self._stop_at is not None and self._stop_at[1] > CREEP_M_S / 2:
            place, speed = self._stop_at
            rolled_s = math.dist(place, (here.x, here.y)) / speed
            self.coast_s += 0.5 * (max(0.05, min(2.0, rolled_s)) - self.coast_s)
        self._stop_at = None

    def _go_again(self, here: Pose, now_s: float) -> None:
        """The last bit once more: straight there, forwards or backwards."""
        self._tries += 1
        self._line = ((here.x, here.y), self._end)
        self._backwards = self._turns_less_backwards(here)
        self._phase, self._turn_s, self._least_off = "turning", now_s, math.inf
        self._nearest, self._progress_s = math.inf, now_s


def _fastest(left: float, *, brake: float, after_s: float) -> float:
    """The speed from which it stops within `left` metres, braking after so many seconds."""
    return math.sqrt((brake * after_s) ** 2 + 2 * brake * max(0.0, left)) - brake * after_s
