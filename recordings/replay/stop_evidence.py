"""Evidence of a log for and against each stop: yes, no or undecided, with the reason.

Yes needs poses within tolerance, their own uncertainty included. No needs poses that show the robot elsewhere
all the time. Gaps, a log that begins late or ends early, jumps and drift leave it open.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from dataclasses import replace as changed
from itertools import pairwise

import numpy as np

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.comparing.evidence import missing_events
from stopgo.mission.document import Point
from stopgo.mission.run.events import JUMPED_OVER, Aborted, AnyEvent, Finished, Settled, Unconfirmed
from stopgo.mission.run.tolerance import is_outside
from stopgo.recordings.logs.telemetry_log import FORMAT
from stopgo.recordings.replay.fit_error import fit_error_m
from stopgo.recordings.replay.fitting import STRETCH
from stopgo.recordings.replay.heading_evidence import heading_answer
from stopgo.recordings.replay.jumps import (
    LEAST_CORRECTION_M,
    SIGMAS,
    hidden_jump,
    lasting_error_m,
    lasting_jump,
)
from stopgo.recordings.replay.matching import long_enough
from stopgo.recordings.replay.position_errors import PositionErrors, position_errors, visits_of
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.shifted_parts import hiding_steps, may_be_shifted
from stopgo.recordings.replay.unseen_visits import DRIFTS, why_shorter, why_unseen

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
    unsure_m: float | None = None
    """Uncertainty of its position error; infinite where nothing limits it, None without a position."""
    is_placed: bool = True
    """True if the log has a pose of a standstill there, or the stop was not visited."""
    turned: bool = False
    """True if the robot did not face as its scanner needs."""


def stop_evidence(replay: Replay) -> tuple[StopEvidence, ...]:
    """Return the evidence for each stop, in the mission's order."""
    errors, fit_m = position_errors(replay), fit_error_m(replay)
    jump_m, hidden = lasting_error_m(replay.run.poses), _hidden_jump(replay, errors.noise_m)
    hidden_m = 0.0 if hidden is None else hidden[1]
    found = []
    for k, item in enumerate(replay.comparison.asked):
        evidence = _with_jump(_evidence(replay, k, item, errors), jump_m)
        evidence = _with_hidden_jump(replay, k, evidence, hidden_m)
        evidence = _with_shifted_part(replay, k, evidence, errors)
        common_m = float(errors.unsure_m[k] + fit_m[k])
        evidence = _with_error_of_fit(evidence, common_m, headings=replay.placed.turns)
        evidence = _with_other_clock(replay, k, evidence)
        one = _with_heading(replay, k, evidence, drifts=errors.drifts)
        placed = one.is_placed and item.deviation_m is not None
        unsure_m = None if not placed else common_m + max(jump_m, hidden_m) + float(errors.spread_m[k])
        found.append(changed(one, unsure_m=unsure_m))
    return tuple(found)


def _hidden_jump(replay: Replay, noise_m: float) -> tuple[int, float] | None:
    """Return the time and size of the step off the route that a time without poses hides."""
    track, cross_track = replay.run.poses, replay.comparison.cross_track
    if not len(cross_track.ns):
        return None
    poses = track.between(int(cross_track.ns[0]), int(cross_track.ns[-1]))
    return hidden_jump(
        poses, cross_track.metres, cross_track.route, max(LEAST_CORRECTION_M, SIGMAS * noise_m)
    )


def _with_hidden_jump(replay: Replay, number: int, evidence: StopEvidence, hidden_m: float) -> StopEvidence:
    """Return a yes as undecided if a jump in a time without poses may have made it."""
    away_m, limit_m = evidence.item.deviation_m or 0.0, replay.mission.stops[number].tolerance_m
    if evidence.answer != "yes" or not hidden_m or not is_outside(away_m + hidden_m, limit_m):
        return evidence
    why = f"a time without poses hides a step aside of {hidden_m:.2f} m; give another source of poses"
    return changed(evidence, answer="unknown", why=why)


def _with_shifted_part(
    replay: Replay, number: int, evidence: StopEvidence, errors: PositionErrors
) -> StopEvidence:
    """Return a no as undecided if a hidden shift of a part of the log explains it."""
    if evidence.answer != "no" or not replay.inferred:
        return evidence
    shifted = may_be_shifted(replay, number, float(errors.spread_m[number]) + SIGMAS * errors.noise_m)
    return changed(evidence, answer="unknown", why=SHIFTED) if shifted else evidence


SHIFTED = (
    "a time without poses may hide a jump of the poses that brings its standstill off it; "
    "give another source of poses"
)


def _with_jump(evidence: StopEvidence, jump_m: float) -> StopEvidence:
    """Return a yes as undecided if a jump of the poses, before or after it, exceeds the tolerance."""
    item = evidence.item
    holds = not is_outside((item.deviation_m or 0.0) + jump_m, item.tolerance_m or 0.0)
    if evidence.answer != "yes" or holds:
        return evidence
    why = f"the poses jump by {jump_m:.2f} m and do not come back; give poses matched to a map"
    return StopEvidence(item, "unknown", why)


def _with_error_of_fit(evidence: StopEvidence, unsure_m: float, *, headings: bool) -> StopEvidence:
    """Return a yes as undecided if the common error of placing may exceed the tolerance.

    Without headings nothing limits that error, and a no is undecided too.
    """
    item = evidence.item
    if math.isinf(unsure_m) and not headings:
        return StopEvidence(item, "unknown", NO_HEADINGS)
    if evidence.answer != "yes" or not is_outside(
        (item.deviation_m or 0.0) + unsure_m, item.tolerance_m or 0.0
    ):
        return evidence
    return StopEvidence(item, "unknown", FIT if headings else NO_HEADINGS)


def _with_other_clock(replay: Replay, number: int, evidence: StopEvidence) -> StopEvidence:
    """Return the answer as undecided that standstills of other lengths than the log's could turn."""
    rate = replay.placed.source.rate
    turns = evidence.answer == ("no" if rate > 1 else "yes")
    if abs(rate - 1) <= SAME_RATE or not turns or _is_missed_by_any_clock(replay, number, evidence.item):
        return evidence
    why = (
        f"{rate:.3g} s passed for the vehicle in each second of the log, as in a simulation, so that its "
        "standstills are of other lengths; give the autopilot's own log"
    )
    return changed(evidence, answer="unknown", why=why)


def _is_missed_by_any_clock(replay: Replay, number: int, item: StopComparison) -> bool:
    """True if reports show a stop as missed whatever the lengths of standstills are.

    A scan was reported elsewhere, or the stop as skipped. The robot may have stood at a stop that was jumped
    over, unless no pose is within its tolerance.
    """
    if replay.inferred or item.outcome in DONE:
        return not replay.inferred and _is_off(item)
    if item.outcome != "skipped" or not (item.reason or "").startswith(JUMPED_OVER):
        return item.outcome == "skipped"
    stop, poses = replay.mission.stops[number], replay.run.poses
    away_m = np.hypot(*(poses.xy - (stop.x, stop.y)).T)
    return bool(len(poses)) and is_outside(float(away_m.min()), stop.tolerance_m)


def _is_off(item: StopComparison) -> bool:
    """True if it was visited outside of its tolerance."""
    return is_outside(item.deviation_m or 0.0, item.tolerance_m or 0.0)


SAME_RATE = 0.05
"""Difference of two clocks' rates up to which both measure standstills."""


def _with_heading(replay: Replay, number: int, evidence: StopEvidence, *, drifts: bool) -> StopEvidence:
    """Return a yes as a no, or undecided, if the robot faced elsewhere or the log does not show where."""
    if evidence.answer != "yes":
        return evidence
    answer, why = heading_answer(replay, number, drifts=drifts)
    return changed(evidence, answer=answer, why=why, turned=answer == "no")


NO_HEADINGS = "the log has no headings, so that a turn of the whole drive is hidden; give --map X,Y,HEADING"
FIT = (
    "a fit to the stops hides a shift or turn of the whole drive, and the log does not begin at the start "
    "with its heading; give --map X,Y,HEADING"
)


def _evidence(replay: Replay, number: int, item: StopComparison, errors: PositionErrors) -> StopEvidence:
    if item.outcome in DONE and _is_placed(replay, item):
        return _of_visit(replay, number, item, errors)
    if item.outcome in DONE:
        seen = len(replay.run.poses) and not _why_unseen(replay, number, errors)
        return StopEvidence(item, "no" if seen else "unknown", "" if seen else NO_POSE, is_placed=False)
    why = _why_unseen(replay, number, errors) if replay.inferred else _why_not_the_end(replay, number, item)
    return StopEvidence(item, "unknown" if why else "no", why)


def _is_placed(replay: Replay, item: StopComparison) -> bool:
    """True if the log has a pose of the standstill; of an unconfirmed stop that of its arrival is none."""
    ends = [event for event in replay.run.events if getattr(event, "stop", None) == item.stop]
    unplaced = bool(ends) and isinstance(ends[-1], Unconfirmed) and ends[-1].pose is None
    return item.deviation_m is not None and not unplaced


def _why_unseen(replay: Replay, number: int, errors: PositionErrors, *, halted: bool = False) -> str:
    unsure_m, noise_m = float(errors.unsure_m[number]), errors.noise_m
    return why_unseen(replay, number, unsure_m, noise_m=noise_m, halted=halted, drifts=errors.drifts)


def _of_visit(replay: Replay, number: int, item: StopComparison, errors: PositionErrors) -> StopEvidence:
    """Return the answer for a stop that the log places the robot at."""
    within, why = _within(item, number, errors), ""
    if item.is_disputed:
        why = f"{item.disputed_text}; the scan's cloud would show it"
    elif within == "unknown":
        why = DRIFTS if errors.drifts or errors.most_m[number] > 0 else NOISE
    elif within == "yes":
        why = other_storey(replay, number) or _why_unlogged(replay, item.stop)
        why = why or why_shorter(replay, number)
    elif replay.inferred:
        why = _why_unseen(replay, number, errors, halted=True)
    return StopEvidence(item, "unknown" if why else within, why)


def _why_unlogged(replay: Replay, stop: str) -> str:
    if replay.inferred and _restarted_in_scan(replay, stop):
        return RESTARTED
    if stop not in replay.unlogged:
        return ""
    return NO_TRIGGER if replay.inferred else NO_REPORT


def _restarted_in_scan(replay: Replay, name: str) -> bool:
    """True if the robot restarted between the trigger and the end of a scan."""
    stop = next(stop for stop in replay.mission.stops if stop.id == name)
    triggered = [event.robot_ns for event in replay.run.events if _is_trigger(event, name)]
    lasts_ns = round(stop.scan.duration_s * 1e9)
    return any(ns <= restart <= ns + lasts_ns for ns in triggered for restart in replay.run.poses.restarts_ns)


def _is_trigger(event: AnyEvent, stop: str) -> bool:
    return isinstance(event, Settled) and event.stop == stop


RESTARTED = "the robot restarted during its scan; the scanner's files would show it"
NOISE = "the poses are too noisy, or too few, for the tolerance; give another source of poses"
NO_POSE = "no pose of its standstill in the log; the robot's own log may have it"
NO_TRIGGER = (
    "the log shows no trigger of the scanner there, and one elsewhere; the scanner's files would show it"
)
NO_REPORT = "the log contains no report of its scan, and those of others; the scanner's files would show it"
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
    if item.is_open and (missing := missing_events(replay.run)):
        return f"the log lacks {missing}; `stopgo watch --run` would fetch them from the robot"
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
    spread_m = float(errors.spread_m[number])
    if not is_outside(away_m + float(errors.unsure_m[number]) + spread_m, limit_m):
        return "yes"
    moved_m = float(errors.moved_m[number])
    if moved_m > limit_m and not is_outside(away_m - moved_m, limit_m):
        return "unknown"
    fitted = errors.without_drift(number)
    if fitted is None:
        return "no" if is_outside(away_m - float(errors.most_m[number]) - spread_m, limit_m) else "unknown"
    left_m, sure_m = fitted
    return "no" if is_outside(left_m - sure_m - spread_m, limit_m) else "unknown"


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
    unseen, and no gap or jump is between them. A log that is turned by its first path, without headings, may
    lie so far off that its standstills belong to other stops.
    """
    if not replay.placed.turns and np.isinf(fit_error_m(replay)).any():
        return
    track = replay.run.poses
    jump = lasting_jump(track) or _hidden_jump(replay, 0.0)
    for (a, one), (b, other) in pairwise(visits_of(replay)):
        between = track.between(one.standstill.end_ns, other.standstill.begin_ns)
        jumped = jump is not None and one.standstill.end_ns <= jump[0] <= other.standstill.begin_ns
        hides = between.gaps.any() or len(hiding_steps(between)) > 0
        if hides or jumped or any(why_unseen(replay, k, 0.0, halted=True) for k in (a, b)):
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
