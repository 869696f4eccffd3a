"""A run as it is heard, report by report; gives its log whenever it is asked."""

from __future__ import annotations

from collections.abc import Sequence

from mission.events import AnyEvent, PoseReport
from mission.run_log import LogSource, RunLog, Track

SOURCE = LogSource(name="heard", format="live", digest="", messages=0)


class HeardRun:
    """Collects what is told of runs, and keeps that of the newest one."""

    def __init__(self) -> None:
        self._run_id: str | None = None
        self._events: dict[int, AnyEvent] = {}
        self._poses: list[PoseReport] = []

    def pose(self, report: PoseReport) -> None:
        """Take a pose, if it is of a run."""
        if self._is_of(report.run_id):
            self._poses.append(report)

    def event(self, event: AnyEvent) -> None:
        """Take an event, if it is of a run; one that is told again counts once."""
        if self._is_of(event.run_id):
            self._events[event.number] = event

    def _is_of(self, run_id: str | None) -> bool:
        """Whether it is a run's; what was kept of another is let go."""
        if run_id and run_id != self._run_id:
            self._run_id, self._events, self._poses = run_id, {}, []
        return bool(run_id)

    def log(self) -> RunLog | None:
        """What was heard of the newest run; None if it told nothing yet."""
        events = tuple(self._events[number] for number in sorted(self._events))
        if not events:
            return None
        last = events[-1]
        return RunLog(
            last.robot, last.run_id, last.mission_id, last.revision, SOURCE, track_of(self._poses), events
        )


def track_of(reports: Sequence[PoseReport]) -> Track:
    """Poses that were told one by one."""
    return Track.of(
        [item.robot_ns for item in reports],
        [(item.pose.x, item.pose.y) for item in reports],
        [item.pose.heading for item in reports],
    )
