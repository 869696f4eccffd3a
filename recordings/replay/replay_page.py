"""Replays as the subject of the page that reviews have: verdict first, then the plan, the stops, the way."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.stages.figures import percent
from stopgo.recordings.page.from_recordings import subject_of
from stopgo.recordings.page.reviewed import Review
from stopgo.recordings.page.subject import ReportSubject
from stopgo.recordings.replay.drive_verdict import judged, missing, outside
from stopgo.recordings.replay.replay_text import measured_lines, notes_of, truth_lines, way_lines
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.replay.path_and_time import lost_times, way_track

RunLines = tuple[str, tuple[str, ...]]
"""A title and its lines."""


def page_of(replays: Sequence[Replay], plans: Review | None = None) -> ReportSubject:
    """The runs that logs tell of, with the floor and the sight of the plans' recordings where they are given.

    Raises
    ------
    InputError
        When the plans are of another mission.
    """
    missions = (replays[0].mission,)
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
        sight=None if any(one.inferred for one in replays) else plan.sight,  # or walls are drawn as scanned
        judgements={item.run.run_id: judged(item) for item in replays},
        more={item.run.run_id: tuple(told_of(item)) for item in replays},
    )


def _shown(replay: Replay) -> Comparison:
    """The comparison with its way free of noise; where no scan is told, nothing is said to be acquired."""
    log = replace(replay.run, poses=way_track(replay.run.poses, replay.matches))
    acquired = None if replay.inferred else replay.comparison.acquired
    return replace(replay.comparison, log=log, acquired=acquired)


def told_of(replay: Replay) -> Iterator[RunLines]:
    """What a replay tells beyond the comparison of its stops."""
    tomorrow = tuple(to_do(replay))
    if tomorrow:
        yield "What to do tomorrow", tomorrow
    if replay.sight is not None:
        yield (
            "In sight from where the robot stood",
            tuple(
                f"{share.name}: {percent(share.coverage)} (planned {percent(planned.coverage)}, "
                f"asked {percent(share.required)})"
                for planned, share in replay.sight.pairs
            ),
        )
    yield "The way", tuple(" ".join(line.split()) for line in (*way_lines(replay), *truth_lines(replay)))
    found = [" ".join(line.split()) for line in measured_lines(replay) if line.strip()]
    if found:
        yield "What the scans show", tuple(found)
    lost = tuple(f"{item.seconds:+.1f} s: {item.where}" for item in lost_times(replay))
    if lost:
        yield "Where time was lost", lost
    if notes_of(replay):
        yield "About the log", notes_of(replay)


def to_do(replay: Replay) -> Iterator[str]:
    """What is left to be scanned, and to be looked at."""
    for item in missing(replay):
        yield f"{item.stop}: scan it; {item.reason or 'the robot did not come there'}"
    for item in outside(replay):
        yield f"{item.stop}: scan it again, {1000 * (item.deviation_m or 0):.0f} mm nearer to its place"
    for heap in replay.measured.unplanned if replay.measured is not None else ():
        yield f"look at what stands at ({heap.middle[0]:.2f}, {heap.middle[1]:.2f}), {heap.size_m:.1f} m wide"
    if replay.sight is not None and not replay.sight.enough:
        yield "too little was in sight: stopgo replay --top-up plans the further mission"
