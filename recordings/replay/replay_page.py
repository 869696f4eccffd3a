"""Replays as the subject of a report page: verdict first, then the plan, the stops and the path."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.stages.figures import percent
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import Review, sights_of
from stopgo.recordings.page.runs_together import RunsTogether, together
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.replay.drive_verdict import drive_verdict, missing, outside
from stopgo.recordings.replay.path_and_time import lost_times, smoothed_track
from stopgo.recordings.replay.replay_text import (
    absent_of,
    measured_lines,
    notes_of,
    path_lines,
    truth_lines,
    uncertainty_lines,
)
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.stop_evidence import stop_evidence

RunLines = tuple[str, tuple[str, ...]]
"""Title and its lines."""


def page_of(replays: Sequence[Replay], plans: Review | None = None) -> ReportSubject:
    """Return the runs in the logs, with the plan's floor and visibility if given.

    Raises
    ------
    InputError
        When the plans are of another mission.
    """
    missions, both = (replays[0].mission,), _together(replays, plans)
    plan = ReportSubject(missions) if plans is None else subject_of(plans)
    return replace(
        plan,
        missions=missions,
        comparisons=tuple(map(_shown, replays)),
        sources=(*plan.sources, *(item.run.source for item in replays)),
        problems=(
            *plan.problems,
            *(f"{item.log.path}: {item.log.lost}" for item in replays if item.log.lost),
        ),
        sight=None
        if any(one.inferred for one in replays)
        else plan.sight,  # else walls would be drawn as scanned
        together=() if both is None else both.sentences,
        rooms_together=() if both is None else both.rooms,
        judgements={item.run.run_id: drive_verdict(item) for item in replays},
        more={item.run.run_id: tuple(run_texts(item)) for item in replays},
    )


def _together(replays: Sequence[Replay], plans: Review | None) -> RunsTogether | None:
    """Return what several replays acquired together, if their logs contain scans."""
    if plans is None or len(replays) < 2 or any(one.inferred for one in replays):
        return None
    sights = sights_of(item.recording for item in plans.recordings)
    return together([one.comparison for one in replays], (), sights)


def _shown(replay: Replay) -> Comparison:
    """Return the comparison with a smoothed path; without scans in the log, nothing counts as acquired."""
    log = replace(replay.run, poses=smoothed_track(replay.run.poses, replay.matches))
    acquired = None if replay.inferred else replay.comparison.acquired
    return replace(replay.comparison, log=log, acquired=acquired)


def run_texts(replay: Replay) -> Iterator[RunLines]:
    """Yield texts of a replay besides the comparison of its stops."""
    tasks = tuple(to_do(replay))
    if tasks:
        yield "What to do next", tasks
    if replay.sight is not None:
        yield (
            "Visible from the robot's stationary poses",
            tuple(
                f"{group.name}: {percent(group.coverage)} (planned {percent(planned.coverage)}"
                + (")" if group.required is None else f", required {percent(group.required)})")
                for planned, group in replay.sight.pairs
            ),
        )
    lines = (*path_lines(replay), *uncertainty_lines(replay), *truth_lines(replay))
    yield "Driven path", tuple(" ".join(line.split()) for line in lines)
    found = [" ".join(line.split()) for line in measured_lines(replay) if line.strip()]
    if found:
        yield "Measured by the scans", tuple(found)
    lost = tuple(f"{item.seconds:+.1f} s: {item.where}" for item in lost_times(replay))
    if lost:
        yield "Time lost", lost
    if notes_of(replay):
        yield "About the log", notes_of(replay)


def to_do(replay: Replay) -> Iterator[str]:
    """Yield stops to scan, and objects to inspect."""
    for item in missing(replay):
        yield f"{item.stop}: scan it; {item.reason or 'the robot did not reach it'}"
    for item in outside(replay):
        yield f"{item.stop}: scan it again, {1000 * (item.deviation_m or 0):.0f} mm nearer to its position"
    for one in stop_evidence(replay):
        if one.turned:
            degrees = -math.degrees(one.item.heading_rad or 0.0)
            yield f"{one.item.stop}: scan it again, turned by {degrees:+.1f}°"
    for absent in absent_of(replay):
        yield f"inspect {absent.id}: {percent(absent.empty)} of its visible part has no point"
    for found in replay.measured.unplanned if replay.measured is not None else ():
        x, y = found.middle
        share = f"hit in {percent(found.hits / found.sweeps)} of the scans"
        yield f"inspect the object at ({x:.2f}, {y:.2f}), {found.size_m:.1f} m wide, {share}"
    if replay.sight is not None and not replay.sight.enough:
        yield "too little was visible: plan the follow-up mission with stopgo replay --top-up"
