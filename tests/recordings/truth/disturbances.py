"""A robot's log of a drive: its poses with every disturbance that logs of the field have.

The error of each pose and its true time stay known, so that an oracle can say what a log can decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from stopgo.mission.geometry import FloatArray, IntArray
from tests.recordings.replay.driving import BEGIN_NS
from tests.recordings.truth.drives import Tour

HZ = 10.0


@dataclass(frozen=True, eq=False)
class Sensed:
    """Poses in the order of writing, in the mission's frame; `placed` moves them to the log's."""

    true_s: FloatArray
    """True seconds of each pose (n,); no log contains them."""
    ns: IntArray
    """Stamps (n,)."""
    xy: FloatArray
    heading: FloatArray
    height: FloatArray
    error_m: FloatArray
    """Distance of each pose from the truth (n,)."""
    tied: bool = True
    """True if the frame is tied to the site: a map, or the earth."""
    headless: bool = False
    """True if the log contains no headings."""

    def rows(self, kept: np.ndarray) -> Sensed:
        """Return the poses of a mask, or in an order."""
        names = ("true_s", "ns", "xy", "heading", "height", "error_m")
        return replace(self, **{name: getattr(self, name)[kept] for name in names})

    def moved(self, by: FloatArray) -> Sensed:
        """Return poses with an error (n, 2) added."""
        return replace(self, xy=self.xy + by, error_m=self.error_m + np.hypot(*by.T))


def sensed(tour: Tour, hz: float = HZ) -> Sensed:
    """Return the poses of a drive at a rate, without any error."""
    rows = np.array(tour.drive.rows)
    if hz != HZ:
        seconds = np.arange(0.0, rows[-1, 0], 1 / hz)
        columns = [rows[:, 1], rows[:, 2], np.unwrap(rows[:, 3])]
        rows = np.column_stack([seconds, *(np.interp(seconds, rows[:, 0], column) for column in columns)])
    ns = BEGIN_NS + np.rint(rows[:, 0] * 1e9).astype(np.int64)
    height = tour.height(rows[:, 0])
    return Sensed(rows[:, 0], ns, rows[:, 1:3], rows[:, 3], height, np.zeros(len(rows)))


Sense = Callable[[Tour, np.random.Generator], Sensed]


def clean(tour: Tour, chance: np.random.Generator) -> Sensed:
    return sensed(tour)


def noisy(tour: Tour, chance: np.random.Generator) -> Sensed:
    """10 mm of noise in each pose, and 0.01 rad."""
    poses = sensed(tour)
    moved = replace(poses, xy=poses.xy + chance.normal(0, 0.01, poses.xy.shape))
    return replace(moved, heading=poses.heading + chance.normal(0, 0.01, len(poses.ns)))


def very_noisy(tour: Tour, chance: np.random.Generator) -> Sensed:
    """40 mm of noise in each pose; their mean at a standstill is still good."""
    poses = sensed(tour)
    return replace(poses, xy=poses.xy + chance.normal(0, 0.04, poses.xy.shape))


def wandering_noise(tour: Tour, chance: np.random.Generator) -> Sensed:
    """An error of 15 mm that wanders over minutes, as of a matched map."""
    poses = sensed(tour)
    times = np.arange(0, poses.true_s[-1] + 60, 30)
    by = chance.normal(0, 0.015, (len(times), 2))
    return poses.moved(np.stack([np.interp(poses.true_s, times, column) for column in by.T], axis=-1))


def _gap(poses: Sensed, begin_s: float, end_s: float) -> Sensed:
    return poses.rows((poses.true_s < begin_s) | (poses.true_s > end_s))


def gap_on_the_way(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Half of the way between two standstills is missing."""
    halts = tour.drive.halts
    k = int(chance.integers(len(halts) - 1))
    begin, end = halts[k].end_s, halts[k + 1].begin_s
    return _gap(sensed(tour), begin + 0.25 * (end - begin), end - 0.25 * (end - begin))


def gap_at_a_halt(tour: Tour, chance: np.random.Generator) -> Sensed:
    """One standstill is missing, and a little before and after."""
    halt = tour.drive.halts[int(chance.integers(len(tour.drive.halts)))]
    return _gap(sensed(tour), halt.begin_s - 2, halt.end_s + 2)


def gap_within_a_halt(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The middle of one standstill is missing; the robot did not move meanwhile."""
    halt = tour.drive.halts[int(chance.integers(len(tour.drive.halts)))]
    return _gap(sensed(tour), halt.begin_s + 3, halt.end_s - 3)


def long_gap(tour: Tour, chance: np.random.Generator) -> Sensed:
    """A third of the run is missing."""
    end = tour.drive.seconds
    begin = chance.uniform(0.1, 0.55) * end
    return _gap(sensed(tour), begin, begin + end / 3)


def late_begin(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The log begins after two or three standstills."""
    halts = tour.drive.halts
    return _gap(sensed(tour), -1, halts[min(int(chance.integers(1, 3)), len(halts) - 1)].end_s + 1)


def early_end(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The log ends in the middle of the run."""
    return _gap(sensed(tour), chance.uniform(0.4, 0.8) * tour.drive.seconds, math.inf)


def ends_in_last_halt(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The log ends 4 s after the robot reached its last standstill."""
    return _gap(sensed(tour), tour.drive.halts[-1].begin_s + 4, math.inf)


def _stepped(tour: Tour, chance: np.random.Generator, step_s: float) -> Sensed:
    poses = sensed(tour)
    at = chance.uniform(0.1, 0.9) * tour.drive.seconds
    return replace(poses, ns=poses.ns + np.where(poses.true_s > at, round(step_s * 1e9), 0))


def clock_back_an_hour(tour: Tour, chance: np.random.Generator) -> Sensed:
    return _stepped(tour, chance, -3600)


def clock_back_two_minutes(tour: Tour, chance: np.random.Generator) -> Sensed:
    return _stepped(tour, chance, -120)


def clock_back_five_seconds(tour: Tour, chance: np.random.Generator) -> Sensed:
    return _stepped(tour, chance, -5)


def clock_ahead_an_hour(tour: Tour, chance: np.random.Generator) -> Sensed:
    return _stepped(tour, chance, 3600)


def clock_ahead_ten_seconds(tour: Tour, chance: np.random.Generator) -> Sensed:
    """As long as a scan, and in the middle of a way."""
    poses, halts = sensed(tour), tour.drive.halts
    k = int(chance.integers(len(halts) - 1))
    at = (halts[k].end_s + halts[k + 1].begin_s) / 2
    return replace(poses, ns=poses.ns + np.where(poses.true_s > at, 10 * 10**9, 0))


def clock_back_and_ahead(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The clock is set back by an hour, and a minute later forward again."""
    poses = sensed(tour)
    at = chance.uniform(0.1, 0.6) * tour.drive.seconds
    wrong = (poses.true_s > at) & (poses.true_s < at + 60)
    return replace(poses, ns=poses.ns - np.where(wrong, 3600 * 10**9, 0))


def clock_ahead_in_a_halt(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The clock is set forward by about as long as a scan in the middle of the shortest standstill."""
    poses = sensed(tour)
    halt = min(tour.drive.halts, key=lambda halt: halt.end_s - halt.begin_s)
    at, step_s = (halt.begin_s + halt.end_s) / 2, chance.uniform(8, 20)
    return replace(poses, ns=poses.ns + np.where(poses.true_s > at, round(step_s * 1e9), 0))


def jump_in_a_gap(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The localisation jumps 0.2 to 0.8 m aside for good, in 2 to 8 s without poses.

    Half of these times begin at a standstill, the others anywhere.
    """
    poses, halts = sensed(tour), tour.drive.halts
    at = float(chance.uniform(0.1, 0.9) * tour.drive.seconds)
    if chance.random() < 0.5:
        halt = halts[int(chance.integers(len(halts)))]
        at = float(chance.uniform(halt.begin_s, halt.end_s))
    turn, far = chance.uniform(0, math.tau), chance.uniform(0.2, 0.8)
    by = np.where(poses.true_s > at, far, 0.0)[:, None] * (math.cos(turn), math.sin(turn))
    return _gap(poses.moved(by), at, at + chance.uniform(2, 8))


def drifting(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Odometry that is 1 % too long and bends by 0.001 rad a metre."""
    return _drifted(tour, 0.01)


def drifting_less(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Odometry that is 0.3 % too long, and bends."""
    return _drifted(tour, 0.003)


def drifting_hardly(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Odometry that is 0.02 % too long."""
    return _drifted(tour, 0.0002)


def _drifted(tour: Tour, slip: float) -> Sensed:
    poses = sensed(tour)
    step = np.diff(poses.xy, axis=0)
    turn = slip * 0.1 * np.concatenate([[0.0], np.cumsum(np.hypot(*step.T))])
    cos, sin = np.cos(turn[1:]), np.sin(turn[1:])
    bent = (1 + slip) * np.stack(
        [cos * step[:, 0] - sin * step[:, 1], sin * step[:, 0] + cos * step[:, 1]], axis=-1
    )
    xy = np.concatenate([poses.xy[:1], poses.xy[:1] + np.cumsum(bent, axis=0)])
    found = replace(poses.moved(xy - poses.xy), heading=poses.heading + turn)
    return replace(found, tied=False)


def odometry_restarts(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The odometry begins at 0, 0, 0 again in the middle of a way, where the robot was restarted."""
    poses, halts = sensed(tour), tour.drive.halts
    k = int(chance.integers(len(halts) - 1))
    at = int(np.searchsorted(poses.true_s, (halts[k].end_s + halts[k + 1].begin_s) / 2))
    turn = -poses.heading[at]
    cos, sin = math.cos(turn), math.sin(turn)
    after = (poses.xy[at:] - poses.xy[at]) @ np.array([[cos, sin], [-sin, cos]])
    xy = np.concatenate([poses.xy[:at], after])
    heading = np.concatenate([poses.heading[:at], poses.heading[at:] + turn])
    return replace(poses.moved(xy - poses.xy), heading=heading, tied=False)


def jumps(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The localisation jumps 0.4 m aside three times, for 2 s each."""
    poses = sensed(tour)
    by = np.zeros(poses.xy.shape)
    for at in chance.uniform(0, tour.drive.seconds, 3):
        there = (poses.true_s > at) & (poses.true_s < at + 2)
        by[there] = 0.4 * np.array([math.cos(at), math.sin(at)])
    return poses.moved(by)


def wild_poses(tour: Tour, chance: np.random.Generator) -> Sensed:
    """One pose of a hundred lies anywhere, or is not a number."""
    poses = sensed(tour)
    by = np.zeros(poses.xy.shape)
    wild = chance.random(len(by)) < 0.01
    by[wild] = chance.uniform(-50, 50, (int(wild.sum()), 2))
    by[wild & (chance.random(len(by)) < 0.3)] = np.nan
    return replace(poses, xy=poses.xy + by)


def map_shifted(tour: Tour, chance: np.random.Generator) -> Sensed:
    """The whole map lies 0.15 m off the drawing."""
    turn = chance.uniform(0, math.tau)
    poses = sensed(tour)
    return poses.moved(np.full(poses.xy.shape, 1.0) * (0.15 * math.cos(turn), 0.15 * math.sin(turn)))


def fifth_hz(tour: Tour, chance: np.random.Generator) -> Sensed:
    """A pose each 5 s."""
    return sensed(tour, 0.2)


def one_hz(tour: Tour, chance: np.random.Generator) -> Sensed:
    return sensed(tour, 1.0)


def two_hundred_hz(tour: Tour, chance: np.random.Generator) -> Sensed:
    return sensed(tour, 200.0)


def dropping(tour: Tour, chance: np.random.Generator) -> Sensed:
    """A third of the messages is lost."""
    poses = sensed(tour)
    return poses.rows(chance.random(len(poses.ns)) > 0.33)


def only_when_moving(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Poses are written only when the robot has moved."""
    poses = sensed(tour)
    moved = np.hypot(*np.diff(poses.xy, axis=0, prepend=poses.xy[:1] - 1).T) > 1e-6
    turned = np.abs(np.diff(poses.heading, prepend=9)) > 1e-6
    return poses.rows(moved | turned)


def out_of_order(tour: Tour, chance: np.random.Generator) -> Sensed:
    """Messages are written in another order within half a second, some of them twice."""
    poses = sensed(tour)
    order = np.argsort(poses.true_s + chance.uniform(0, 0.5, len(poses.ns)), kind="stable")
    return poses.rows(np.repeat(order, 1 + (chance.random(len(order)) < 0.1)))


def without_headings(tour: Tour, chance: np.random.Generator) -> Sensed:
    return replace(sensed(tour), headless=True)


SENSES: tuple[Sense, ...] = (
    clean,
    noisy,
    very_noisy,
    wandering_noise,
    gap_on_the_way,
    gap_at_a_halt,
    gap_within_a_halt,
    long_gap,
    late_begin,
    early_end,
    ends_in_last_halt,
    clock_back_an_hour,
    clock_back_two_minutes,
    clock_back_five_seconds,
    clock_ahead_an_hour,
    clock_ahead_ten_seconds,
    clock_back_and_ahead,
    clock_ahead_in_a_halt,
    jump_in_a_gap,
    drifting,
    drifting_less,
    drifting_hardly,
    odometry_restarts,
    jumps,
    wild_poses,
    map_shifted,
    fifth_hz,
    one_hz,
    two_hundred_hz,
    dropping,
    only_when_moving,
    out_of_order,
    without_headings,
)
SLOW: frozenset[Sense] = frozenset({two_hundred_hz})
"""Those that would make a log of a slow format large."""
