"""The present run of a robot on the feed: events as soon as the robot reports them, and the driven path.

Invariants:
- Events of the present run have a key each, so that no page misses one; a new run replaces them all.
- An event that came live and is read again from the robot's journal is shown once.
- The path has a bounded number of points; its spacing grows with its length.
"""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from typing import Any

import msgspec

from stopgo.mission.run.events import PoseReport, Started
from stopgo.site.event_feed import EventFeed

SPACING_M = 0.1
"""Smallest distance between two points of the drawn path."""
CHUNK = 50
MOST_CHUNKS = 100
"""Chunks of the path at most; then every second point is left out."""
MOST_EVENTS = 5000

AT_S = 2.0
"""Longest time between an event and the position that is shown with it."""


class PagePath:
    """Points of a run's path at some distance from each other, in chunks on the feed."""

    def __init__(self, feed: EventFeed, robot: str) -> None:
        self._feed = feed
        self._robot = robot
        self.begin("")

    def begin(self, run_id: str) -> None:
        """Begin the path of a run."""
        self._run_id = run_id
        self._spacing = SPACING_M
        self._chunks: list[list[list[float]]] = [[]]
        self._feed.forget("path", self._robot)

    def add(self, x: float, y: float) -> None:
        """Add a position, if it is far enough from the last."""
        last = self._chunks[-1][-1] if self._chunks[-1] else None
        if last is not None and math.dist(last, (x, y)) < self._spacing:
            return
        if len(self._chunks[-1]) >= CHUNK:
            self._chunks.append([list(self._chunks[-1][-1])])
        self._chunks[-1].append([round(x, 2), round(y, 2)])
        if len(self._chunks) > MOST_CHUNKS:
            self._thin()
        self._tell(len(self._chunks) - 1)

    def _thin(self) -> None:
        points = [point for chunk in self._chunks for point in chunk][::2]
        self._spacing *= 2
        self._chunks = [points[k : k + CHUNK + 1] for k in range(0, len(points), CHUNK)]
        self._feed.forget("path", self._robot)
        for number in range(len(self._chunks)):
            self._tell(number)

    def _tell(self, number: int) -> None:
        value = {"run": self._run_id, "spacing": self._spacing, "xy": self._chunks[number]}
        self._feed.tell(("path", self._robot, str(number)), value)


class ShownRun:
    """Run of a robot as pages show it; updated by the link's threads and by the robot's own."""

    def __init__(self, feed: EventFeed, robot: str) -> None:
        self._feed = feed
        self._robot = robot
        self._lock = threading.Lock()
        self._path = PagePath(feed, robot)
        self._events: OrderedDict[int, None] = OrderedDict()
        self.run_id = ""
        """Run that is shown; empty before the first."""

    def begin(self, run_id: str) -> None:
        """Show a run, in place of the one before; nothing if it is shown already."""
        with self._lock:
            self._begin(run_id)

    def _begin(self, run_id: str) -> None:
        if run_id == self.run_id:
            return
        self.run_id = run_id
        self._events.clear()
        self._feed.forget("event", self._robot)
        self._path.begin(run_id)
        self._feed.tell(("run", self._robot), {"run": run_id})

    def take_live(self, event: Any, pose: PoseReport | None) -> None:
        """Show an event that was just reported, if it belongs to the run that is shown, or begins another."""
        with self._lock:
            if isinstance(event, Started):
                self._begin(event.run_id)
            if event.run_id and event.run_id == self.run_id:
                self._show(event, pose)

    def take(self, event: Any, pose: PoseReport | None) -> None:
        """Show an event of the run, as the robot's journal has it."""
        with self._lock:
            if event.run_id == self.run_id:
                self._show(event, pose)

    def _show(self, event: Any, pose: PoseReport | None) -> None:
        if event.number in self._events:
            return
        value = msgspec.to_builtins(event)
        near = pose is not None and abs(pose.robot_ns - event.robot_ns) < AT_S * 1e9
        value["at"] = [round(pose.pose.x, 2), round(pose.pose.y, 2)] if near and pose is not None else None
        self._feed.tell(("event", self._robot, str(event.number)), value, at_once=True)
        self._events[event.number] = None
        if len(self._events) > MOST_EVENTS:
            oldest, _ = self._events.popitem(last=False)
            self._feed.forget("event", self._robot, str(oldest))

    def add_pose(self, report: PoseReport) -> None:
        """Add a position of the run to its path."""
        with self._lock:
            if report.run_id == self.run_id:
                self._path.add(report.pose.x, report.pose.y)
