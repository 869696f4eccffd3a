"""Evidence of a log for and against each stop: yes, no or undecided, with the reason.

Yes needs poses within tolerance, their own uncertainty included. No needs poses that show the robot elsewhere
all the time. Gaps, a log that begins late or ends early, jumps and drift leave it open.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.document import Point
from stopgo.mission.run.events import JUMPED_OVER, Aborted, Finished
from stopgo.mission.run.tolerance import is_outside
from stopgo.recordings.logs.telemetry_log import FORMAT
from stopgo.recordings.replay.fit_error import fit_error_m
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.matching import long_enough
from stopgo.recordings.replay.position_errors import PositionErrors, lasting_jump, position_errors, visits_of
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.unseen_visits import DRIFTS, why_unseen

LEVEL_M = 2.0
"""Difference of heights above which a stop is on another level."""
START_NS = 2 * 10**9
"""Time from the begin of a log whose height is the start's."""


@dataclass(frozen=True)
class StopEvidence:
    """Answer for one stop, with the reason if it is undecided."""

    item: StopComparison
    answer: Certainty
    why: str = ""


def stop_evidence(replay: Replay) -> tuple[StopEvidence, ...]:
    """Return the evidence for each stop, in the mission's order."""
    errors, fit_m = position_errors(replay), fit_error_m(replay)
    found = (_evidence(replay, k, item, errors) for k, item in enumerate(replay.comparison.asked))
    return tuple(
        _with_error_of_fit(one, float(errors.unsure_m[k] + fit_m[k]), headings=replay.placed.turns)
        for k, one in enumerate(found)
    )


def _with_error_of_fit(evidence: StopEvidence, unsure_m: float, *, headings: bool) -> StopEvidence:
    """Return a yes as undecided if the common error of placing may exceed the tolerance."""
    item = evidence.item
    if evidence.answer != "yes" or not is_outside(
        (item.deviation_m or 0.0) + unsure_m, item.tolerance_m or 0.0
    ):
        return evidence
    return StopEvidence(item, "unknown", FIT if headings else NO_HEADINGS)


NO_HEADINGS = "the log has no headings, so that a turn of the whole drive is hidden; give --map X,Y,HEADING"
FIT = (
    "a fit to the stops hides a shift or turn of the whole drive, and the log does not begin at the start "
    "with its heading; give --map X,Y,HEADING"
)


def _evidence(replay: Replay, number: int, item: StopComparison, errors: PositionErrors) -> StopEvidence:
    unsure_m = float(errors.unsure_m[number])
    if item.outcome not in DONE:
        if replay.inferred:
            why = why_unseen(replay, number, unsure_m, drifts=errors.drifts)
        else:
            why = _why_not_the_end(replay, number, item)
        return StopEvidence(item, "unknown" if why else "no", why)
    if item.deviation_m is None:
        return StopEvidence(item, "unknown", "no pose in the log; the robot's own log may have it")
    within = _within(item, number, errors)
    if within == "unknown":
        return StopEvidence(item, "unknown", DRIFTS)
    where = other_storey(replay, number) if within == "yes" else ""
    if where:
        return StopEvidence(item, "unknown", where)
    if within == "no" and replay.inferred:
        why = why_unseen(replay, number, unsure_m, halted=True, drifts=errors.drifts)
        return StopEvidence(item, "unknown" if why else "no", why)
    return StopEvidence(item, within)


RUN_GOES_ON = "the log ends before the run; give a log that continues"


STOOD = "the robot stood there long enough, though a later item of its list was current"


def _why_not_the_end(replay: Replay, number: int, item: StopComparison) -> str:
    """Return why the log's events do not show that a stop was missed; empty if they do.

    A vehicle that is followed by its messages may come back to a stop that was jumped over.
    """
    followed = replay.log.format == FORMAT
    over = any(isinstance(event, Finished | Aborted) for event in replay.run.events)
    if not over and (followed or item.outcome in ("not reached", "arrived")):
        return RUN_GOES_ON
    stop = replay.mission.stops[number]
    stood = any(
        long_enough(match.standstill, stop) and not is_outside(match.away_m, stop.tolerance_m)
        for match in replay.at(number)
    )
    return STOOD if followed and (item.reason or "").startswith(JUMPED_OVER) and stood else ""


def _within(item: StopComparison, number: int, errors: PositionErrors) -> Certainty:
    """Return whether the robot was within tolerance, with the uncertainty of its position.

    A fitted drift is evidence against a stop that it does not explain, and none for the others: a robot whose
    map is turned or stretched drives the same path, truly off its stops.
    """
    away_m, limit_m = item.deviation_m or 0.0, item.tolerance_m or 0.0
    unsure_m = float(errors.unsure_m[number])
    if not is_outside(away_m + unsure_m, limit_m):
        return "yes"
    fitted = errors.without_drift(number)
    if fitted is None:
        return "no" if is_outside(away_m - float(errors.most_m[number]), limit_m) else "unknown"
    left_m, sure_m = fitted
    return "no" if is_outside(left_m - sure_m, limit_m) else "unknown"


def other_storey(replay: Replay, stop: int) -> str:
    """Return why a stop may have been visited on another storey; empty if heights do not suggest it.

    Heights count from the log's zero or from sea level; the start's is compared with the mission's floor, and
    that of the last standstill at the stop with the start's.
    """
    source, standstills = replay.placed.source, replay.at(stop)
    if source.height is None or not standstills or not np.isfinite(source.height).any():
        return ""
    offset = replay.placed.alignment.time_offset_ns
    standstill = standstills[-1].standstill
    there = (source.ns + offset >= standstill.begin_ns) & (source.ns + offset <= standstill.end_ns)
    start = source.ns <= source.ns[0] + START_NS
    heights = [source.height[mask & np.isfinite(source.height)] for mask in (start, there)]
    if not all(len(values) for values in heights):
        return ""
    begin_m, there_m = (float(np.median(values)) for values in heights)
    climbed_m = there_m - begin_m
    if abs(climbed_m) > LEVEL_M:
        where = f"{abs(climbed_m):.1f} m {'higher' if climbed_m > 0 else 'lower'} than at the start"
        return f"the robot was {where}; give a log of its storey"
    if all(abs(begin_m - level_m) > LEVEL_M for level_m in _levels(replay)):
        return f"the log's heights begin at {begin_m:.1f} m; give the floor's with --floor-height"
    return ""


def _levels(replay: Replay) -> tuple[float, ...]:
    """Return the heights at which the mission's floor may lie in the log."""
    if replay.placed.level_m is not None:
        return (replay.placed.level_m,)
    site = replay.mission.georeference
    return (0.0,) if site is None else (0.0, site.alt)


def apart_from_plan(replay: Replay) -> Iterator[str]:
    """Yield consecutive stops whose standstills are farther apart, or nearer, than drift can explain.

    Turning and shifting a log changes no distance: one of both stops was outside its tolerance. Nothing was
    unseen, and no gap or jump is between them.
    """
    track = replay.run.poses
    jump = lasting_jump(track)
    for (a, one), (b, other) in pairwise(visits_of(replay)):
        between = track.between(one.standstill.end_ns, other.standstill.begin_ns)
        jumped = jump is not None and one.standstill.end_ns <= jump[0] <= other.standstill.begin_ns
        if between.gaps.any() or jumped or any(why_unseen(replay, k, 0.0, halted=True) for k in (a, b)):
            continue
        yield from _apart(replay, a, b, between.length_m, one.standstill.xy, other.standstill.xy)


def _apart(replay: Replay, a: int, b: int, path_m: float, one: Point, other: Point) -> Iterator[str]:
    stops = replay.mission.stops
    planned = math.dist((stops[a].x, stops[a].y), (stops[b].x, stops[b].y))
    driven = math.dist(one, other)
    allowed = stops[a].tolerance_m + stops[b].tolerance_m + STRETCH * max(planned, path_m)
    if abs(driven - planned) > allowed:
        yield (
            f"{stops[a].id} and {stops[b].id}: {driven:.2f} m apart, {planned:.2f} m planned; "
            "no drift explains that"
        )
