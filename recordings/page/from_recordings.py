"""Collect the subject of a report from recordings that were reviewed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from stopgo.mission.errors import InputError
from stopgo.mission.files.given_file import file_digest
from stopgo.mission.floor.polylines import FloorLines
from stopgo.mission.run.run_log import LogSource
from stopgo.mission.stages.plan_results import PlanResults
from stopgo.mission.stages.stop_reasons import StopReason
from stopgo.recordings.embedded.findings import EmbeddedFindings, findings_in
from stopgo.recordings.embedded.floor_lines import floor_lines
from stopgo.recordings.embedded.plan import origin_in
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.embedded.reasons import reasons_in
from stopgo.recordings.embedded.same_mission import agreeing
from stopgo.recordings.page.reviewed import (
    RecordingReview,
    Review,
    missions_of,
    plan_id_of,
    sights_of,
    what_next,
)
from stopgo.recordings.page.subject import ReportSubject


def subject_of(review: Review) -> ReportSubject:
    """Return the mission of all recordings, or those that share a floor, with plan and runs.

    Raises
    ------
    InputError
        When they are of several plans or contradict each other, or none of them contains its mission.
    """
    read = agreeing([item.recording for item in review.recordings])
    items = [item for item in review.recordings if item.recording in read]
    plan_id, missions, sights = _one_plan(read), missions_of(read), sights_of(read)
    if not missions:
        raise InputError(
            "report: no recording contains its mission, all are of another version; plan and record again"
        )
    if not review.comparisons and len({mission.id for mission in missions}) > 1:
        raise InputError("report: plans of several missions and no run; give one plan, or the runs too")
    both = review.together.get(plan_id)
    return ReportSubject(
        missions=missions,
        comparisons=tuple(sorted(review.comparisons, key=lambda item: item.log.began_ns or 0)),
        sight=sights[-1] if sights else None,
        floor=_first(read, _floor),
        results=_results(items),
        reasons=_first(read, _reasons) or (),
        found=_first(read, _found) or EmbeddedFindings(),
        sources=tuple(_source(item) for item in read),
        more={
            run.run_id: (("What to do next", lines),)
            for item in items
            for run in item.comparisons
            if both is None and (lines := what_next(run, item.recording.path))
        },
        together=() if both is None else (*both.sentences, *review.next_together(plan_id)),
        rooms_together=() if both is None else both.rooms,
        problems=tuple(
            f"{item.recording.path.name}: {text}" for item in review.recordings for text in item.problems
        ),
    )


def _one_plan(read: Sequence[Recording]) -> str:
    """Return the id of the plan of a floor that all recordings are of."""
    found = {plan_id_of(item): item.mission_id for item in read}
    if len(found) > 1:
        names = ", ".join(sorted(found.values()))
        raise InputError(f"report: needs recordings of one mission, not {len(found)}: {names}")
    return next(iter(found), "")


def _first(read: Sequence[Recording], of: Any) -> Any:
    """Return the first value that a recording has."""
    return next((found for item in read if (found := of(item)) is not None), None)


def _floor(recording: Recording) -> FloorLines | None:
    return floor_lines(recording.values, origin_in(recording))


def _reasons(recording: Recording) -> tuple[StopReason, ...] | None:
    return reasons_in(recording.values, str(recording.path)) or None


def _found(recording: Recording) -> EmbeddedFindings | None:
    found = findings_in(recording.values)
    return found if found.findings or found.unreached else None


def _results(items: Sequence[RecordingReview]) -> PlanResults:
    return PlanResults.read(next((item.plan for item in items if item.plan is not None), {}))


def _source(recording: Recording) -> LogSource:
    path = recording.path
    return LogSource(path.name, "rrd", file_digest(path), recording.contents.total_rows)
