"""Verdict on a replay: one answer to whether the mission was driven as planned, and the reasons."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stopgo.mission.comparing.acquired import Certainty
from stopgo.mission.comparing.as_driven import AsDriven
from stopgo.mission.comparing.comparison import DONE, StopComparison
from stopgo.mission.comparing.measured import Measured
from stopgo.mission.comparing.run_verdict import Judgement, named
from stopgo.mission.console.table import counted
from stopgo.mission.run.events import Settled
from stopgo.mission.stages.figures import percent
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.stop_evidence import StopEvidence, apart_from_plan, stop_evidence


def drive_verdict(replay: Replay) -> Judgement:
    """Return yes if the log shows the robot stationary at every stop within tolerance, for its scan's time.

    If the floor is known, all required targets must have been visible as well. No needs evidence against it;
    without either the answer is unknown.
    """
    evidence = stop_evidence(replay)
    answers = {one.answer for one in evidence}
    apart = tuple(apart_from_plan(replay)) if "unknown" in answers else ()
    if "no" in answers or apart:
        answer: Certainty = "no"
    elif "unknown" in answers:
        answer = "unknown"
    else:
        answer = "yes" if replay.sight is None or replay.sight.enough else "no"
    clouds = _answer_of_clouds(replay.measured)
    by_clouds = clouds == "no" and answer != "no"
    if answer != "no" and clouds != "yes":
        answer = clouds
    return DriveJudgement(answer, tuple(_sentences(replay, evidence, apart)), by_clouds)


def _answer_of_clouds(measured: Measured | None) -> Certainty:
    """Return no if the scanner's clouds show less than required, unknown if they do not lie on the floor."""
    if measured is None or not measured.decides:
        return "yes"
    if measured.placing_text or not measured.misplaced_m:
        return "unknown"
    return "no" if measured.coverage.short else "yes"


@dataclass(frozen=True)
class DriveJudgement(Judgement):
    """Verdict on how a mission was driven; only clouds say whether the scans succeeded."""

    by_clouds: bool = False
    """True if the mission was driven as planned, and the clouds show less than required."""

    @property
    def headline(self) -> str:
        return "Not measured as planned" if self.by_clouds else HEADLINES[self.answer]


def missing(replay: Replay) -> list[StopComparison]:
    """Return stops at which the robot was not stationary, or not long enough."""
    return [item for item in replay.comparison.asked if item.outcome not in DONE]


def outside(replay: Replay) -> list[StopComparison]:
    """Return stops at which it was too far away, by its own poses or by a simulator's truth."""
    return [item for item in replay.comparison.asked if item.position_outside and item.outside_text]


def _sentences(replay: Replay, evidence: Sequence[StopEvidence], apart: Sequence[str]) -> Iterator[str]:
    good = sum(one.answer == "yes" for one in evidence)
    yield f"{good} of {len(evidence)} stops were visited within tolerance."
    for why in dict.fromkeys(one.why for one in evidence if one.answer == "unknown"):
        stops = [one.item.stop for one in evidence if one.why == why]
        yield f"{named(stops)} {'are' if len(stops) > 1 else 'is'} undecided: {why}."
    yield from _against(replay, [one for one in evidence if one.answer == "no"])
    yield from (f"{line}." for line in apart)
    yield from _floor_sentences(replay)
    if replay.extra:
        yield f"{counted(len(replay.extra), 'standstill was', 'standstills were')} not at a stop."
    if replay.inferred:
        yield f"Visits are inferred from standstills; {_scans_text(replay)}."
    unseen = [item.stop for item in replay.comparison.asked if item.outcome == "unconfirmed"]
    if unseen and not replay.inferred:
        yield f"At {named(unseen)} the log does not show whether a scan was made."
    if replay.log.lost:
        yield f"The log is damaged; this is the result of the readable part: {replay.log.lost}."


def _against(replay: Replay, against: Sequence[StopEvidence]) -> Iterator[str]:
    """Yield what is known against stops."""
    absent = [one.item.stop for one in against if not one.is_placed]
    if absent:
        yield f"{WORDS['skipped']} {named(absent)}."
    for outcome, words in WORDS.items():
        stops = [one.item.stop for one in against if one.item.outcome == outcome]
        if stops:
            yield f"{words if replay.inferred else WORDS_OF_EVENTS.get(outcome, words)} {named(stops)}."
    for one in against:
        item = one.item
        if one.is_placed and item.position_outside and item.outside_text:
            far, limit = 1000 * (item.deviation_m or 0.0), 1000 * (item.tolerance_m or 0.0)
            yield f"{item.stop}: position error {far:.0f} mm (tolerance {limit:.0f} mm)."
        if one.turned:
            yield (
                f"{item.stop}: turned {math.degrees(abs(item.heading_rad or 0.0)):.1f}° from its heading; "
                f"the scanner sees {replay.mission.scanner.fov_deg:g}°."
            )


def _floor_sentences(replay: Replay) -> Iterator[str]:
    """Yield what was visible and measured of the floor, if it was given."""
    if replay.sight is not None:
        yield from _coverage_sentences(replay.sight)
    if replay.measured is not None and replay.measured.decides:
        yield from _cloud_sentences(replay.measured, replay.sight)


def _coverage_sentences(sight: AsDriven) -> Iterator[str]:
    whole = sight.coverage.whole
    for group in (whole, *(group for group in sight.coverage.short if group is not whole)):
        name = group.name if group is not whole else "what is visible"
        asked = "" if group.required is None else f"; {percent(group.required)} is required"
        yield f"Of {name}, {percent(group.coverage)} was visible{asked}."


def _cloud_sentences(measured: Measured, sight: AsDriven | None) -> Iterator[str]:
    if measured.placing_text:
        yield f"What was measured is undecided: {measured.placing_text}."
        return
    if not measured.misplaced_m:
        yield "What was measured is undecided: the clouds have too few points at the heights of walls."
        return
    whole = measured.coverage.whole
    for group in (whole, *(group for group in measured.coverage.short if group is not whole)):
        what = "what is visible" if measured.part is None else "what the mission's stops see"
        name, least = group.name if group is not whole else what, percent(group.required)
        yield f"Of {name}, {percent(group.coverage)} was measured; {least} is required."
    absent = [] if sight is None else [item for item in measured.absent(sight.driven) if item.empty == 1.0]
    if absent:
        least, most = (percent(pick(item.visible for item in absent)) for pick in (min, max))
        range_text = least if least == most else f"{least} to {most}"
        yield (
            f"No point lies on {named([item.id for item in absent])}, although {range_text} of it was "
            "visible: not built, hidden, or missing from the clouds."
        )


def _scans_text(replay: Replay) -> str:
    asked = {item.stop for item in replay.comparison.asked}
    triggered = asked & {event.stop for event in replay.run.events if isinstance(event, Settled)}
    if not triggered:
        return "the log does not show whether scans were made"
    return f"the log shows a trigger of the scanner at {len(triggered)} of {len(asked)} stops"


WORDS = {
    "skipped": "No standstill at",
    "failed": "Standstill too short at",
    "arrived": "No scan at",
    "not reached": "Not reached:",
}
WORDS_OF_EVENTS = {"skipped": "Skipped:", "failed": "Scan failed at"}
"""Words where the events are the log's own."""
HEADLINES: dict[Certainty, str] = {
    "yes": "Driven as planned",
    "no": "Not driven as planned",
    "unknown": "Undecided",
}
