"""Visits that may have happened unseen: in a gap, before or after the log, or while poses jump."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from stopgo.mission.document import Stop
from stopgo.mission.geometry import BoolArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.clock_steps import longest_usual_ns
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.jumps import lasting_jump
from stopgo.recordings.replay.matching import REACH_M, Match, least_stay_s, long_enough
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.shifted_parts import across_a_jump

SIGMAS = 2.0
LEAST_GAP_S = 1.0
"""Time without poses from which on the robot was not seen."""
BROKEN_NS = 6 * 10**9
"""Longest break between two standstills at one stop that jumping poses may have made."""
FASTER = 1.5
"""Speed in a gap, as a multiple of the mission's, up to which a robot may have driven to a stop and back."""


def why_unseen(
    replay: Replay,
    number: int,
    unsure_m: float,
    *,
    noise_m: float = 0.0,
    halted: bool = False,
    drifts: bool = False,
) -> str:
    """Return why a good visit of a stop may have happened unseen; empty if the poses exclude one.

    Stops may be visited in any order, so that every gap counts that is long enough to drive there, scan and
    drive on. `unsure_m` is the uncertainty of positions. `halted`: the robot was at standstill near it
    for long enough, so that only its shorter standstills within tolerance count. `noise_m`: standard
    deviation of a pose. `drifts`: a standstill at no stop may have been there.
    """
    stop, track = replay.mission.stops[number], replay.run.poses
    if not len(track):
        return ""
    there = [match for match in replay.matches if match.stop == number]
    if halted:
        near_m = stop.tolerance_m + unsure_m
        there = [
            match for match in there if match.away_m <= near_m and not long_enough(match.standstill, stop)
        ]
    reasons = (
        _possibly_longer(track, there, stop) or _across_a_step(replay, there),
        _across_a_jump(replay, stop, unsure_m),
        _in_a_gap(replay, stop, unsure_m + SIGMAS * noise_m),
        _before_or_after(replay),
        _after_a_jump(track),
        _elsewhere_by_drift(replay, stop, unsure_m, drifts=drifts),
    )
    return next((reason for reason in reasons if reason), "")


def _possibly_longer(track: Track, at: Sequence[Match], stop: Stop) -> str:
    """Return why a standstill may have been longer than the log shows; empty if it was not."""
    slack_ns, least_s = int(LEAST_GAP_S * 1e9), least_stay_s(stop)
    if any(match.standstill.end_ns + slack_ns >= track.ns[-1] for match in at):
        return "the log ends while the robot is stationary there; give a log that continues"
    if any(match.standstill.begin_ns - slack_ns <= track.ns[0] for match in at):
        return "the log begins while the robot is stationary there; give an earlier log"
    begin_ns = None
    for one, other in pairwise(at):
        broken = other.standstill.begin_ns - one.standstill.end_ns <= BROKEN_NS
        begin_ns = (begin_ns or one.standstill.begin_ns) if broken else None
        if begin_ns is not None and (other.standstill.end_ns - begin_ns) / 1e9 >= least_s:
            return JUMPS
    for match in at:
        if _until_a_jump_s(track, match) >= least_s:
            return JUMPS
        if possible_s(track, match) >= least_s:
            return "poses are too rare to measure the standstill; give another source of poses"
    return ""


def _across_a_step(replay: Replay, at: Sequence[Match]) -> str:
    """Return whether the clock was set during a standstill: it may have been longer than the log shows."""
    slack_ns, offset_ns = int(LEAST_GAP_S * 1e9), replay.placed.alignment.time_offset_ns
    steps = [ns + offset_ns for ns in replay.placed.source.steps_ns]
    spans = [(item.standstill.begin_ns - slack_ns, item.standstill.end_ns + slack_ns) for item in at]
    stepped = any(begin <= ns <= end for ns in steps for begin, end in spans)
    return "the clock was set while it was stationary; give a log with another clock" if stepped else ""


def _across_a_jump(replay: Replay, stop: Stop, unsure_m: float) -> str:
    """Return whether a jump in a time without poses parts a standstill at a stop from the next one."""
    for one, other in pairwise(replay.matches):
        near_m = min(math.dist(match.standstill.xy, (stop.x, stop.y)) for match in (one, other))
        seconds = (other.standstill.end_ns - one.standstill.begin_ns) / 1e9
        whole = near_m <= stop.tolerance_m + unsure_m and seconds >= least_stay_s(stop)
        if whole and across_a_jump(replay.run.poses, one, other):
            return "a time without poses may hide a jump at its standstill; give another source of poses"
    return ""


def why_shorter(replay: Replay, number: int) -> str:
    """Return why the standstills at a stop may have been shorter than the log shows; empty if one was not.

    In a log without another clock, a time without poses may be the clock that was set forward. A log that
    shows most standstills by hardly any pose is of a robot that writes none while it stands.
    """
    if replay.placed.source.own_clock or not replay.inferred:
        return ""
    stop, track = replay.mission.stops[number], replay.run.poses
    seen_s = {id(match): _seen_s(track, match) for match in replay.matches}
    fractions = [seen_s[id(match)] / match.standstill.seconds for match in replay.matches]
    whole = [match for match in replay.at(number) if long_enough(match.standstill, stop)]
    if float(np.median(fractions)) < MOSTLY_SEEN or not whole:
        return ""
    seen = max(seen_s[id(match)] for match in whole)
    return "" if seen >= least_stay_s(stop) else SET_FORWARD.format(seen)


MOSTLY_SEEN = 0.5
"""Fraction of the usual standstill that its poses show, above which a robot writes poses while it stands."""
SET_FORWARD = (
    "its poses show {:.1f} s of standstill; the rest may be a clock that was set forward; "
    "give a log with another clock"
)


def _seen_s(track: Track, match: Match) -> float:
    """Return the time of a standstill without the times without poses in it."""
    steps = np.diff(track.between(match.standstill.begin_ns, match.standstill.end_ns).ns)
    usual = int(np.median(np.diff(track.ns)))
    return float(steps[steps <= longest_usual_ns(usual)].sum()) / 1e9


JUMPS = "its poses jump while it is stationary; give another source of poses"


def possible_s(track: Track, match: Match) -> float:
    """Return the longest time that a standstill may have taken: from the pose before it to that after.

    A gap that begins within a second, while the robot is still there, counts as part of it.
    """
    slack_ns = int(LEAST_GAP_S * 1e9)
    before = int(np.searchsorted(track.ns, match.standstill.begin_ns)) - 1
    after = int(np.searchsorted(track.ns, match.standstill.end_ns, side="right"))
    there = np.hypot(*(track.xy - match.standstill.xy).T) <= NEAR_M
    gaps = np.flatnonzero(np.diff(track.ns) > slack_ns)
    ends = track.ns[gaps] - match.standstill.end_ns
    begins = match.standstill.begin_ns - track.ns[gaps + 1]
    for k in gaps[(ends > 0) & (ends <= slack_ns) & there[gaps]].tolist():
        after = max(after, k + 1)
    for k in gaps[(begins > 0) & (begins <= slack_ns) & there[gaps + 1]].tolist():
        before = min(before, k)
    begin, end = track.ns[max(before, 0)], track.ns[min(after, len(track) - 1)]
    return float(end - begin) / 1e9


def _until_a_jump_s(track: Track, match: Match) -> float:
    """Return the time around a standstill without any step of normal driving: jumps leave and come back."""
    edges = [match.standstill.begin_ns, match.standstill.end_ns]
    around = track.between(edges[0] - BROKEN_NS, edges[1] + BROKEN_NS)
    near = np.hypot(*(around.xy - match.standstill.xy).T) <= NEAR_M
    step = np.hypot(*np.diff(around.xy, axis=0).T) if len(around) > 1 else np.empty(0)
    jumped = np.flatnonzero((step > NEAR_M) & (step > FASTEST_M_S * np.diff(around.ns) / 1e9))
    if not len(jumped) or not near.any():
        return 0.0
    there = around.ns[near]
    return float(there[-1] - there[0]) / 1e9


NEAR_M, FASTEST_M_S = 0.1, 3.0
"""Distance within which poses are of one standstill, and speed above which a step is a jump."""


def _in_a_gap(replay: Replay, stop: Stop, unsure_m: float) -> str:
    """Return the longest time without poses in which the robot may have driven to the stop and scanned.

    Poses that are rare, and lie on the stop, interrupt no such time.
    """
    speed, track = FASTER * replay.mission.robot.speed, replay.run.poses
    reach, least_s = stop.tolerance_m + unsure_m, max(LEAST_GAP_S, least_stay_s(stop))
    away = np.hypot(*(track.xy - (stop.x, stop.y)).T)
    longest, joined = 0.0, False
    for seconds, begin, end in _unseen_times(track, away <= reach):
        drive_m = float(np.maximum(away[[begin, end]] - reach, 0.0).sum())
        if seconds >= least_s + drive_m / speed and seconds > longest:
            longest, joined = seconds, end > begin + 1
    if math.isinf(longest):
        return "the robot moved while it restarted; give another source of poses"
    few = "with too few poses there" if joined else "without poses on the path"
    return f"{longest:.0f} s {few}; give another source of poses" if longest else ""


MOVED_M = 0.5
"""Distance from the last pose before a restart to the first one after it, from which on it was moved."""


def _unseen_times(track: Track, there: BoolArray) -> Iterator[tuple[float, int, int]]:
    """Yield each step between poses longer than LEAST_GAP_S, joined where a pose between two is `there` (n,).

    Each is its seconds, and the indices of the poses before and after it.
    """
    seconds = np.diff(track.ns) / 1e9
    for restart_ns in track.restarts_ns:  # the time of a reboot is unknown, and the robot may have been moved
        k = int(np.searchsorted(track.ns, restart_ns)) - 1
        if 0 <= k < len(seconds) and math.dist(track.xy[k], track.xy[k + 1]) > MOVED_M:
            seconds[k] = math.inf
    begin, end, total = -1, -1, 0.0
    for k in np.flatnonzero(seconds > LEAST_GAP_S).tolist():
        if k == end and there[k]:
            total, end = total + float(seconds[k]), k + 1
            continue
        if total:
            yield total, begin, end
        begin, end, total = k, k + 1, float(seconds[k])
    if total:
        yield total, begin, end


def _before_or_after(replay: Replay) -> str:
    """Return whether the log begins after the run, or ends before it."""
    if not _over(replay):
        return "the log ends before; give a log that continues"
    blind_s = _blind_at_the_end_s(replay)
    if blind_s >= min(map(least_stay_s, replay.mission.stops)):
        return f"{blind_s:.0f} s without poses at the end of the log; give another source of poses"
    return BEGINS_LATE if _begins_late(replay) else ""


def _blind_at_the_end_s(replay: Replay) -> float:
    """Return the time from the last pose to the end of the log; 0 where a set clock hides it."""
    if replay.placed.source.steps_ns:
        return 0.0
    return (replay.log.end_ns + replay.placed.alignment.time_offset_ns - int(replay.run.poses.ns[-1])) / 1e9


BEGINS_LATE = "the log begins after the start of the mission; give an earlier log"


def _over(replay: Replay) -> bool:
    """True if the log goes on until the robot is back at the end of the return, or has parked near it.

    Without a return, the run is over when the robot has scanned at the last stop and stands nowhere else.
    """
    mission, end, track = replay.mission, (replay.mission.return_ or ())[-1:], replay.run.poses
    if end:
        away = float(np.hypot(*(track.xy[-1] - end[0])))
        parked = any(match.standstill.end_ns + PARKED_NS >= track.ns[-1] for match in replay.matches[-1:])
        return away <= REACH_M or (parked and away <= PARKED_M)
    last = len(mission.stops) - 1
    return any(
        match.stop == last and long_enough(match.standstill, mission.stops[last])
        for match in replay.matches[-1:]
    )


PARKED_M, PARKED_NS = 2.0, 10**9
"""Distance from the end of the return within which a robot has parked, and time to the end of the log."""


def _begins_late(replay: Replay) -> bool:
    """True if the first pose is not at the mission's start."""
    start, xy = replay.mission.start, replay.run.poses.xy[0]
    return bool(np.hypot(*(xy - (start.x, start.y))) > REACH_M)


def _after_a_jump(track: Track) -> str:
    jump = lasting_jump(track)
    if jump is None:
        return ""
    return f"the poses jump by {jump[1]:.1f} m and do not come back; give poses matched to a map"


def _elsewhere_by_drift(replay: Replay, stop: Stop, unsure_m: float, *, drifts: bool) -> str:
    """Return whether a long standstill at no stop may have been at this one, by unsure poses."""
    track = replay.run.poses
    for match in replay.matches:
        path_m = track.between(int(track.ns[0]), match.standstill.begin_ns).length_m if drifts else 0.0
        reach = stop.tolerance_m + 2 * unsure_m + STRETCH * path_m
        away = math.dist(match.standstill.xy, (stop.x, stop.y))
        if match.stop is None and away <= reach and possible_s(track, match) >= least_stay_s(stop):
            return DRIFTS
    return ""


DRIFTS = "the poses drift by more than the tolerance; give poses matched to a map, or a scan at the stop"
