"""Parts of a log that a jump of the poses, hidden in a time without poses, may have shifted.

After such a jump each standstill lies off by the same vector. A stop is not denied if one vector brings a
standstill onto it, and every other standstill of the same part onto a stop. The fit of a log to its stops
spreads such a jump: the part before it is shifted too, and both are turned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.frames.rigid_fit import least_squares
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.run_log import Track
from stopgo.mission.run.tolerance import is_outside
from stopgo.recordings.replay.jumps import LEAST_CORRECTION_M, MISSING_STEPS
from stopgo.recordings.replay.matching import REACH_M, Match, long_enough
from stopgo.recordings.replay.replayed import Replay

FASTER = 1.5
"""Speed in a time without poses, as a multiple of the mission's, up to which the robot may have driven."""
SLACK_NS = 10**9
"""Time between a standstill and a time without poses within which they are neighbours."""


@dataclass(frozen=True, eq=False)
class _Part:
    """Standstills between two times without poses, and how the poses came there."""

    matches: list[Match]
    xy: FloatArray
    """Positions of the standstills (n, 2)."""
    step: FloatArray
    """Vector from the pose before to the pose after the time without poses (2,)."""
    seconds: float


def may_be_shifted(replay: Replay, number: int, unsure_m: float) -> bool:
    """True if the shift of a part of the log may have kept the robot's standstill off a stop.

    `unsure_m` is the uncertainty of positions.
    """
    stop, least_m = replay.mission.stops[number], 0.0 if _is_fitted(replay) else LEAST_CORRECTION_M
    for part in _parts(replay):
        driven_m = FASTER * replay.mission.robot.speed * part.seconds
        for k, xy in _motions(replay, part, stop):
            shift = part.xy[k] - xy[k]
            hidden = least_m < math.hypot(*shift) <= REACH_M and math.hypot(*(part.step - shift)) <= driven_m
            if hidden and _is_on(stop, xy[k], unsure_m) and _explains(replay, part, xy, unsure_m):
                return True
    return False


def across_a_jump(track: Track, match: Match, after: Match) -> bool:
    """True if a hidden jump may part two standstills that were one."""
    at = hiding_steps(track)
    ends = np.abs(track.ns[at] - match.standstill.end_ns) <= SLACK_NS
    begins = np.abs(track.ns[at + 1] - after.standstill.begin_ns) <= SLACK_NS
    return bool((ends & begins).any())


def hiding_steps(track: Track) -> IntArray:
    """Return the indices of the steps between poses in which some are missing and the position changed."""
    if len(track) < 2:
        return np.empty(0, np.int64)
    steps, far = np.diff(track.ns), np.hypot(*np.diff(track.xy, axis=0).T) > LEAST_CORRECTION_M
    return np.flatnonzero((steps > MISSING_STEPS * np.median(steps)) & far)


def _parts(replay: Replay) -> Iterator[_Part]:
    """Yield the parts of a log that a hidden jump may have shifted."""
    track = replay.run.poses
    at = hiding_steps(track)
    if not len(at):
        return
    edges = [0, *track.ns[at + 1].tolist(), int(track.ns[-1]) + 1]
    for k, (begin, end) in enumerate(pairwise(edges)):
        found = [match for match in replay.matches if begin <= _middle_ns(match) < end]
        if not found or (k == 0 and not _is_fitted(replay)):
            continue
        one = int(at[max(k - 1, 0)])
        step = (track.xy[one + 1] - track.xy[one]) * (1 if k else -1)
        seconds = float(track.ns[one + 1] - track.ns[one]) / 1e9
        yield _Part(found, np.array([match.standstill.xy for match in found]), step, seconds)


def _motions(replay: Replay, part: _Part, stop: Stop) -> Iterator[tuple[int, FloatArray]]:
    """Yield motions of a part that may bring a long standstill onto a stop: its index, and all positions."""
    whole = [k for k, match in enumerate(part.matches) if long_enough(match.standstill, stop)]
    for k in whole:
        yield k, part.xy - (part.xy[k] - (stop.x, stop.y))
    paired = [k for k, match in enumerate(part.matches) if match.stop is not None]
    if len(paired) > 1 and _is_fitted(replay):
        stops = replay.mission.stops
        there = [stops[part.matches[k].stop or 0] for k in paired]
        partners = np.array([(one.x, one.y) for one in there])
        moved = least_squares(part.xy[paired], partners, np.ones(len(paired))).points(part.xy)
        yield from ((k, moved) for k in whole)


def _explains(replay: Replay, part: _Part, xy: FloatArray, unsure_m: float) -> bool:
    """True if each standstill of a part that was matched with a stop lies on one at its moved position."""
    return all(
        any(_is_on(stop, position, unsure_m) for stop in replay.mission.stops)
        for match, position in zip(part.matches, xy, strict=True)
        if match.stop is not None
    )


def _is_on(stop: Stop, xy: FloatArray, unsure_m: float) -> bool:
    return not is_outside(math.dist(xy, (stop.x, stop.y)) - unsure_m, stop.tolerance_m)


def _is_fitted(replay: Replay) -> bool:
    alignment = replay.run.alignment
    return alignment is not None and alignment.residual_rms_m is not None


def _middle_ns(match: Match) -> int:
    return (match.standstill.begin_ns + match.standstill.end_ns) // 2
