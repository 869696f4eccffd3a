"""Evidence of a log for and against each stop: yes, no or undecided, with the reason.

Yes needs poses within tolerance whose own uncertainty is below it. No needs poses that show the robot
elsewhere all the time. Gaps, a log that begins late or ends early, and drift leave it open.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.document import Stop
from stopgo.mission.geometry import FloatArray, IntArray
from stopgo.mission.run.run_log import Track
from stopgo.recordings.logs.own import SITE
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.matching import REACH_M, Match, least_stay_s, long_enough
from stopgo.recordings.replay.replayed import Replay

LEAST_GAP_S = 1.0
"""Time without poses from which on the robot was not seen."""
BROKEN_NS = 3 * 10**9
"""Longest break between two standstills at one stop that jumping poses may have made."""
LEVEL_M = 2.0
"""Difference of heights above which a stop is on another level."""
START_NS = 2 * 10**9
"""Time from the begin of a log whose height is the start's."""
NEIGHBOURS = 4
"""Number of visits around a stop whose common offset is its uncertainty."""


@dataclass(frozen=True)
class StopEvidence:
    """Answer for one stop, with the reason if it is undecided."""

    item: StopComparison
    answer: Certainty
    why: str = ""


def stop_evidence(replay: Replay) -> tuple[StopEvidence, ...]:
    """Return the evidence for each stop, in the mission's order."""
    unsure = uncertainties(replay)
    return tuple(_evidence(replay, k, item, unsure[k]) for k, item in enumerate(replay.comparison.asked))


def _evidence(replay: Replay, number: int, item: StopComparison, unsure_m: float) -> StopEvidence:
    if item.outcome not in DONE:
        why = _unseen(replay, number, item) if replay.inferred else ""
        return StopEvidence(item, "unknown" if why else "no", why)
    if item.deviation_m is None:
        return StopEvidence(item, "unknown", "no pose in the log; the robot's own log may have it")
    if unsure_m > (item.tolerance_m or 0.0):
        return StopEvidence(item, "unknown", DRIFTS)
    climbed_m = climb_m(replay, number)
    if abs(climbed_m) > LEVEL_M and not item.outside_text:
        where = f"{abs(climbed_m):.1f} m {'higher' if climbed_m > 0 else 'lower'} than at the start"
        return StopEvidence(item, "unknown", f"the robot was {where}; give a log of its storey")
    return StopEvidence(item, "no" if item.outside_text else "yes")


def climb_m(replay: Replay, stop: int) -> float:
    """Return the height of the last standstill at a stop over the begin of the log; 0 where it has none."""
    source, standstills = replay.placed.source, replay.at(stop)
    if source.height is None or not standstills or not np.isfinite(source.height).any():
        return 0.0
    offset = replay.placed.alignment.time_offset_ns
    standstill = standstills[-1].standstill
    there = (source.ns + offset >= standstill.begin_ns) & (source.ns + offset <= standstill.end_ns)
    start = source.ns <= source.ns[0] + START_NS
    heights = [source.height[mask & np.isfinite(source.height)] for mask in (start, there)]
    if not all(len(values) for values in heights):
        return 0.0
    return float(np.median(heights[1]) - np.median(heights[0]))


DRIFTS = "the poses drift by more than the tolerance; give poses matched to a map, or a scan at the stop"


def _unseen(replay: Replay, number: int, item: StopComparison) -> str:
    """Return why a visit could have happened unseen; empty if the robot was elsewhere all the time."""
    stop, track = replay.mission.stops[number], replay.run.poses
    if not len(track):
        return ""
    before = [match for match in replay.matches if match.stop is not None and match.stop < number]
    after = [match for match in replay.matches if match.stop is not None and match.stop > number]
    at = [match for match in replay.matches if match.stop == number]
    if not after and not at:
        return "" if _over(replay) else "the log ends before; give a log that continues"
    if not before and not at and _begins_late(replay):
        return "the log begins after the start of the mission; give an earlier log"
    longer = _possibly_longer(track, at, least_stay_s(stop))
    return longer or _unseen_between(replay, item, stop, before, after)


def _unseen_between(
    replay: Replay, item: StopComparison, stop: Stop, before: Sequence[Match], after: Sequence[Match]
) -> str:
    """Return why a visit between those before and after could have happened unseen; empty if it did not."""
    track = replay.run.poses
    begin = max((match.standstill.end_ns for match in before), default=int(track.ns[0]))
    end = min((match.standstill.begin_ns for match in after), default=int(track.ns[-1]))
    longest_s = longest_gap_s(track, begin, max(begin, end))
    if longest_s >= max(LEAST_GAP_S, least_stay_s(stop)):
        return f"{longest_s:.0f} s without poses on the path; give another source of poses"
    return DRIFTS if item.outcome == "skipped" and _may_have_drifted(replay, stop, begin, end) else ""


def _possibly_longer(track: Track, at: Sequence[Match], least_s: float) -> str:
    """Return why a standstill may have been longer than the log shows; empty if it was not."""
    slack_ns = int(LEAST_GAP_S * 1e9)
    if any(match.standstill.end_ns + slack_ns >= track.ns[-1] for match in at):
        return "the log ends while the robot is stationary there; give a log that continues"
    if any(match.standstill.begin_ns - slack_ns <= track.ns[0] for match in at):
        return "the log begins while the robot is stationary there; give an earlier log"
    begin_ns = None
    for one, other in pairwise(at):
        broken = other.standstill.begin_ns - one.standstill.end_ns <= BROKEN_NS
        begin_ns = (begin_ns or one.standstill.begin_ns) if broken else None
        if begin_ns is not None and (other.standstill.end_ns - begin_ns) / 1e9 >= least_s:
            return "its poses jump while it is stationary; give another source of poses"
    if any(possible_s(track, match) >= least_s for match in at):
        return "poses are too rare to measure the standstill; give another source of poses"
    return ""


def possible_s(track: Track, match: Match) -> float:
    """Return the longest time that a standstill may have taken: from the pose before it to that after."""
    before = int(np.searchsorted(track.ns, match.standstill.begin_ns)) - 1
    after = int(np.searchsorted(track.ns, match.standstill.end_ns, side="right"))
    begin, end = track.ns[max(before, 0)], track.ns[min(after, len(track) - 1)]
    return float(end - begin) / 1e9


def _over(replay: Replay) -> bool:
    """True if the log goes on until the robot has parked at the end of the return."""
    end = (replay.mission.return_ or ())[-1:]
    xy = replay.run.poses.xy[-1]
    return any(np.hypot(*(xy - point)) <= REACH_M for point in end)


def _begins_late(replay: Replay) -> bool:
    """True if the first pose is not at the mission's start."""
    start, xy = replay.mission.start, replay.run.poses.xy[0]
    return bool(np.hypot(*(xy - (start.x, start.y))) > REACH_M)


def _may_have_drifted(replay: Replay, stop: Stop, begin_ns: int, end_ns: int) -> bool:
    """True for a drifting source with a standstill on the way that was long enough, and at no stop."""
    return _drifts(replay) and any(
        match.stop is None
        and long_enough(match.standstill, stop)
        and begin_ns <= match.standstill.begin_ns <= end_ns
        for match in replay.matches
    )


def longest_gap_s(track: Track, begin_ns: int, end_ns: int) -> float:
    """Return the longest time without poses between two times."""
    inside = track.ns[(track.ns >= begin_ns) & (track.ns <= end_ns)]
    edges: IntArray = np.concatenate([[begin_ns], inside, [end_ns]])
    return float(np.diff(edges).max()) / 1e9


def uncertainties(replay: Replay) -> FloatArray:
    """Return the uncertainty of the position at each stop, metres (n,).

    Offsets of the visits around a stop that point to one side are drift, or its equal. What a fit leaves is
    uncertain too: its median, as few stops may really lie off.
    """
    stops = replay.mission.stops
    visits = _visits(replay)
    unsure = np.zeros(len(stops))
    if not _drifts(replay) or len(visits) < 2:
        return unsure
    offsets = {k: np.subtract(match.standstill.xy, (stops[k].x, stops[k].y)) for k, match in visits}
    fitted = replay.run.alignment is not None and replay.run.alignment.residual_rms_m is not None
    residual = float(np.median([np.hypot(*offset) for offset in offsets.values()])) if fitted else 0.0
    for k in range(len(stops)):
        near = sorted((other for other in offsets if other != k), key=lambda other: abs(other - k))
        common = np.median([offsets[other] for other in near[:NEIGHBOURS]], axis=0)
        unsure[k] = max(float(np.hypot(*common)), residual)
    return unsure


def _visits(replay: Replay) -> list[tuple[int, Match]]:
    """Return the last standstill at each visited stop, with the stop's index, in order of time."""
    last = {match.stop: match for match in replay.matches if match.stop is not None}
    return sorted(last.items(), key=lambda item: item[1].standstill.begin_ns)


def _drifts(replay: Replay) -> bool:
    """True for poses that nothing ties to the site: neither the earth, nor a map, nor stopgo itself."""
    placed = replay.placed
    tied = placed.by_earth or placed.source.frame in (SITE, "map", "world")
    return not tied


def apart_from_plan(replay: Replay) -> Iterator[str]:
    """Yield consecutive stops whose standstills are farther apart, or nearer, than drift can explain.

    Turning and shifting a log changes no distance: one of both stops was outside its tolerance.
    """
    stops = replay.mission.stops
    for (a, one), (b, other) in pairwise(_visits(replay)):
        planned = float(np.hypot(stops[a].x - stops[b].x, stops[a].y - stops[b].y))
        driven = float(np.hypot(*np.subtract(one.standstill.xy, other.standstill.xy)))
        path = replay.run.poses.between(one.standstill.end_ns, other.standstill.begin_ns).length_m
        allowed = stops[a].tolerance_m + stops[b].tolerance_m + STRETCH * max(planned, path)
        if abs(driven - planned) > allowed:
            yield (
                f"{stops[a].id} and {stops[b].id}: {driven:.2f} m apart, {planned:.2f} m planned; "
                "no drift explains that"
            )
