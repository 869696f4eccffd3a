"""Replays as one recording, with the axes, entities and timelines of plans and runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from stopgo.mission.run.events import UNKNOWN_CHARGE, AnyEvent, Pose, PoseReport, StateReport
from stopgo.recordings.embedded.reading import Recording
from stopgo.recordings.replay.replayed import Replay
from stopgo.recordings.runs.field import FieldRecording

STEP_M, STEP_RAD, STEP_S = 0.02, math.radians(2.0), 2.0
"""Limits below which a pose counts as equal to the one before and is left out."""


def write_recording(replays: Sequence[Replay], path: Path, plan: Recording | None = None) -> None:
    """Draw every run, with the floor and visibility of the plan's recording if it is given."""
    with FieldRecording(path, replays[0].mission, plan=plan) as recording:
        for replay in replays:
            for report in _reports(replay):
                if isinstance(report, PoseReport):
                    recording.pose(report)
                elif isinstance(report, StateReport):
                    recording.state(report)
                else:
                    recording.event(report)


def _reports(replay: Replay) -> Iterator[PoseReport | StateReport | AnyEvent]:
    """Yield poses and events in order of time; a state with each event."""
    events = list(replay.run.events)
    began = replay.run.began_ns or 0
    for pose in _poses(replay, began):
        while events and events[0].robot_ns <= pose.robot_ns:
            yield from _event_and_state(replay, events.pop(0))
        yield pose
    for event in events:
        yield from _event_and_state(replay, event)


def _event_and_state(replay: Replay, event: AnyEvent) -> Iterator[StateReport | AnyEvent]:
    yield event
    kind = type(event).__name__
    battery = [fraction for ns, fraction in replay.log.battery if ns <= event.robot_ns]
    yield StateReport(
        robot=event.robot, boot_id="", seq=event.number, robot_ns=event.robot_ns,
        state="FINISHED" if kind == "Finished" else "ABORTED" if kind == "Aborted" else "RUNNING",
        run_id=event.run_id, mission_id=event.mission_id, revision=event.revision,
        stop=getattr(event, "stop", None), stop_state="SCANNING" if kind == "Arrived" else "NAVIGATING",
        done=(), skipped=(), battery=battery[-1] if battery else UNKNOWN_CHARGE, last_event=event.number,
    )  # fmt: skip


def _poses(replay: Replay, began_ns: int) -> Iterator[PoseReport]:
    """Yield the poses that differ from the one before."""
    track, run = replay.run.poses, replay.run
    last: tuple[float, float, float, int] | None = None
    rows = zip(track.ns.tolist(), track.xy.tolist(), track.heading.tolist(), strict=True)
    for number, (ns, (x, y), heading) in enumerate(rows):
        if last is not None and ns < last[3] + STEP_S * 1e9 and _near(last, x, y, heading):
            continue
        last = (x, y, heading, ns)
        yield PoseReport(
            robot=run.robot, boot_id="", seq=number, robot_ns=ns, run_id=run.run_id,
            mission_time_s=(ns - began_ns) / 1e9, pose=Pose(x=x, y=y, heading=heading), speed=0.0,
        )  # fmt: skip


def _near(last: tuple[float, float, float, int], x: float, y: float, heading: float) -> bool:
    return math.hypot(x - last[0], y - last[1]) < STEP_M and abs(heading - last[2]) < STEP_RAD
