"""One run as it is drawn: pose and driven path, events at stops, state, battery, distance from the route."""

from __future__ import annotations

import math
from functools import partial

import msgspec
import numpy as np
import rerun as rr

from mission.document import Mission, Stop
from mission.events import (
    AnyEvent,
    Arrived,
    Failed,
    Pose,
    PoseReport,
    RevisionDropped,
    RevisionTaken,
    RevisionWaits,
    Scanned,
    Skipped,
    StateReport,
)
from mission.geometry import FloatArray
from recordings import entities, palette, strokes
from recordings.canvas import Canvas, on_screen
from recordings.pens import ORDER
from recordings.robot import draw_robot, quaternions
from recordings.runs.cross_track import cross_track
from recordings.runs.report import StopRecord, run_report
from recordings.runs.revision import change_between, draw_change
from recordings.stages.mission import ABOVE_FLOOR

PIECE_M = 0.05
"""The driven path grows by pieces of at least this length, each a row of its own."""
SAME_M, SAME_RAD, SAME_S = 0.001, math.radians(0.1), 1.0
"""A pose this near to the last one is left out, but for one each second."""
SILENT_S = 10.0
"""After a silence as long as this nobody knows the way the robot took, and none is drawn."""
MARKS = {
    Arrived: (entities.ARRIVED, palette.ARRIVED, ORDER["arrival"]),
    Scanned: (entities.SCANNED, palette.SCANNED, ORDER["scan"]),
    Skipped: (entities.SKIPPED, palette.SKIPPED, ORDER["scan"]),
    Failed: (entities.FAILED, palette.FAILED, ORDER["scan"]),
}
"""Where, as what, and above what an event is marked on the plan."""


class RunDrawing:
    """The entities of one run id on a canvas; grows as the robot tells more."""

    def __init__(self, canvas: Canvas, run_id: str, mission: Mission) -> None:
        self.canvas = canvas
        self.run_id = run_id
        self.names = entities.RunEntities(run_id)
        self.mission = mission
        self.revisions = [mission]
        self.stops = {stop.id: stop for stop in mission.stops}
        self.records: dict[str, StopRecord] = {}
        self._began_ns: int | None = None
        self._last: PoseReport | None = None
        self._drawn: Pose | None = None
        self._towards: Stop | None = None
        self._style()
        self._describe()

    def follow(self, mission: Mission, report: StateReport | PoseReport | AnyEvent) -> None:
        """Go on by another revision of the mission from `report` on, and draw what it changes."""
        self._tell_time(report)
        change, names = change_between(self.mission, mission), self.names.revision(mission.revision)
        draw_change(self.canvas, change, names, partial(self._at, robot_ns=report.robot_ns))
        self.mission = mission
        self.revisions.append(mission)
        self.stops = {stop.id: stop for stop in mission.stops}
        self._towards = None
        self._describe()

    def pose(self, report: PoseReport) -> None:
        """Move the robot, lengthen its path, and measure its distance from the leg it drives."""
        self._tell_time(report)
        if self._last is not None and _same(self._last, report):
            return
        if self._last is not None and report.robot_ns - self._last.robot_ns > SILENT_S * 1e9:
            self._drawn = None
        self._move(report.pose, report.robot_ns, first=self._last is None)
        self._last = report
        self._lengthen(report.pose, report.robot_ns)
        self._measure(report.pose, report.robot_ns)

    def state(self, report: StateReport) -> None:
        """Put the robot's and the stop's state on their lanes, and the battery on its plot."""
        self._towards = self.stops.get(report.stop or "")
        self._at(self.names.flat(entities.STATE), rr.StateChange(state=report.state), report.robot_ns)
        stop_state = "" if report.stop_state is None else report.stop_state
        self._at(self.names.flat(entities.STOP_STATE), rr.StateChange(state=stop_state), report.robot_ns)
        self._at(self.names.flat(entities.STOP), rr.StateChange(state=report.stop or ""), report.robot_ns)
        battery = rr.Scalars(report.battery * 100)
        self._at(self.names.metric(entities.METRIC_BATTERY), battery, report.robot_ns)

    def event(self, event: AnyEvent) -> None:
        """Write the event down whole, mark it on the plan, and bring the report up to date."""
        self._tell_time(event)
        told = {name: value for name, value in msgspec.to_builtins(event).items() if name in EVENT_FIELDS}
        self._at(self.names.events, rr.DynamicArchetype("Event", components=told), event.robot_ns)
        level = "WARN" if isinstance(event, Skipped | Failed) else "INFO"
        line = rr.TextLog(f"{type(event).__name__} {_about(event)}".rstrip(), level=level)
        self._at(self.names.log, line, event.robot_ns)
        if isinstance(event, Arrived):
            self._plot_deviation(event)
        self._mark(event)
        self._report(event)

    def _style(self) -> None:
        """What things look like, which stays the same for the whole run."""
        canvas, names = self.canvas, self.names
        states = rr.StateConfiguration(
            values=list(palette.STATE_COLOURS), colors=list(palette.STATE_COLOURS.values())
        )
        for lane in (entities.STATE, entities.STOP_STATE):
            canvas.show(names.flat(lane), states)
        for metric, name in _PLOTTED.items():
            canvas.show(names.metric(metric), rr.SeriesLines(colors=palette.DRIVEN, names=name, widths=1.5))
        dots = rr.SeriesPoints(colors=palette.ARRIVED.colour, marker_sizes=4, names="deviation")
        canvas.show(names.metric(entities.METRIC_DEVIATION), dots)
        for metric, limits in _LIMITED.items():
            count = len(limits)
            colours, texts = [palette.FAILED.colour] * count, ["tolerance"] * count
            lines = rr.SeriesLines(colors=colours, names=texts, widths=[1.0] * count)
            canvas.show(names.tolerance(metric), lines)

    def _describe(self) -> None:
        """What the run is of, as a property."""
        about = {
            "run_id": self.run_id,
            "mission_id": self.mission.id,
            "mission_name": self.mission.name,
            "revision": self.mission.revision,
            "digest": self.mission.digest,
            "planned_stops": len(self.mission.stops),
            "local_origin": list(self.canvas.origin),
        }
        self.canvas.describe(entities.PROPERTY_RUN, about)

    def _move(self, pose: Pose, robot_ns: int, *, first: bool) -> None:
        """Put the robot at its pose; with the first one its shape is drawn."""
        robots = (self.names.flat(entities.ROBOT), self.names.solid(entities.ROBOT))
        if first:
            draw = partial(self._at, robot_ns=robot_ns)
            draw_robot(draw, *robots, radius=self.mission.robot.radius, colour=palette.DRIVEN)
        place = self.canvas.local(np.array([pose.x, pose.y]))
        turn = rr.Quaternion(xyzw=quaternions(np.array(pose.heading)))
        for robot in robots:
            self._at(robot, rr.Transform3D(translation=[*place, 0.0], quaternion=turn), robot_ns)

    def _lengthen(self, pose: Pose, robot_ns: int) -> None:
        """Add the piece from the last drawn pose, once it is long enough to be seen."""
        before, self._drawn = self._drawn or pose, self._drawn or pose
        if math.dist((before.x, before.y), (pose.x, pose.y)) < PIECE_M:
            return
        piece = self.canvas.local(np.array([(before.x, before.y), (pose.x, pose.y)]))
        flat = rr.LineStrips2D(
            [piece], colors=palette.DRIVEN, radii=on_screen(1.5), draw_order=ORDER["robot"]
        )
        raised = strokes.level(piece, 2 * ABOVE_FLOOR)
        solid = rr.LineStrips3D([raised], colors=palette.DRIVEN, radii=0.03)
        self._at(self.names.flat(entities.DRIVEN), flat, robot_ns)
        self._at(self.names.solid(entities.DRIVEN), solid, robot_ns)
        self._drawn = pose

    def _measure(self, pose: Pose, robot_ns: int) -> None:
        legs = [self._towards] if self._towards is not None else list(self.mission.stops)
        ways: list[FloatArray] = [np.array(stop.approach) for stop in legs if len(stop.approach) > 1]
        if ways:
            distance = cross_track(ways, x=pose.x, y=pose.y)
            self._at(self.names.metric(entities.METRIC_CROSS_TRACK), rr.Scalars(distance * 1000), robot_ns)

    def _mark(self, event: AnyEvent) -> None:
        stop = self.stops.get(getattr(event, "stop", ""))
        if type(event) not in MARKS or stop is None:
            return
        name, meaning, order = MARKS[type(event)]
        place = getattr(event, "pose", None) or stop
        mark = rr.Points2D(
            [self.canvas.local(np.array([place.x, place.y]))],
            class_ids=meaning.number,
            radii=on_screen(3),
            labels=[f"{type(event).__name__} {_about(event)}"],
            show_labels=False,
            draw_order=order,
        )
        self._at(self.names.flat(name), mark, event.robot_ns)

    def _plot_deviation(self, event: Arrived) -> None:
        """In millimetres, with what the mission tolerates at this stop, to both sides of the route too."""
        deviation = rr.Scalars(event.deviation_m * 1000)
        self._at(self.names.metric(entities.METRIC_DEVIATION), deviation, event.robot_ns)
        stop = self.stops.get(event.stop)
        if stop is not None:
            limit = stop.tolerance_m * 1000
            for metric, limits in _LIMITED.items():
                values = rr.Scalars([sign * limit for sign in limits])
                self._at(self.names.tolerance(metric), values, event.robot_ns)

    def _report(self, event: AnyEvent) -> None:
        stop = getattr(event, "stop", None)
        if stop is not None:
            self.records[stop] = self.records.get(stop, StopRecord()).after(event)
        text = run_report(self.revisions, self.run_id, self.records, event)
        document = rr.TextDocument(text, media_type="text/markdown")
        self._at(self.names.flat(entities.RUN_REPORT), document, event.robot_ns)

    def _tell_time(self, report: StateReport | PoseReport | AnyEvent) -> None:
        """Learn when the mission began, from a report that tells."""
        seconds = getattr(report, "mission_time_s", None)
        if seconds is not None:
            self._began_ns = report.robot_ns - round(seconds * 1e9)

    def _at(self, entity: str, archetype: object, robot_ns: int) -> None:
        """At the robot's time, and at mission time once it is known when the mission began."""
        mission_s = None if self._began_ns is None else (robot_ns - self._began_ns) / 1e9
        self.canvas.at(entity, archetype, mission_s=mission_s, robot_ns=robot_ns)


EVENT_FIELDS = (
    *("event", "number", "revision", "stop", "reason", "deviation_m", "commander"),
    *("file", "size", "sha256", "points"),
)
"""What is kept of an event as values, each of one type in all events."""

_PLOTTED = {
    entities.METRIC_CROSS_TRACK: "distance from the route",
    entities.METRIC_BATTERY: "battery",
}


_LIMITED = {entities.METRIC_DEVIATION: (1,), entities.METRIC_CROSS_TRACK: (-1, 1)}
"""Metrics with a tolerance, and on which sides."""


def _same(a: PoseReport, b: PoseReport) -> bool:
    moved = math.dist((a.pose.x, a.pose.y), (b.pose.x, b.pose.y))
    turned = abs(math.remainder(a.pose.heading - b.pose.heading, math.tau))
    return moved < SAME_M and turned < SAME_RAD and b.robot_ns - a.robot_ns < SAME_S * 1e9


def _about(event: AnyEvent) -> str:
    """The event's particulars in a few words."""
    words = [getattr(event, name, "") for name in ("stop", "reason", "commander")]
    if isinstance(event, Arrived):
        words.append(f"{event.deviation_m * 1000:.0f} mm beside")
    if isinstance(event, Scanned):
        words.append(f"{event.file}, {event.points} points")
    if isinstance(event, RevisionTaken):
        words.append(f"revision {event.revision} after {event.before}")
    if isinstance(event, RevisionWaits | RevisionDropped):
        words.append(f"revision {event.waiting}")
    return " ".join(word for word in words if word)
