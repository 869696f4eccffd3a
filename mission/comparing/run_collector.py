"""A run as it is heard, report by report; gives its log, and its comparison, whenever they are asked for."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.document import Mission
from stopgo.mission.run.events import AnyEvent, Health, PoseReport, PosesMissing, StateReport
from stopgo.mission.run.run_log import LogSource, RunLog, Track
from stopgo.mission.stages.sight import Sight

SOURCE = LogSource(name="heard", format="live", digest="", messages=0)


class RunSink(Protocol):
    """What takes a run as it is told, such as a recording."""

    def mission(self, mission: Mission) -> None: ...

    def state(self, report: StateReport) -> None: ...

    def pose(self, report: PoseReport) -> None: ...

    def event(self, event: AnyEvent) -> None: ...

    def health(self, told: Health) -> None: ...

    def missing(self, gap: PosesMissing) -> None: ...


class RunCollector:
    """Keeps what is told of the newest run, and hands everything on to a recording, if there is one.

    `sights` tell what the stops of its plan see.
    """

    def __init__(self, onward: RunSink | None = None, sights: Sequence[Sight] = ()) -> None:
        self._onward = onward
        self.sights = sights
        self._run_id: str | None = None
        self._missions: dict[str, Mission] = {}
        self._forget()

    def mission(self, mission: Mission) -> None:
        """Take the mission that is run, or a revision of it."""
        self._missions[mission.digest] = mission
        if self._onward is not None:
            self._onward.mission(mission)

    def state(self, report: StateReport) -> None:
        """Hand a state on."""
        if self._onward is not None:
            self._onward.state(report)

    def pose(self, report: PoseReport) -> None:
        """Take a pose, if it is of a run."""
        if self._is_of(report.run_id):
            self._ns.append(report.robot_ns)
            self._poses.extend((report.pose.x, report.pose.y, report.pose.heading))
        if self._onward is not None:
            self._onward.pose(report)

    def event(self, event: AnyEvent) -> None:
        """Take an event, if it is of a run; one that is told again counts once."""
        if self._is_of(event.run_id):
            self._events[event.number] = event
        if self._onward is not None:
            self._onward.event(event)

    def health(self, told: Health) -> None:
        """Hand on how the robot's base was."""
        if self._onward is not None:
            self._onward.health(told)

    def missing(self, gap: PosesMissing) -> None:
        """Hand on that nobody knows where the robot was for a time."""
        if self._onward is not None:
            self._onward.missing(gap)

    def log(self) -> RunLog | None:
        """What was heard of the newest run; None if it told nothing yet."""
        events = tuple(self._events[number] for number in sorted(self._events))
        if not events:
            return None
        last, table = events[-1], np.array(self._poses).reshape(-1, 3)
        poses = Track.of(np.array(self._ns, dtype=np.int64), table[:, :2], table[:, 2])
        return RunLog(last.robot, last.run_id, last.mission_id, last.revision, SOURCE, poses, events)

    def compared(self) -> Comparison | None:
        """The newest run beside its mission; None if nothing was heard of either."""
        log = self.log()
        mine = [item for item in self._missions.values() if log is not None and item.id == log.mission_id]
        if log is None or not mine:
            return None
        return compare(log, sorted(mine, key=lambda mission: mission.revision), self.sights)

    def _is_of(self, run_id: str | None) -> bool:
        """Whether it is a run's; what was kept of another is let go."""
        if run_id and run_id != self._run_id:
            self._run_id = run_id
            self._forget()
        return bool(run_id)

    def _forget(self) -> None:
        self._events: dict[int, AnyEvent] = {}
        self._ns, self._poses = array("q"), array("d")


def track_of(reports: Sequence[PoseReport]) -> Track:
    """Poses that were told one by one."""
    return Track.of(
        [item.robot_ns for item in reports],
        [(item.pose.x, item.pose.y) for item in reports],
        [item.pose.heading for item in reports],
    )
