"""Collects a run report by report; returns its log, and its comparison, on request."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from stopgo.mission.comparing.compare import compare
from stopgo.mission.comparing.comparison import Comparison
from stopgo.mission.document import Mission
from stopgo.mission.run.boots import joined_boots
from stopgo.mission.run.events import AnyEvent, Health, PoseReport, PosesMissing, ReportsMissing, StateReport
from stopgo.mission.run.run_log import LogSource, RunLog, Track
from stopgo.mission.stages.sight import Sight

SOURCE = LogSource(name="heard", format="live", digest="", messages=0)


class RunSink(Protocol):
    """Receiver of a run's reports, such as a recording."""

    def mission(self, mission: Mission) -> None: ...

    def state(self, report: StateReport) -> None: ...

    def pose(self, report: PoseReport) -> None: ...

    def event(self, event: AnyEvent) -> None: ...

    def health(self, health: Health) -> None: ...

    def missing(self, gap: PosesMissing) -> None: ...

    def incomplete(self, report: ReportsMissing) -> None: ...


class RunCollector:
    """Keeps the reports of the newest run, and passes every report on to a sink, if there is one.

    `sights` hold the visibility data of its plan's stops.
    """

    def __init__(self, sink: RunSink | None = None, sights: Sequence[Sight] = ()) -> None:
        self._sink = sink
        self.sights = sights
        self._run_id: str | None = None
        self._missions: dict[str, Mission] = {}
        self._forget()

    def mission(self, mission: Mission) -> None:
        """Take the mission that is run, or a revision of it."""
        self._missions[mission.digest] = mission
        if self._sink is not None:
            self._sink.mission(mission)

    def state(self, report: StateReport) -> None:
        """Pass a state on."""
        if self._sink is not None:
            self._sink.state(report)

    def pose(self, report: PoseReport) -> None:
        """Take a pose, if it is of a run."""
        if self._is_of(report.run_id):
            ns, poses = self._boots.setdefault(report.boot_id, (array("q"), array("d")))
            ns.append(report.robot_ns)
            poses.extend((report.pose.x, report.pose.y, report.pose.heading))
        if self._sink is not None:
            self._sink.pose(report)

    def event(self, event: AnyEvent) -> None:
        """Take an event, if it is of a run; a repeated one counts once."""
        if self._is_of(event.run_id):
            self._events[event.number] = event
        if self._sink is not None:
            self._sink.event(event)

    def health(self, health: Health) -> None:
        """Pass the health of the robot's base on."""
        if self._sink is not None:
            self._sink.health(health)

    def missing(self, gap: PosesMissing) -> None:
        """Pass a gap in the poses on."""
        if self._sink is not None:
            self._sink.missing(gap)

    def incomplete(self, report: ReportsMissing) -> None:
        """Pass on that topics do not arrive."""
        if self._sink is not None:
            self._sink.incomplete(report)

    def log(self) -> RunLog | None:
        """Return the log of the newest run; None before its first event."""
        if not self._events:
            return None
        tracks = {boot: _track(*columns) for boot, columns in self._boots.items()}
        joined = joined_boots([self._events[number] for number in sorted(self._events)], tracks)
        last, source = joined.events[-1], replace(SOURCE, notes=joined.notes)
        about = (last.robot, last.run_id, last.mission_id, last.revision)
        return RunLog(*about, source, joined.poses, joined.events)

    def compared(self) -> Comparison | None:
        """Return the comparison of the newest run; None if its events or its mission are missing."""
        log = self.log()
        mine = [item for item in self._missions.values() if log is not None and item.id == log.mission_id]
        if log is None or not mine:
            return None
        return compare(log, sorted(mine, key=lambda mission: mission.revision), self.sights)

    def _is_of(self, run_id: str | None) -> bool:
        """True if the run id is not empty; the data of another run is dropped."""
        if run_id and run_id != self._run_id:
            self._run_id = run_id
            self._forget()
        return bool(run_id)

    def _forget(self) -> None:
        self._events: dict[int, AnyEvent] = {}
        self._boots: dict[str, tuple[array[int], array[float]]] = {}
        """Times and poses of each boot of the robot."""


def _track(ns: array[int], poses: array[float]) -> Track:
    table = np.array(poses).reshape(-1, 3)
    return Track.of(np.array(ns, dtype=np.int64), table[:, :2], table[:, 2])


def track_of(reports: Sequence[PoseReport]) -> Track:
    """Return the track of single pose reports."""
    return Track.of(
        [item.robot_ns for item in reports],
        [(item.pose.x, item.pose.y) for item in reports],
        [item.pose.heading for item in reports],
    )
